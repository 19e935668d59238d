#include "engine/query/certificate_text.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <nlohmann/json.hpp>

#include "engine/hull/primitive.h"

namespace clearance {

namespace {

using Json = nlohmann::ordered_json;

constexpr std::uint64_t kVerticesAtOnce = 64, kUnitsPerItem = 8;

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

std::string text_of(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}
// An object that goes on: without its last brace.
std::string open_text(const Json& json) {
  std::string text = text_of(json);
  text.pop_back();
  return text;
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

Json place_json(const SpanPlace& span, const Body& a, const Body& b) {
  Json terms = Json::array();
  add_terms(terms, "a", a, span.parts_a, span.composed_a);
  add_terms(terms, "b", b, span.parts_b, span.composed_b);
  if (span.joints > 0)
    terms.push_back(
        {{"of", "pair"}, {"name", "joints"}, {"inner", number(span.joints)}, {"outer", number(span.joints)}});
  return {{"poses", {pose(span.X_wa), pose(span.X_wb)}},
          {"follows", {span.follows_a, span.follows_b}},
          {"composed", {span.composed_a, span.composed_b}},
          {"slack", {{"inner", number(span.slack.inner)}, {"outer", number(span.slack.outer)}, {"terms", terms}}}};
}

}  // namespace

void CertificateText::add(const std::string& text) {
  if (text.size() > most_ - std::min<std::uint64_t>(most_, text_.size()))
    throw QueryError(QueryErrorCode::kTooLarge, "certificate: the document takes more than " + std::to_string(most_) +
                                                    " bytes: ask for fewer rows at a time");
  const std::size_t at = text_.size();
  text_.resize(at + text.size());
  std::memcpy(text_.data() + at, text.data(), text.size());
}

void CertificateText::add_item(const std::string& text, bool& is_first) {
  add(is_first ? text : "," + text);
  is_first = false;
}

void CertificateText::begin(const ReplyInfo& info, const QueryView& query) {
  const Json asked{{"max_distance", number(query.max_distance)},
                   {"abs_tol", number(query.abs_tol)},
                   {"rel_tol", number(query.rel_tol)},
                   {"signed", query.signed_distance}};
  add(open_text({{"format", "clearance certificate"},
                 {"version", 1},
                 {"scene_revision", text(info.scene_revision)},
                 {"snapshot_revision", info.snapshot_revision},
                 {"snapshot_stamp_ns", std::to_string(info.snapshot_stamp_ns)},
                 {"query", asked}}));
  add(",\"rows\":[");
}

void CertificateText::begin_row(std::uint64_t row, std::uint64_t configuration, BodyPair pair,
                                const PairAnswer& answer) {
  name(pair.a);
  name(pair.b);
  add_item(open_text({{"row", row},
                      {"configuration", configuration},
                      {"bodies", {pair.a, pair.b}},
                      {"status", kStatusNames[static_cast<std::size_t>(answer.status)]},
                      {"lower", number(answer.lower)},
                      {"upper", number(answer.upper)}}),
           first_row_);
  add(",\"spans\":[");
}

void CertificateText::begin_span(BodyPair pair, const SpanPlace& place) {
  for (const auto* follows : {&place.follows_a, &place.follows_b})
    for (const std::uint32_t body : *follows) name(body);
  add(open_text(place_json(place, scene_.bodies()[pair.a], scene_.bodies()[pair.b])));
  add(",\"lower\":[");
  first_lower_ = true;
}

void CertificateText::add_lower(const PieceProof& proof) {
  add_item(text_of(lower_json(proof)), first_lower_);
}

void CertificateText::end_span(const std::optional<PieceProof>& upper) {
  add("],\"upper\":" + (upper ? text_of(upper_json(*upper)) : "null") + "}");
}

void CertificateText::end_row(bool proved) {
  add(proved ? "],\"proved\":true}" : "],\"proved\":false}");
}

// Each once.
void CertificateText::name(std::uint32_t id) {
  if (id < scene_.bodies().size() && known_.insert(id).second) bodies_.push_back(id);
}

bool CertificateText::end(WorkMeter& meter) {
  if (part_ == Part::kRows) {
    add("],\"bodies\":[");
    part_ = Part::kBodies;
  }
  for (; next_body_ < bodies_.size(); ++next_body_) {
    if (meter.is_over()) return false;
    add_body(bodies_[next_body_]);
    meter.count(kUnitsPerItem + scene_.bodies()[bodies_[next_body_]].pieces.size());
  }
  if (part_ == Part::kBodies) {
    add("],\"pieces\":[");
    part_ = Part::kPieces;
  }
  while (next_piece_ < pieces_.size()) {
    if (meter.is_over()) return false;
    add_piece(meter);
  }
  if (part_ == Part::kPieces) add("]}\n");
  part_ = Part::kOver;
  return true;
}

void CertificateText::add_body(std::uint32_t id) {
  const Body& body = scene_.bodies()[id];
  Json pieces = Json::array();
  for (const PiecePtr& piece : body.pieces) {
    const auto [found, is_new] = places_.insert({piece.get(), pieces_.size()});
    if (is_new) pieces_.push_back(piece.get());
    pieces.push_back(found->second);
  }
  bool is_first = next_body_ == 0;
  add_item(text_of({{"id", id},
                    {"name", body.name},
                    {"source", body.source},
                    {"pieces", pieces},
                    {"shape", {{"inner", number(body.model_inner)}, {"outer", number(body.model_error)}}},
                    {"uncertainty",
                     {{"position", number(body.uncertainty.position)}, {"angle", number(body.uncertainty.angle)}}},
                    {"padding", number(body.padding)},
                    {"max_speed", number(body.max_speed)}}),
           is_first);
}

// Some vertices of the piece whose turn it is.
void CertificateText::add_piece(WorkMeter& meter) {
  const Piece& piece = *pieces_[next_piece_];
  bool is_first = next_piece_ == 0;
  if (next_vertex_ == 0) {
    Json json{{"digest", text(piece.digest)},
              {"loaded_vertices", piece.loaded_vertices},
              {"radius", number(piece.radius)},
              {"count", piece.count()}};
    if (piece.primitive)
      json["core"] = {{"kind", name_of(piece.primitive->kind)}, {"size", vector(piece.primitive->size)}};
    add_item(open_text(json), is_first);
    add(",\"vertices\":[");
  }
  const std::size_t end = std::min<std::size_t>(piece.vertices.size(), next_vertex_ + kVerticesAtOnce);
  bool is_first_vertex = next_vertex_ == 0;
  for (; next_vertex_ < end; ++next_vertex_) add_item(text_of(vector(piece.vertices[next_vertex_])), is_first_vertex);
  meter.count(kUnitsPerItem + kVerticesAtOnce);
  if (end < piece.vertices.size()) return;
  add("]}");
  ++next_piece_;
  next_vertex_ = 0;
}

}  // namespace clearance
