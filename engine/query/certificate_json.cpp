// The document of a certificate, as docs/certificates.md describes it.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "engine/hull/primitive.h"
#include "engine/query/certificate.h"

namespace clearance {

namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kStatusNames[] = {"ok",       "overlap", "contact",      "beyond",    "unconverged",
                                        "bad_pose", "no_pose", "unknown_body", "stale_pose"};

// JSON has no infinity. The library writes other numbers so that they are read back as they are.
Json number(double x) {
  if (std::isfinite(x)) return x;
  return std::isnan(x) ? "nan" : x > 0 ? "inf" : "-inf";
}
// The sum of both is the number.
Json number(const DoubleDouble& x) {
  return Json::array({number(x.hi), number(x.lo)});
}
template <class T>
Json vector(const Vec3<T>& v) {
  return Json::array({number(v.x), number(v.y), number(v.z)});
}
Json pose(const Pose& X) {
  return Json::array({X.translation.x, X.translation.y, X.translation.z, X.qw, X.qx, X.qy, X.qz});
}
// Numbers of 64 bits are text: many readers of JSON have float64 alone.
std::string text(std::uint64_t x) {
  char buffer[24];
  std::snprintf(buffer, sizeof buffer, "%016llx", static_cast<unsigned long long>(x));
  return buffer;
}
const char* arithmetic(bool in_double_double) {
  return in_double_double ? "double-double" : "float64";
}

Json pieces_of(const PieceProof& proof) {
  if (proof.piece_a == kNone) return nullptr;
  return Json::array({proof.piece_a, proof.piece_b});
}
Json lower_json(const PieceProof& p) {
  return {{"pieces", pieces_of(p)},
          {"arithmetic", arithmetic(p.proof.lower_in_double_double)},
          {"direction", vector(p.proof.direction)}};
}
// Of a round core; null: the other piece has vertices.
Json points_json(const std::vector<Vec3<DoubleDouble>>& points) {
  Json json;
  for (const Vec3<DoubleDouble>& p : points) json.push_back(vector(p));
  return json;
}
Json upper_json(const PieceProof& p) {
  Json vertices = Json::array(), weights = Json::array(), faces = Json::array(), normals = Json::array();
  for (const ProofVertex& v : p.proof.vertices) {
    vertices.push_back({v.a, v.b});
    weights.push_back(number(v.share));
  }
  for (const ProofFace& f : p.proof.faces) {
    faces.push_back({f.vertex[0], f.vertex[1], f.vertex[2]});
    normals.push_back(vector(f.normal));
  }
  Json json{
      {"pieces", pieces_of(p)}, {"arithmetic", arithmetic(p.proof.upper_in_double_double)}, {"vertices", vertices}};
  if (!p.proof.points_a.empty() || !p.proof.points_b.empty())
    json["points"] = {points_json(p.proof.points_a), points_json(p.proof.points_b)};
  if (faces.empty()) {
    json["weights"] = weights;
  } else {
    json["faces"] = faces;
    json["normals"] = normals;
  }
  return json;
}

// Those that there are, each with the name of what derives it.
void add_terms(Json& terms, const char* side, const Body& body, const SlackParts& parts, bool composed) {
  const auto add = [&](const char* name, double inner, double outer) {
    if (!(inner > 0) && !(outer > 0)) return;
    terms.push_back({{"of", side}, {"name", name}, {"inner", number(inner)}, {"outer", number(outer)}});
  };
  add("shape", body.model_inner, body.model_error);
  add("turn", parts.turn, 0);
  if (body.max_speed > 0)  // also of a pose that is of now
    terms.push_back(
        {{"of", side}, {"name", "age"}, {"inner", number(parts.age)}, {"outer", 0}, {"age_s", number(parts.age_s)}});
  add("parent", parts.parent, 0);
  if (composed) add("placement", parts.placed, parts.placed);
}

Json span_json(const SpanCertificate& span, const Body& a, const Body& b) {
  Json terms = Json::array(), lower = Json::array();
  add_terms(terms, "a", a, span.parts_a, span.composed_a);
  add_terms(terms, "b", b, span.parts_b, span.composed_b);
  if (span.joints > 0)
    terms.push_back(
        {{"of", "pair"}, {"name", "joints"}, {"inner", number(span.joints)}, {"outer", number(span.joints)}});
  for (const PieceProof& proof : span.lower) lower.push_back(lower_json(proof));
  return {{"poses", {pose(span.X_wa), pose(span.X_wb)}},
          {"follows", {span.follows_a, span.follows_b}},
          {"composed", {span.composed_a, span.composed_b}},
          {"slack", {{"inner", number(span.slack.inner)}, {"outer", number(span.slack.outer)}, {"terms", terms}}},
          {"lower", lower},
          {"upper", span.upper ? upper_json(*span.upper) : Json(nullptr)}};
}

Json row_json(const RowCertificate& row, const Scene& scene) {
  Json spans = Json::array();
  for (const SpanCertificate& span : row.spans)
    spans.push_back(span_json(span, scene.bodies()[row.pair.a], scene.bodies()[row.pair.b]));
  return {{"row", row.row},
          {"configuration", row.configuration},
          {"bodies", {row.pair.a, row.pair.b}},
          {"status", kStatusNames[static_cast<std::size_t>(row.answer.status)]},
          {"lower", number(row.answer.lower)},
          {"upper", number(row.answer.upper)},
          {"proved", row.proved},
          {"spans", spans}};
}

// The bodies that rows name and those that they follow, and their pieces, each once.
class Shapes {
 public:
  void add(std::uint32_t id, const Scene& scene) {
    if (id >= scene.bodies().size() || !known_.insert(id).second) return;
    const Body& body = scene.bodies()[id];
    Json pieces = Json::array();
    for (const PiecePtr& piece : body.pieces) pieces.push_back(place_of(*piece));
    bodies_.push_back(
        {{"id", id},
         {"name", body.name},
         {"source", body.source},
         {"pieces", pieces},
         {"shape", {{"inner", number(body.model_inner)}, {"outer", number(body.model_error)}}},
         {"uncertainty", {{"position", number(body.uncertainty.position)}, {"angle", number(body.uncertainty.angle)}}},
         {"padding", number(body.padding)},
         {"max_speed", number(body.max_speed)}});
  }
  const Json& bodies() const { return bodies_; }
  const Json& pieces() const { return pieces_; }

