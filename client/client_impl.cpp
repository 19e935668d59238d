#include "client/client_impl.h"

#include <algorithm>

namespace clearance {

SceneInfo Client::Impl::fetch_scene() {
  const auto frame = call(wire::FrameType::kDescribe, {}, wire::FrameType::kScene, 0);
  const auto parts = checked([&] { return wire::parse_scene(body_of(*frame)); });
  SceneInfo info;
  info.revision = parts.header.scene_revision;
  info.pair_count = parts.header.pair_count;
  info.backend = wire::name_of(parts.header.backend);
  info.bodies.reserve(parts.bodies.size());
  for (std::uint64_t i = 0; i < parts.bodies.size(); ++i) {
    const wire::BodyRecord r = parts.bodies[i];
    info.bodies.push_back({wire::name_of(r.name), r.parent, r.is_static != 0, r.piece_count, r.vertex_count,
                           r.model_error, r.extent, r.hull_excess, r.empty_share, r.triangle_count, r.is_solid != 0,
                           r.is_cloud != 0});
  }
  for (std::uint64_t i = 0; i < parts.groups.size(); ++i) {
    const wire::GroupRecord r = parts.groups[i];
    GroupInfo group{wire::name_of(r.name), {}};
    for (std::uint32_t m = 0; m < r.member_count; ++m) group.bodies.push_back(parts.members[r.first_member + m]);
    info.groups.push_back(std::move(group));
  }
  return info;
}

bool Client::Impl::ids_mean_the_same(const SceneInfo& now, bool parents) const {
  const auto same = [](const auto& then, const auto& others, auto equal) {
    return std::equal(then.begin(), then.begin() + std::min(then.size(), others.size()), others.begin(), equal);
  };
  return same(scene->bodies, now.bodies,
              [parents](const BodyInfo& a, const BodyInfo& b) {
                return a.name == b.name && (!parents || a.parent == b.parent);
              }) &&
         same(scene->groups, now.groups, [](const GroupInfo& a, const GroupInfo& b) { return a.name == b.name; });
}

UpdateResult Client::Impl::send_poses(std::span<const std::pair<std::uint32_t, Pose7>> poses, std::int64_t stamp_ns,
                                      std::int64_t sequence, std::span<const Twist6> velocities) {
  std::vector<std::byte> payload(sizeof(wire::PosesHeader) + poses.size() * sizeof(wire::PoseRecord));
  wire::PosesHeader header;
  header.count = poses.size();
  header.stamp_ns = stamp_ns;
  header.sequence = sequence;
  std::memcpy(payload.data(), &header, sizeof header);
  std::byte* at = payload.data() + sizeof header;
  for (const auto& [body, pose] : poses) {
    wire::PoseRecord record;
    record.body = body;
    std::copy(pose.begin(), pose.end(), record.pose);
    std::memcpy(at, &record, sizeof record);
    at += sizeof record;
  }
  const auto ask = [&](std::uint64_t revision) {
    const std::uint64_t request =
        send(wire::FrameType::kSetPoses, payload, {}, 0, revision, wire::velocity_records(std::as_bytes(velocities)));
    return poses_done(*receive(request, wire::FrameType::kPosesDone));
  };
  revision_of_ids();
  try {
    return ask(poses_revision);
  } catch (const RequestError& error) {
    if (error.code != static_cast<std::uint16_t>(wire::ErrorCode::kWrongScene) || !scene) throw;
    // The scene changed, by an attachment perhaps. Where an id still means the same body with the same parent, so does
    // its pose, and the update can be sent again. The caller has not seen the new scene: its queries stay those for the
    // old.
    const SceneInfo now = fetch_scene();
    for (const auto& [body, pose] : poses) {
      if (body >= scene->bodies.size()) continue;
      if (body >= now.bodies.size() || now.bodies[body].name != scene->bodies[body].name ||
          now.bodies[body].parent != scene->bodies[body].parent)
        throw;
    }
    if (ids_mean_the_same(now, true)) poses_revision = now.revision;  // the next update's, too
    return ask(now.revision);
  }
}

}  // namespace clearance
