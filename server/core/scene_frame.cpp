#include "server/core/scene_frame.h"

#include <algorithm>
#include <cstring>

#include "engine/bvh/surface.h"
#include "engine/scene/body_ball.h"
#include "engine/state/pose_store.h"
#include "wire/wire.h"

namespace clearance {
namespace {

using wire::append;

wire::BodyRecord record_of(const Body& body, const BodyState& state) {
  wire::BodyRecord record;
  wire::set_name(record.name, body.name);
  record.parent = state.parent;
  record.is_static = body.is_static;
  record.piece_count = static_cast<std::uint32_t>(body.parts.size());
  record.model_error = body.model_error;
  record.hull_excess = body.hull_excess;
  record.empty_share = body.empty_share;
  const Surface* surface = surface_of(body);
  record.is_solid = surface && surface->is_solid();
  record.is_cloud = is_cloud(body);
  record.triangle_count = triangle_count(body);
  record.extent = extent_of(body);
  for (const ConvexPartPtr& part : body.parts) record.vertex_count += part->vertices.size();
  return record;
}

/// Groups as records, whose members are appended.
/// @param ids_of members of a group
template <class Group, class Ids>
std::vector<wire::GroupRecord> group_records(const std::vector<Group>& groups, Ids Group::* ids_of,
                                             std::vector<std::uint32_t>& members) {
  std::vector<wire::GroupRecord> records;
  for (const Group& group : groups) {
    const Ids& ids = group.*ids_of;
    wire::GroupRecord& record = records.emplace_back();
    wire::set_name(record.name, group.name);
    record.first_member = static_cast<std::uint32_t>(members.size());
    record.member_count = static_cast<std::uint32_t>(ids.size());
    members.insert(members.end(), ids.begin(), ids.end());
  }
  return records;
}

/// Writes the header again with the time, which is that after all states were read: no age is below 0.
template <class Header>
void set_clock(Header& header, std::vector<std::byte>& payload) {
  header.now_ns = monotonic_ns();
  std::memcpy(payload.data(), &header, sizeof header);
}

}  // namespace

std::vector<std::byte> scene_payload(const engine::Engine& engine) {
  const engine::Scene& scene = engine.scene();
  std::vector<std::uint32_t> members;
  const auto groups = group_records(scene.groups(), &Group::bodies, members);
  wire::SceneHeader header;
  header.scene_revision = engine.scene_revision();
  header.body_count = static_cast<std::uint32_t>(scene.bodies().size());
  header.group_count = static_cast<std::uint32_t>(groups.size());
  header.member_count = static_cast<std::uint32_t>(members.size());
  QueryView all_pairs;
  all_pairs.reduce = Reduce::kMin;  // one row, so that the size of a dense answer does not matter
  header.pair_count = engine.size(all_pairs).pairs;
  wire::set_name(header.backend, engine.backend());

  std::vector<std::byte> payload;
  append(payload, header);
  for (std::uint32_t i = 0; i < scene.bodies().size(); ++i)
    append(payload, record_of(scene.bodies()[i], engine.body_state(i)));
  for (const auto& group : groups) append(payload, group);
  for (const std::uint32_t member : members) append(payload, member);
  return payload;
}

std::vector<std::byte> joints_payload(const engine::Engine& engine) {
  const engine::Scene& scene = engine.scene();
  std::vector<std::uint32_t> members;
  const auto groups = group_records(scene.joint_groups(), &JointGroup::joints, members);
  wire::JointsHeader header;
  header.scene_revision = engine.scene_revision();
  header.revision = engine.pose_revision();
  header.joint_count = static_cast<std::uint32_t>(scene.joints().size());
  header.group_count = static_cast<std::uint32_t>(groups.size());
  header.member_count = static_cast<std::uint32_t>(members.size());
  std::vector<std::byte> payload;
  append(payload, header);
  for (std::uint32_t j = 0; j < header.joint_count; ++j) {
    const SceneJoint& joint = scene.joints()[j];
    const JointState state = engine.joint_state(j);
    wire::JointStateRecord record;
    wire::set_name(record.name, joint.name);
    record.lower = joint.lower;
    record.upper = joint.upper;
    record.position = state.position;
    record.stamp_ns = state.stamp_ns;
    record.receipt_ns = state.receipt_ns;
    record.status = static_cast<std::uint8_t>(state.status);
    record.beyond_limits = state.beyond_limits;
    append(payload, record);
  }
  set_clock(header, payload);
  for (const auto& group : groups) append(payload, group);
  for (const std::uint32_t member : members) append(payload, member);
  return payload;
}

std::vector<std::byte> states_payload(const engine::Engine& engine) {
  wire::StatesHeader header;
  header.count = engine.scene().bodies().size();
  header.revision = engine.pose_revision();
  std::vector<std::byte> payload;
  append(payload, header);
  for (std::uint32_t i = 0; i < header.count; ++i) {
    const BodyState state = engine.body_state(i);
    wire::BodyStateRecord record;
    static_assert(sizeof record.pose == sizeof state.X_wb);
    std::memcpy(record.pose, &state.X_wb, sizeof record.pose);
    record.stamp_ns = state.stamp_ns;
    record.receipt_ns = state.receipt_ns;
    record.parent = state.parent;
    record.status = static_cast<std::uint8_t>(state.status);
    append(payload, record);
  }
  set_clock(header, payload);
  return payload;
}

}  // namespace clearance
