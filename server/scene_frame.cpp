#include "scene_frame.h"

#include <algorithm>
#include <cstring>

#include "engine/scene/pose_store.h"
#include "wire/wire.h"

namespace clearance {
namespace {

using wire::append;

wire::BodyRecord record_of(const Body& body, const BodyState& state) {
  wire::BodyRecord record;
  wire::set_name(record.name, body.name);
  record.parent = state.parent;
  record.is_static = body.is_static;
  record.piece_count = static_cast<std::uint32_t>(body.pieces.size());
  record.model_error = body.model_error;
  record.hull_excess = body.hull_excess;
  record.empty_share = body.empty_share;
  for (const PiecePtr& piece : body.pieces) {
    record.vertex_count += piece->vertices.size();
    record.extent = std::max(record.extent, piece->rho + piece->radius);
  }
  return record;
}

}  // namespace

std::vector<std::byte> scene_payload(const Engine& engine) {
  const Scene& scene = engine.scene();
  std::vector<std::uint32_t> members;
  std::vector<wire::GroupRecord> groups;
  for (const Group& group : scene.groups()) {
    wire::GroupRecord record;
    wire::set_name(record.name, group.name);
    record.first_member = static_cast<std::uint32_t>(members.size());
    record.member_count = static_cast<std::uint32_t>(group.bodies.size());
    members.insert(members.end(), group.bodies.begin(), group.bodies.end());
    groups.push_back(record);
  }
  wire::SceneHeader header;
  header.scene_revision = engine.scene_revision();
  header.body_count = static_cast<std::uint32_t>(scene.bodies().size());
  header.group_count = static_cast<std::uint32_t>(groups.size());
  header.member_count = static_cast<std::uint32_t>(members.size());
  QueryView all_pairs;
  all_pairs.reduce = Reduce::kMin;  // one row: a scene whose dense answer would be too large has pairs all the same
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

std::vector<std::byte> states_payload(const Engine& engine) {
  wire::StatesHeader header;
  header.count = engine.scene().bodies().size();
  header.revision = engine.pose_revision();
  header.now_ns = monotonic_ns();
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
  return payload;
}

}  // namespace clearance
