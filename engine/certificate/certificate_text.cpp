#include "engine/certificate/certificate_text.h"

#include <algorithm>
#include <cstring>

#include "engine/certificate/certificate_json.h"
#include "engine/certificate/certificate_moves.h"
#include "engine/hull/primitive.h"
#include "engine/scene/body_ball.h"

namespace clearance {

using namespace certificate_json;

namespace {

constexpr std::uint64_t kVerticesAtOnce = 64, kUnitsPerItem = 8;
constexpr std::size_t kStepsAtOnce = 512;  // of a SurfaceLister
constexpr std::uint64_t kStepsPerUnit = 16;

constexpr const char* kStatusNames[] = {"ok",       "overlap", "contact",      "beyond",    "unconverged",
                                        "bad_pose", "no_pose", "unknown_body", "stale_pose"};

const char* name_of_reduce(Reduce reduce) {
  return reduce == Reduce::kAny ? "any" : reduce == Reduce::kMin ? "min" : "none";
}

}  // namespace

std::uint32_t part_place(const Body& body, std::uint32_t part) {
  std::uint32_t place = 0;
  for (std::uint32_t i = 0; i < part; ++i) place += body.parts[i]->surface ? body.parts[i]->surface->size() : 1;
  return place;
}

void CertificateText::add(const std::string& text) {
  if (text.size() > most_ - std::min<std::uint64_t>(most_, text_.size()))
    throw engine::QueryError(
        QueryErrorCode::kTooLarge,
        "certificate: the document takes more than " + std::to_string(most_) + " bytes: request fewer rows at a time");
  const std::size_t at = text_.size();
  text_.resize(at + text.size());
  std::memcpy(text_.data() + at, text.data(), text.size());
}

void CertificateText::add_item(const std::string& text, bool& is_first) {
  add(is_first ? text : "," + text);
  is_first = false;
}

void CertificateText::begin(const ReplyInfo& info) {
  const QueryView& query = plan_.query;
  const Json options{{"reduce", name_of_reduce(query.reduce)},     {"motions", query.max_evaluations > 0},
                     {"max_distance", number(query.max_distance)}, {"abs_tol", number(query.abs_tol)},
                     {"rel_tol", number(query.rel_tol)},           {"signed_distance", query.signed_distance}};
  add(open_text({{"format", "clearance certificate"},
                 {"version", 3},
                 {"scene_revision", hex(info.scene_revision)},
                 {"snapshot_revision", info.snapshot_revision},
                 {"snapshot_stamp_ns", std::to_string(info.snapshot_stamp_ns)},
                 {"query", options}}));
  add(",\"rows\":[");
}

void CertificateText::begin_row(std::uint64_t row, std::uint64_t configuration, BodyPair pair,
                                const PairAnswer& answer) {
  configurations_.insert(configuration);
  add_item(open_text({{"row", row},
                      {"configuration", configuration},
                      {"bodies", {id_json(pair.a), id_json(pair.b)}},
                      {"status", kStatusNames[static_cast<std::size_t>(answer.status)]},
                      {"lower", number(answer.lower)},
                      {"upper", number(answer.upper)}}),
           first_row_);
  add(",\"pairs\":[");
  first_pair_ = true;
}

void CertificateText::begin_pair(BodyPair pair, const BodyPoses& here, double margin, double lower) {
  for (const std::uint32_t body : {pair.a, pair.b}) {
    name(body, here);
    in_pairs_.insert(body);
  }
  here_ = &here;
  add_item(open_text({{"bodies", {pair.a, pair.b}}, {"margin", number(margin)}, {"lower", number(lower)}}),
           first_pair_);
  add(",\"spans\":[");
  first_span_ = true;
  is_free_ = false;
}

void CertificateText::begin_span(BodyPair pair, const SpanPlace& span) {
  Json json{{"begin", span.begin},
            {"end", span.end},
            {"at", span.at},
            {"slack", slack_json(span, scene_.bodies()[pair.a], scene_.bodies()[pair.b])}};
  if (!span.progress[0].empty()) json["progress"] = Json::array({Json(span.progress[0]), Json(span.progress[1])});
  add_item(open_text(json), first_span_);
  add(",\"lower\":[");
  first_lower_ = true;
}

void CertificateText::add_lower(const PartProof& proof) {
  if (proof.seer != kNone) name(proof.seer, *here_);
  add_item(text_of(lower_json(proof)), first_lower_);
}

void CertificateText::end_span() {
  add("]}");
}

void CertificateText::begin_free(double lower) {
  add("],\"free\":" + open_text({{"lower", number(lower)}}) + ",\"spans\":[");
  first_span_ = true;
  is_free_ = true;
}

void CertificateText::end_pair() {
  add(is_free_ ? "]}}" : "],\"free\":null}");
}

void CertificateText::end_row(const std::optional<WitnessProof>& witness,
                              const std::optional<FirstContactProof>& contact, bool proved) {
  add("],\"witness\":" + text_of(witness_json(witness)));
  add(",\"first_contact\":" + text_of(contact ? contact_json(*contact) : Json(nullptr)));
  add(proved ? ",\"proved\":true}" : ",\"proved\":false}");
}

// Names each body once, after the body that it follows.
void CertificateText::name(std::uint32_t id, const BodyPoses& here) {
  if (known_.contains(id)) return;
  known_[id] = here.has_uncertainties() ? here.uncertainty(id).parts.age_s : 0;
  for (const std::uint32_t on : {carrier_of(id), plan_.snapshot->parent[id]})
    if (on != kNone) name(on, here);
  bodies_.push_back(id);
}

// The joint that places a link, or null.
const RobotJoint* CertificateText::joint_of(std::uint32_t id) const {
  const Body& body = scene_.bodies()[id];
  if (body.robot == kNone) return nullptr;
  const RobotModel& model = scene_.robots()[body.robot]->model;
  const std::uint32_t joint = model.links[body.link].joint;
  return joint == kNone || model.joints[joint].kind == JointKind::kFloating ? nullptr : &model.joints[joint];
}

// The body in whose frame the body's pose or joint is given.
std::uint32_t CertificateText::carrier_of(std::uint32_t id) const {
  const RobotJoint* const joint = joint_of(id);
  if (!joint) return plan_.snapshot->parent[id];
  const SceneRobot& robot = *scene_.robots()[scene_.bodies()[id].robot];
  return joint->parent == robot.model.base ? robot.base : robot.bodies[joint->parent];  // base link and base coincide
}

bool CertificateText::end(WorkMeter& meter) {
  if (part_ == Part::kRows) {
    add("],\"bodies\":[");
    part_ = Part::kBodies;
  }
  for (; next_body_ < bodies_.size(); ++next_body_) {
    if (meter.is_over()) return false;
    add_body(bodies_[next_body_]);
    meter.count(kUnitsPerItem + scene_.bodies()[bodies_[next_body_]].parts.size());
  }
  if (part_ == Part::kBodies) {
    add("],\"pieces\":[");
    part_ = Part::kPieces;
  }
  while (next_part_ < parts_.size()) {
    if (meter.is_over()) return false;
    add_convex_part(meter);
  }
  if (part_ == Part::kPieces) {
    add("],\"configurations\":[");
    part_ = Part::kConfigurations;
  }
  while (!configurations_.empty()) {
    if (meter.is_over()) return false;
    add_configuration(*configurations_.begin());
    configurations_.erase(configurations_.begin());
    meter.count(kUnitsPerItem + plan_.given_bodies + plan_.joints.size());
  }
  if (part_ == Part::kConfigurations) add("]}\n");
  part_ = Part::kOver;
  return true;
}

// Values of all joints and bodies in the document that the query moves.
void CertificateText::add_configuration(std::uint64_t k) {
  const bool is_motion = plan_.query.max_evaluations > 0, has_any = plan_.query.configuration_count > 0;
  const std::uint64_t points = is_motion ? plan_.query.control_points : 1;
  Json poses = Json::object(), positions = Json::object();
  for (std::size_t i = 0; i < plan_.given_bodies; ++i)
    for (std::uint64_t p = 0; has_any && p < points && known_.contains(plan_.bodies[i]); ++p) {
      const std::size_t at = (k * points + p) * plan_.given_bodies + i;
      Json control = pose(plan_.configurations[at]);
      if (!plan_.growths.empty()) control.push_back(plan_.growths[at]);
      poses[std::to_string(plan_.bodies[i])].push_back(std::move(control));
    }
  for (std::size_t j = 0; j < plan_.joints.size(); ++j)
    for (std::uint64_t p = 0; has_any && p < points; ++p)
      positions[std::to_string(plan_.joints[j])].push_back(
          number(plan_.positions[(k * points + p) * plan_.joints.size() + j]));
  add_item(text_of({{"configuration", k}, {"poses", poses}, {"positions", positions}}), first_configuration_);
}

void CertificateText::add_body(std::uint32_t id) {
  const Body& body = scene_.bodies()[id];
  Json convex_parts = Json::array();
  for (const ConvexPartPtr& part : body.parts) {
    if (!in_pairs_.contains(id)) break;
    const auto [found, is_new] = places_.insert({part.get(), parts_.size()});
    if (is_new) parts_.push_back(part.get());
    convex_parts.push_back(found->second);
  }
  const RobotJoint* const joint = joint_of(id);
  const Json moves =
      joint ? moves_of(*joint, *scene_.robots()[body.robot], plan_.snapshot->joints.position) : Json::array();
  const Pose stands = joint ? Pose{joint->X_pj.xyz, 1, 0, 0, 0} : plan_.snapshot->local[id];
  bool is_first = next_body_ == 0;
  add_item(text_of({{"id", id},
                    {"name", body.name},
                    {"source", body.source},
                    {"pieces", convex_parts},
                    {"centre", vector(ball_around(body).centre)},
                    {"on", id_json(carrier_of(id))},
                    {"joint", joint ? Json(joint->name) : Json(nullptr)},
                    {"pose", pose(stands)},
                    {"moves", moves},
                    {"shape", {{"inner", number(body.model_inner)}, {"outer", number(body.model_error)}}},
                    {"uncertainty",
                     {{"position", number(body.uncertainty.position)}, {"angle", number(body.uncertainty.angle)}}},
                    {"padding", number(body.padding)},
                    {"max_speed", number(body.max_speed)},
                    {"age_s", number(known_[id])}}),
           is_first);
}

// Returns true if the slice ended before all elements of the current part were listed.
bool CertificateText::lists_elements(const Surface& surface, WorkMeter& meter) {
  if (!elements_) elements_.emplace(surface);
  while (!elements_->advance(kStepsAtOnce)) {
    meter.count(kStepsAtOnce / kStepsPerUnit);
    if (meter.is_over()) return true;
  }
  return false;
}

// Writes some vertices and elements of the current part.
void CertificateText::add_convex_part(WorkMeter& meter) {
  const ConvexPart& part = *parts_[next_part_];
  if (part.surface && lists_elements(*part.surface, meter)) return;
  const SurfaceRows* const rows = part.surface ? &elements_->rows() : nullptr;
  bool is_first = next_part_ == 0;
  if (next_vertex_ == 0) {
    Json json{{"digest", hex(part.surface ? part.surface->digest() : part.digest)},
              {"loaded_vertices", rows ? rows->loaded : part.loaded_vertices},
              {"radius", number(part.radius)},
              {"count", rows ? rows->vertices.size() : part.count()}};
    if (part.primitive)
      json["core"] = {{"kind", name_of(part.primitive->kind)}, {"size", vector(part.primitive->size)}};
    if (part.surface) json["solid"] = part.surface->is_solid();
    add_item(open_text(json), is_first);
    add(",\"vertices\":[");
  }
  const std::vector<Vec3d>& vertices = rows ? rows->vertices : part.vertices;
  const std::size_t elements = part.surface ? part.surface->size() : 0;
  // Vertices precede elements.
  for (std::size_t n = 0; n < kVerticesAtOnce && next_vertex_ < vertices.size() + elements; ++n, ++next_vertex_) {
    bool is_first_row = next_vertex_ == 0 || next_vertex_ == vertices.size();
    if (next_vertex_ == vertices.size()) add("],\"elements\":[");
    if (next_vertex_ < vertices.size())
      add_item(text_of(vector(vertices[next_vertex_])), is_first_row);
    else
      add_item(text_of(rows->element(next_vertex_ - vertices.size())), is_first_row);
  }
  meter.count(kUnitsPerItem + kVerticesAtOnce);
  if (next_vertex_ < vertices.size() + elements) return;
  add("]}");
  ++next_part_;
  next_vertex_ = 0;
  elements_.reset();
}

}  // namespace clearance
