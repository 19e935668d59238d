#include "engine/certificate/certificate_json.h"

#include <cmath>
#include <cstdio>

namespace clearance::certificate_json {

namespace {

const char* arithmetic(bool in_double_double) {
  return in_double_double ? "double-double" : "float64";
}

Json run_of(std::uint32_t first, std::uint32_t count) {
  if (count == 1) return first;
  return Json::array({first, first + count});
}
Json convex_parts_of(const PartProof& proof) {
  if (proof.part_a == kNone) return nullptr;
  return Json::array({run_of(proof.part_a, proof.count_a), run_of(proof.part_b, proof.count_b)});
}

// Points of a core in closed form; null if the other part has vertices.
Json points_json(const std::vector<Vec3<DoubleDouble>>& points) {
  Json json;
  for (const Vec3<DoubleDouble>& p : points) json.push_back(vector(p));
  return json;
}

// Appends the nonzero terms, each with the name of the rule that derives it.
void add_terms(Json& terms, const char* side, const Body& body, const SlackParts& parts, double between) {
  const auto add = [&](const char* name, double inner, double outer) {
    if (!(inner > 0) && !(outer > 0)) return;
    terms.push_back({{"of", side}, {"name", name}, {"inner", number(inner)}, {"outer", number(outer)}});
  };
  add("shape", body.model_inner, body.model_error);
  add("turn", parts.turn, 0);
  add("age", parts.age, 0);
  add("parent", parts.parent, 0);
  add("placement", parts.placed, parts.placed);
  add("between", between, between);
}

}  // namespace

Json number(double x) {
  if (std::isfinite(x)) return x;
  return std::isnan(x) ? "nan" : x > 0 ? "inf" : "-inf";
}
Json number(const DoubleDouble& x) {
  return Json::array({number(x.hi), number(x.lo)});
}
Json pose(const Pose& X) {
  return Json::array({X.translation.x, X.translation.y, X.translation.z, X.qw, X.qx, X.qy, X.qz});
}
std::string hex(std::uint64_t x) {
  char buffer[24];
  std::snprintf(buffer, sizeof buffer, "%016llx", static_cast<unsigned long long>(x));
  return buffer;
}
std::string text_of(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}
std::string open_text(const Json& json) {
  std::string text = text_of(json);
  text.pop_back();
  return text;
}

Json id_json(std::uint32_t body) {
  if (body == kNone) return nullptr;
  return body;
}

Json lower_json(const PartProof& p) {
  return {{"pieces", convex_parts_of(p)},
          {"order", p.order},
          {"seer", id_json(p.seer)},
          {"arithmetic", arithmetic(p.proof.lower_in_double_double)},
          {"direction", p.proof.is_against_b ? Json(nullptr) : vector(p.proof.direction)}};
}
Json witness_json(const std::optional<WitnessProof>& witness) {
  if (!witness) return nullptr;
  const PartProof& p = witness->proof;
  Json vertices = Json::array(), weights = Json::array(), faces = Json::array(), normals = Json::array();
  for (const ProofVertex& v : p.proof.vertices) {
    vertices.push_back({v.a, v.b});
    weights.push_back(number(v.share));
  }
  for (const ProofFace& f : p.proof.faces) {
    faces.push_back({f.vertex[0], f.vertex[1], f.vertex[2]});
    normals.push_back(vector(f.normal));
  }
  Json json{{"time", witness->time},
            {"poses", {pose(witness->X_wa), pose(witness->X_wb)}},
            {"pieces", convex_parts_of(p)},
            {"arithmetic", arithmetic(p.proof.upper_in_double_double)},
            {"vertices", vertices}};
  if (!p.proof.points_a.empty() || !p.proof.points_b.empty())
    json["points"] = {points_json(p.proof.points_a), points_json(p.proof.points_b)};
  if (p.within != kNone) json["within"] = p.within;
  if (faces.empty() && p.within == kNone) {
    json["weights"] = weights;
  } else {
    json["faces"] = faces;
    json["normals"] = normals;
  }
  return json;
}

Json contact_json(const FirstContactProof& contact) {
  return {{"free_until", number(contact.free_until)},
          {"hit_at", number(contact.hit_at)},
          {"bodies", {id_json(contact.pair.a), id_json(contact.pair.b)}},
          {"witness", witness_json(contact.witness)}};
}

Json slack_json(const SpanPlace& span, const Body& a, const Body& b) {
  Json terms = Json::array();
  add_terms(terms, "a", a, span.parts_a, span.between_a);
  add_terms(terms, "b", b, span.parts_b, span.between_b);
  if (span.joints > 0)
    terms.push_back(
        {{"of", "pair"}, {"name", "joints"}, {"inner", number(span.joints)}, {"outer", number(span.joints)}});
  return {{"inner", number(span.slack.inner)}, {"outer", number(span.slack.outer)}, {"terms", terms}};
}

}  // namespace clearance::certificate_json
