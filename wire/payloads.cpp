// Payloads of the other frames: poses, scenes, bodies, counters, errors.
#include "wire/checks.h"

namespace clearance::wire {
namespace {

/// Checks that names are terminated, and that members are in the list and below `count`.
void expect_groups(const std::string& what, const Records<GroupRecord>& groups, const Records<std::uint32_t>& members,
                   std::uint64_t count, const char* thing) {
  for (std::uint64_t i = 0; i < groups.size(); ++i) {
    const GroupRecord group = groups[i];
    expect_name(group.name, (what + ": groups").c_str(), i);
    if (std::uint64_t{group.first_member} + group.member_count > members.size())
      bad_frame(what + ": groups[" + str(i) + "]: its members go past the end of the list");
  }
  for (std::uint64_t i = 0; i < members.size(); ++i)
    if (members[i] >= count) bad_frame(what + ": members[" + str(i) + "] is no " + thing);
}

/// @param each numbers of an entry
UpdateExtras update_extras(const char* what, std::span<const std::byte> records, std::uint64_t count,
                           std::uint64_t each) {
  UpdateExtras extras;
  extras.epoch = read_records(what, records, extras.passed_over, [&](const RecordView& record) {
    if (record.tag != static_cast<std::uint16_t>(UpdateRecord::kVelocities)) return false;
    const std::string velocities = std::string(what) + ": velocities (record " + str(record.tag) + ")";
    expect_size(
        velocities.c_str(), [&] { return str(count) + " times " + str(each) + " numbers"; },
        Wide(count) * each * sizeof(double), record.bytes.size());
    extras.velocities = Records<double>(record.bytes.data(), count * each);
    return true;
  });
  return extras;
}

}  // namespace

std::vector<std::byte> velocity_records(std::span<const std::byte> velocities) {
  std::vector<std::byte> records;
  if (!velocities.empty())
    append_record(records, static_cast<std::uint16_t>(UpdateRecord::kVelocities), kRecordRequired, velocities);
  return records;
}

PosesParts parse_poses(std::span<const std::byte> payload, std::span<const std::byte> records) {
  PosesParts parts;
  parts.header = head<PosesHeader>(payload, "poses");
  expect_size(
      "poses", [&] { return str(parts.header.count) + " poses"; },
      sizeof(PosesHeader) + Wide(parts.header.count) * sizeof(PoseRecord), payload.size());
  expect_zero(parts.header.reserved, "poses");
  parts.poses = Records<PoseRecord>(payload.data() + sizeof(PosesHeader), parts.header.count);
  parts.extras = update_extras("poses", records, parts.header.count, 6);
  return parts;
}

JointUpdateParts parse_joint_update(std::span<const std::byte> payload, std::span<const std::byte> records) {
  JointUpdateParts parts;
  parts.header = head<PosesHeader>(payload, "joints");
  expect_size(
      "joints", [&] { return str(parts.header.count) + " positions"; },
      sizeof(PosesHeader) + Wide(parts.header.count) * sizeof(JointRecord), payload.size());
  expect_zero(parts.header.reserved, "joints");
  parts.joints = Records<JointRecord>(payload.data() + sizeof(PosesHeader), parts.header.count);
  parts.extras = update_extras("joints", records, parts.header.count, 1);
  return parts;
}

PointsParts parse_points(std::span<const std::byte> payload) {
  constexpr std::size_t kPointBytes = 3 * sizeof(float);
  PointsParts parts;
  parts.header = head<PointsHeader>(payload, "points");
  expect_size(
      "points", [&] { return str(parts.header.count) + " points"; },
      sizeof(PointsHeader) + Wide(parts.header.count) * kPointBytes, payload.size());
  expect_zero(parts.header.reserved, "points");
  if (parts.header.has_radius > 1)
    bad_frame("points: has_radius " + std::to_string(parts.header.has_radius) + " is neither 0 nor 1");
  parts.xyz = payload.subspan(sizeof(PointsHeader));
  return parts;
}

AttachParts parse_attach(std::span<const std::byte> payload, std::span<const std::byte> records) {
  AttachParts parts;
  parts.record = head<AttachRecord>(payload, "attach");
  expect_size("attach", its_contents, sizeof(AttachRecord), payload.size());
  const int has_pose = parts.record.has_pose;
  if (has_pose > 1) bad_frame("attach: has_pose " + std::to_string(has_pose) + " is neither 0 nor 1");
  parts.epoch = read_records("attach", records, parts.passed_over, [&](const RecordView& record) {
    if (record.tag != static_cast<std::uint16_t>(AttachTag::kAllow)) return false;
    if (record.bytes.size() % 4)
      bad_frame("attach: allow has " + str(record.bytes.size()) + " bytes, not a whole number of ids");
    parts.allow.resize(record.bytes.size() / 4);
    std::memcpy(parts.allow.data(), record.bytes.data(), record.bytes.size());
    return true;
  });
  return parts;
}

AllowRecord parse_allow(std::span<const std::byte> payload) {
  const auto record = head<AllowRecord>(payload, "allow");
  expect_size("allow", its_contents, sizeof(AllowRecord), payload.size());
  if (record.allow > 1) bad_frame("allow: " + std::to_string(record.allow) + " is neither 0 nor 1");
  expect_zero(record.padding, "allow");
  return record;
}

PosesResult parse_poses_done(std::span<const std::byte> payload) {
  const auto result = head<PosesResult>(payload, "poses done");
  expect_size("poses done", its_contents, sizeof(PosesResult), payload.size());
  return result;
}

SceneParts parse_scene(std::span<const std::byte> payload) {
  SceneParts parts;
  parts.header = head<SceneHeader>(payload, "scene");
  const SceneHeader& h = parts.header;
  expect_size(
      "scene",
      [&] {
        return str(h.body_count) + " bodies, " + str(h.group_count) + " groups and " + str(h.member_count) + " members";
      },
      sizeof(SceneHeader) + Wide(h.body_count) * sizeof(BodyRecord) + Wide(h.group_count) * sizeof(GroupRecord) +
          Wide(h.member_count) * 4,
      payload.size());
  Cursor cursor(payload.data() + sizeof(SceneHeader));
  parts.bodies = cursor.take<BodyRecord>(h.body_count);
  parts.groups = cursor.take<GroupRecord>(h.group_count);
  parts.members = cursor.take<std::uint32_t>(h.member_count);
  if (strnlen(h.backend, sizeof h.backend) == sizeof h.backend) bad_frame("scene: the backend's name does not end");
  for (std::uint64_t i = 0; i < parts.bodies.size(); ++i) expect_name(parts.bodies[i].name, "scene: bodies", i);
  expect_groups("scene", parts.groups, parts.members, h.body_count, "body");
  return parts;
}

JointsParts parse_joints(std::span<const std::byte> payload) {
  JointsParts parts;
  parts.header = head<JointsHeader>(payload, "joints");
  const JointsHeader& h = parts.header;
  expect_size(
      "joints",
      [&] {
        return str(h.joint_count) + " joints, " + str(h.group_count) + " groups and " + str(h.member_count) +
               " members";
      },
      sizeof(JointsHeader) + Wide(h.joint_count) * sizeof(JointStateRecord) +
          Wide(h.group_count) * sizeof(GroupRecord) + Wide(h.member_count) * 4,
      payload.size());
  Cursor cursor(payload.data() + sizeof(JointsHeader));
  parts.joints = cursor.take<JointStateRecord>(h.joint_count);
  parts.groups = cursor.take<GroupRecord>(h.group_count);
  parts.members = cursor.take<std::uint32_t>(h.member_count);
  for (std::uint64_t i = 0; i < parts.joints.size(); ++i) expect_name(parts.joints[i].name, "joints: joints", i);
  expect_groups("joints", parts.groups, parts.members, h.joint_count, "joint");
  return parts;
}

PairTableParts parse_pair_table(std::span<const std::byte> payload) {
  PairTableParts parts;
  parts.header = head<PairsHeader>(payload, "pair table");
  expect_size(
      "pair table", [&] { return str(parts.header.count) + " pairs"; },
      sizeof(PairsHeader) + Wide(parts.header.count) * sizeof(PairRecord), payload.size());
  parts.pairs = Records<PairRecord>(payload.data() + sizeof(PairsHeader), parts.header.count);
  return parts;
}

StatesParts parse_states(std::span<const std::byte> payload) {
  StatesParts parts;
  parts.header = head<StatesHeader>(payload, "body states");
  expect_size(
      "body states", [&] { return str(parts.header.count) + " bodies"; },
      sizeof(StatesHeader) + Wide(parts.header.count) * sizeof(BodyStateRecord), payload.size());
  parts.states = Records<BodyStateRecord>(payload.data() + sizeof(StatesHeader), parts.header.count);
  return parts;
}

namespace {

// Reads a record of a kAddBody into `parts`. Returns whether the tag is known.
bool read_new_body_record(const RecordView& record, NewBodyParts& parts) {
  const auto size = record.bytes.size();
  switch (static_cast<NewBodyTag>(record.tag)) {
    case NewBodyTag::kUncertainty:
      if (size != sizeof parts.uncertainties)
        bad_frame("new body: uncertainty (record 20) has " + str(size) + " bytes, expected " +
                  str(sizeof parts.uncertainties));
      std::memcpy(&parts.uncertainties, record.bytes.data(), sizeof parts.uncertainties);
      return true;
    case NewBodyTag::kTriangles:
      if (size == 0 || size % sizeof(TriangleRecord) != 0)
        bad_frame("new body: triangles (record 21) have " + str(size) + " bytes, expected " +
                  str(sizeof(TriangleRecord)) + " for each, and one at least");
      if (parts.record.shape != static_cast<std::uint8_t>(BodyShape::kHull))
        bad_query("new body: triangles are only for vertices");
      parts.triangles = Records<TriangleRecord>(record.bytes.data(), size / sizeof(TriangleRecord));
      return true;
    case NewBodyTag::kMeshAs:
      if (size != 1) bad_frame("new body: mesh_as (record 22) has " + str(size) + " bytes, expected 1");
      if (const auto value = std::to_integer<std::size_t>(record.bytes[0]); value >= kMeshAsWords.size())
        bad_query("new body: mesh_as " + str(value) + " is not one of 0 to " + str(kMeshAsWords.size() - 1));
      if (parts.triangles.size() == 0) bad_query("new body: mesh_as is for a mesh, and there are no triangles");
      parts.mesh_as = static_cast<MeshAs>(record.bytes[0]);
      return true;
    case NewBodyTag::kPoints:
      if (size % sizeof parts.points[0] != 0)
        bad_frame("new body: points (record 23) have " + str(size) + " bytes, expected " + str(sizeof parts.points[0]) +
                  " for each");
      if (parts.record.shape != static_cast<std::uint8_t>(BodyShape::kCloud))
        bad_query("new body: points are only for a cloud");
      parts.points = Records<std::array<float, 3>>(record.bytes.data(), size / sizeof parts.points[0]);
      return true;
    case NewBodyTag::kReplace:
      if (size != 0) bad_frame("new body: replace (record 24) has " + str(size) + " bytes, expected 0");
      parts.replaces = true;
      return true;
  }
  return false;
}

}  // namespace

NewBodyParts parse_new_body(std::span<const std::byte> payload, std::span<const std::byte> records) {
  NewBodyParts parts;
  parts.record = head<NewBodyRecord>(payload, "new body");
  const NewBodyRecord& r = parts.record;
  expect_size(
      "new body", [&] { return str(r.vertex_count) + " vertices"; },
      sizeof(NewBodyRecord) + Wide(r.vertex_count) * sizeof(VertexRecord), payload.size());
  expect_name(r.name, "new body", 0);
  if (r.shape > static_cast<std::uint8_t>(BodyShape::kCloud))
    bad_query("new body: shape " + str(r.shape) + " is not one of 0 to 8");
  if (r.shape != static_cast<std::uint8_t>(BodyShape::kHull) && r.vertex_count)
    bad_query("new body: vertices are only for a hull");
  if (r.is_static > 1 || r.has_pose > 1) bad_query("new body: is_static and has_pose are 0 or 1");
  expect_zero(r.reserved, "new body");
  parts.vertices = Records<VertexRecord>(payload.data() + sizeof(NewBodyRecord), r.vertex_count);
  parts.epoch = read_records("new body", records, parts.passed_over,
                             [&](const RecordView& record) { return read_new_body_record(record, parts); });
  return parts;
}

RemoveBodyRecord parse_remove_body(std::span<const std::byte> payload) {
  const auto record = head<RemoveBodyRecord>(payload, "remove body");
  expect_size("remove body", its_contents, sizeof(RemoveBodyRecord), payload.size());
  expect_name(record.name, "remove body", 0);
  return record;
}

SceneChange parse_scene_changed(std::span<const std::byte> payload) {
  const auto change = head<SceneChange>(payload, "scene changed");
  expect_size("scene changed", its_contents, sizeof(SceneChange), payload.size());
  expect_zero(change.reserved, "scene changed");
  return change;
}

Records<CounterRecord> parse_stats(std::span<const std::byte> payload) {
  if (payload.size() % sizeof(CounterRecord))
    bad_frame("stats: " + str(payload.size()) + " bytes are not a whole number of records of " +
              str(sizeof(CounterRecord)));
  const Records<CounterRecord> counters(payload.data(), payload.size() / sizeof(CounterRecord));
  for (std::uint64_t i = 0; i < counters.size(); ++i) expect_name(counters[i].name, "stats: counters", i);
  return counters;
}

ErrorParts parse_error(std::span<const std::byte> payload) {
  ErrorParts parts;
  parts.header = head<ErrorHeader>(payload, "error");
  expect_size(
      "error", [&] { return "a text of " + str(parts.header.text_bytes) + " bytes and its header"; },
      Wide(sizeof(ErrorHeader)) + parts.header.text_bytes, payload.size());
  const auto text = payload.subspan(sizeof(ErrorHeader));
  parts.text.assign(reinterpret_cast<const char*>(text.data()), text.size());
  return parts;
}

void parse_empty(std::span<const std::byte> payload, std::uint16_t type) {
  if (!payload.empty())
    bad_frame("a " + type_name(type) + " frame has no payload, got " + str(payload.size()) + " bytes");
}

}  // namespace clearance::wire
