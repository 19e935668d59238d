#include "client/requests.h"

#include <algorithm>
#include <stdexcept>
#include <string>

namespace clearance {

wire::QueryHeader header_of(const Query& query, std::optional<std::uint32_t> plan) {
  if (plan && !(query.configurations.empty() && query.positions.empty()))
    throw std::invalid_argument("on_device: poses and positions go into the device query's memory, not into its query");
  const std::uint64_t configurations = plan ? *plan : configuration_count(query);
  // Throws for a count that is too large.
  wire::query_payload_bytes(query.pairs.size(), query.bodies.size(), plan ? 0 : configurations);
  wire::QueryHeader q;
  copy_options(query, q);
  q.pair_count = static_cast<std::uint32_t>(query.pairs.size());
  q.body_count = static_cast<std::uint32_t>(query.bodies.size());
  q.configuration_count = static_cast<std::uint32_t>(configurations);
  q.all_pairs = query.pairs.empty() && query.all_pairs;
  return q;
}

std::vector<std::byte> query_records(const Query& query) {
  constexpr std::size_t kOthers = 64;  // headers and padding
  std::vector<std::byte> records = wire::option_records(query);
  records.reserve(records.size() + query.margins.size_bytes() + query.pair_margins.size_bytes() +
                  query.weights.size_bytes() + query.speed_errors.size_bytes() + kOthers);
  const auto add = [&records](wire::QueryRecord tag, std::span<const std::byte> array) {
    if (!array.empty()) wire::insert_record(records, static_cast<std::uint16_t>(tag), wire::kRecordRequired, array);
  };
  add(wire::QueryRecord::kMargins, std::as_bytes(query.margins));
  add(wire::QueryRecord::kPairMargins, std::as_bytes(query.pair_margins));
  add(wire::QueryRecord::kWeights, std::as_bytes(query.weights));
  add(wire::QueryRecord::kSpeedErrors, std::as_bytes(query.speed_errors));
  return records;
}

void add_inputs(const Query& query, bool with_configurations, RecordList& records) {
  wire::QueryInputs inputs{query.joints, query.positions, query.growths, query.velocities, query.twists};
  if (!with_configurations) inputs = {.joints = query.joints};
  wire::for_each_input(
      inputs, [&records](wire::QueryRecord tag, std::span<const std::byte> bytes) { records.insert(tag, bytes); });
}

std::uint64_t expected_reply_bytes(const wire::QueryHeader& q, std::span<const IdPair> pairs, std::size_t joints,
                                   const SceneInfo* scene, std::uint32_t k) {
  using Wide = unsigned __int128;
  const Wide configurations = std::max<std::uint32_t>(q.configuration_count, 1);
  const auto reduce = static_cast<Reduce>(q.reduce);
  Wide rows = configurations;
  if (reduce != Reduce::kMin && reduce != Reduce::kAny) {
    const bool selectors =
        std::any_of(pairs.begin(), pairs.end(), [](const IdPair& p) { return (p[0] | p[1]) & kGroupBit; });
    if (!scene && (q.all_pairs || selectors || reduce == Reduce::kNearest)) return 0;
    Wide each = q.all_pairs ? scene->pair_count : pairs.size();
    if (selectors) each *= scene->pair_count;  // each selector pair expands to enabled pairs
    if (reduce == Reduce::kNearest) each = k ? std::min<Wide>(k, each) : scene->bodies.size();
    rows *= each;
    if (reduce == Reduce::kWithin) rows = std::min<Wide>(rows, q.max_results);
  }
  std::uint32_t fields = q.fields;
  if (reduce != Reduce::kNone) fields |= kFieldPair | kFieldConfiguration;
  if (rows > wire::kMaxFrameBytes) return 0;
  try {
    return sizeof(wire::FrameHeader) + sizeof(wire::ReplyHeader) +
           wire::columns_bytes(static_cast<std::uint64_t>(rows), fields, joints);
  } catch (const wire::WireError&) {
    return 0;  // only the daemon knows the size, and reports it
  }
}

void set_body_name(char (&field)[64], std::string_view name) {
  if (name.size() > static_cast<std::size_t>(kMaxNameBytes))
    throw std::invalid_argument("name: expected at most " + std::to_string(kMaxNameBytes) + " bytes, got " +
                                std::to_string(name.size()));
  wire::set_name(field, name);
}

std::vector<std::byte> payload_of(const NewBody& body) {
  const int shapes = !body.vertices.empty() + body.box.has_value() + body.sphere.has_value() +
                     body.capsule.has_value() + body.cylinder.has_value() + body.cone.has_value() +
                     body.ellipsoid.has_value() + body.half_space + body.points.has_value();
  if (shapes != 1)
    throw std::invalid_argument(
        "add_body: expected one of vertices, box, sphere, capsule, cylinder, cone, ellipsoid, half_space and points, "
        "got " +
        std::to_string(shapes));
  if (body.mesh_as != MeshAs::kHull && body.mesh_as != MeshAs::kAuto && body.triangles.empty())
    throw std::invalid_argument("add_body: mesh_as is for a mesh, and there are no triangles");
  if (body.voxel != 0 && !body.points) throw std::invalid_argument("add_body: voxel is only for points");
  if (!body.triangles.empty() && body.vertices.empty())
    throw std::invalid_argument("add_body: triangles are only for vertices");
  wire::NewBodyRecord record;
  set_body_name(record.name, body.name);
  record.parent = body.parent;
  record.is_static = body.is_static;
  record.has_pose = body.pose.has_value();
  if (body.pose) std::copy(body.pose->begin(), body.pose->end(), record.pose);
  record.radius = body.radius;
  record.vertex_count = body.vertices.size();
  const auto shape = [&record](wire::BodyShape kind, std::initializer_list<double> size) {
    record.shape = static_cast<std::uint8_t>(kind);
    std::copy(size.begin(), size.end(), record.size);
  };
  if (body.box) shape(wire::BodyShape::kBox, {(*body.box)[0], (*body.box)[1], (*body.box)[2]});
  if (body.sphere) shape(wire::BodyShape::kSphere, {*body.sphere});
  if (body.capsule) shape(wire::BodyShape::kCapsule, {(*body.capsule)[0], (*body.capsule)[1]});
  if (body.cone) shape(wire::BodyShape::kCone, {(*body.cone)[0], (*body.cone)[1]});
  if (body.ellipsoid)
    shape(wire::BodyShape::kEllipsoid, {(*body.ellipsoid)[0], (*body.ellipsoid)[1], (*body.ellipsoid)[2]});
  if (body.half_space) shape(wire::BodyShape::kHalfSpace, {});
  if (body.points) shape(wire::BodyShape::kCloud, {body.voxel});
  if (body.cylinder) shape(wire::BodyShape::kCylinder, {(*body.cylinder)[0], (*body.cylinder)[1]});
  std::vector<std::byte> payload;
  wire::append(payload, record);
  wire::append_bytes(payload, body.vertices.data(), body.vertices.size_bytes());
  return payload;
}

std::vector<std::byte> records_of(const NewBody& body, bool replaces) {
  const wire::BodyUncertaintyRecord uncertainties{body.uncertainty_position, body.uncertainty_angle, body.padding,
                                                  body.max_speed};
  std::vector<std::byte> records;
  if (uncertainties.uncertainty_position != 0 || uncertainties.uncertainty_angle != 0 || uncertainties.padding != 0 ||
      uncertainties.max_speed != 0)
    wire::append_record(records, static_cast<std::uint16_t>(wire::NewBodyTag::kUncertainty), wire::kRecordRequired,
                        std::as_bytes(std::span(&uncertainties, 1)));
  if (body.points)
    wire::append_record(records, static_cast<std::uint16_t>(wire::NewBodyTag::kPoints), wire::kRecordRequired,
                        std::as_bytes(*body.points));
  if (replaces)
    wire::append_record(records, static_cast<std::uint16_t>(wire::NewBodyTag::kReplace), wire::kRecordRequired, {});
  if (body.triangles.empty()) return records;
  static_assert(sizeof(body.triangles[0]) == sizeof(wire::TriangleRecord));
  wire::append_record(records, static_cast<std::uint16_t>(wire::NewBodyTag::kTriangles), wire::kRecordRequired,
                      std::as_bytes(body.triangles));
  wire::append_record(records, static_cast<std::uint16_t>(wire::NewBodyTag::kMeshAs), wire::kRecordRequired,
                      std::as_bytes(std::span(&body.mesh_as, 1)));
  return records;
}

}  // namespace clearance