 private:
  std::size_t place_of(const Piece& piece) {
    const auto [found, is_new] = places_.insert({&piece, pieces_.size()});
    if (is_new) {
      Json vertices = Json::array();
      for (const Vec3d& v : piece.vertices) vertices.push_back(vector(v));
      pieces_.push_back({{"digest", text(piece.digest)},
                         {"loaded_vertices", piece.loaded_vertices},
                         {"radius", number(piece.radius)},
                         {"count", piece.count()},
                         {"vertices", vertices}});
      if (piece.primitive)
        pieces_.back()["core"] = {{"kind", name_of(piece.primitive->kind)}, {"size", vector(piece.primitive->size)}};
    }
    return found->second;
  }

  std::set<std::uint32_t> known_;
  std::map<const Piece*, std::size_t> places_;
  Json bodies_ = Json::array(), pieces_ = Json::array();
};

}  // namespace

std::string to_json(const Certificate& certificate, const Scene& scene) {
  Shapes shapes;
  Json rows = Json::array();
  for (const RowCertificate& row : certificate.rows) {
    shapes.add(row.pair.a, scene);
    shapes.add(row.pair.b, scene);
    for (const SpanCertificate& span : row.spans)
      for (const auto* follows : {&span.follows_a, &span.follows_b})
        for (const std::uint32_t body : *follows) shapes.add(body, scene);
    rows.push_back(row_json(row, scene));
  }
  const Json query{{"max_distance", number(certificate.max_distance)},
                   {"abs_tol", number(certificate.abs_tol)},
                   {"rel_tol", number(certificate.rel_tol)},
                   {"signed", certificate.signed_distance}};
  const Json document{{"format", "clearance certificate"},
                      {"version", 1},
                      {"scene_revision", text(certificate.info.scene_revision)},
                      {"snapshot_revision", certificate.info.snapshot_revision},
                      {"snapshot_stamp_ns", std::to_string(certificate.info.snapshot_stamp_ns)},
                      {"query", query},
                      {"pieces", shapes.pieces()},
                      {"bodies", shapes.bodies()},
                      {"rows", rows}};
  return document.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace clearance
