// Requests that change where things are: poses, joints, points, attachments, pairs that may touch.
#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

#include "server/core/loop.h"
#include "server/requests/request_payload.h"
#include "server/requests/scene_check.h"

namespace clearance {
namespace {

using wire::FrameHeader;
using wire::FrameType;

wire::PosesResult result_of(const PoseUpdateResult& done, std::uint64_t scene_revision) {
  wire::PosesResult result;
  result.revision = done.revision;
  result.scene_revision = scene_revision;
  result.applied = done.applied;
  result.bad = done.bad;
  result.unknown = done.unknown;
  result.fixed = done.fixed;
  return result;
}

Pose pose_of(const double (&seven)[7]) {
  Pose pose;
  std::memcpy(&pose, seven, sizeof pose);
  return pose;
}

PoseUpdateResult apply_joints(Engine& engine, const FrameHeader& header, std::span<const std::byte> payload,
                              std::uint64_t client) {
  const wire::JointUpdateParts parts = wire::parse_joint_update(payload);
  count_copied(payload.size());
  std::vector<JointPosition> positions(parts.joints.size());
  std::vector<std::uint32_t> ids(parts.joints.size());
  for (std::uint64_t i = 0; i < parts.joints.size(); ++i) {
    const wire::JointRecord record = parts.joints[i];
    positions[i] = {record.joint, record.position};
    ids[i] = record.joint;
  }
  check_joint_scene(engine, header, ids);
  return engine.set_joints(positions, parts.header.stamp_ns, parts.header.sequence, client);
}

/// \param name of the body: empty at first; then that of the body whose points these were before, whatever its id is
/// now
PoseUpdateResult apply_points(Engine& engine, const FrameHeader& header, std::span<const std::byte> payload,
                              std::uint64_t client, std::string& name) {
  const auto& [head, xyz] = wire::parse_points(payload);
  std::uint32_t body = head.body;
  const auto& bodies = engine.scene().bodies();
  if (name.empty()) {
    check_scene(engine, header, std::array{body});
    if (body < bodies.size()) name = bodies[body].name;
  } else {
    body = engine.scene().find_body(name);
  }
  std::vector<CloudPoint> copy;  // where they did not arrive as float32s can be read
  std::span<const CloudPoint> points(reinterpret_cast<const CloudPoint*>(xyz.data()), head.count);
  if (reinterpret_cast<std::uintptr_t>(xyz.data()) % alignof(float) != 0) {
    copy.resize(points.size());
    std::memcpy(copy.data(), xyz.data(), xyz.size());
    points = copy;
  }
  const std::optional<double> radius = head.has_radius ? std::optional(head.radius) : std::nullopt;
  return engine.set_points(body, points, radius, head.stamp_ns, head.sequence, client);
}

/// Poses, or positions of joints.
PoseUpdateResult apply_poses(Engine& engine, const FrameHeader& header, std::span<const std::byte> payload,
                             std::uint64_t client) {
  if (header.type == static_cast<std::uint16_t>(FrameType::kSetJoints))
    return apply_joints(engine, header, payload, client);
  const wire::PosesParts parts = wire::parse_poses(payload);
  count_copied(payload.size());
  std::vector<BodyPose> poses(parts.poses.size());
  std::vector<std::uint32_t> ids(parts.poses.size());
  for (std::uint64_t i = 0; i < parts.poses.size(); ++i) {
    const wire::PoseRecord record = parts.poses[i];
    poses[i] = {record.body, pose_of(record.pose)};
    ids[i] = record.body;
  }
  check_scene(engine, header, ids, true);
  return engine.set_poses(poses, parts.header.stamp_ns, parts.header.sequence, client);
}

/// An update that a worker applies to the engine, and to each that takes its place meanwhile.
struct Update {
  std::shared_ptr<Engine> engine;
  OwnPayload payload;
  std::string body;  // of points, its name: another scene may have other ids
  PoseUpdateResult result;
  ResourceQuota::Share points = {};  // under way
  std::uint64_t ignored = 0;         // records

  /// The reply's payload. \param apply takes the request's, without its records
  template <class Fetch, class Apply>
  std::vector<std::byte> make(const ReplyWriter& answers, const FrameHeader& header, const Fetch& fetch,
                              const Apply& apply) {
    if (!payload.begin) payload = fetch();
    ignored = 0;
    result = apply(without_records(answers, header, payload.span(), ignored));
    const wire::PosesResult done = result_of(result, engine->scene_revision());
    const auto bytes = bytes_of(done);
    return {bytes.begin(), bytes.end()};
  }
  /// Whether there is another engine, which needs it too.
  bool begins_again(const std::shared_ptr<Engine>& now) {
    if (engine == now) return false;
    engine = now;
    return true;
  }
};

}  // namespace

wire::PosesResult Loop::set_poses(const FrameHeader& header, std::span<const std::byte> payload, std::uint64_t client) {
  const PoseUpdateResult done = apply_poses(*engine_, header, payload, client);
  count_poses(done);
  return result_of(done, engine_->scene_revision());
}

/// Has the worker apply poses. What their client sends meanwhile goes the same way, so that nothing overtakes them.
void Loop::set_poses_elsewhere(const FrameHeader& header, std::function<OwnPayload()> fetch, std::uint64_t bytes,
                               std::unique_ptr<ReplySink>& sink) {
  const auto update = std::make_shared<Update>(Update{engine_, {}, {}, {}});
  const std::uint64_t client = sink->client();
  const auto make = [=, this, fetch = std::move(fetch)](auto) {
    return update->make(answers_, header, fetch, [&](std::span<const std::byte> body) {
      return apply_poses(*update->engine, header, body, client);
    });
  };
  const auto done = [=, this](bool made) {
    if (made && update->begins_again(engine_)) return false;
    if (--poses_away_.at(client).updates == 0) poses_away_.erase(client);
    stats_.records_ignored += update->ignored;
    if (made) count_poses(update->result);
    return true;
  };
  const ServiceClass service = class_for(*sink, kDefaultOptions);
  reply_elsewhere(header, bytes, FrameType::kPosesDone, make, sink, done);
  ++poses_away_.try_emplace(client, PosesAway{0, service}).first->second.updates;
}

/// Has points taken up by a worker of their own, so that nobody waits for the tree that is made of them.
void Loop::set_points_elsewhere(const FrameHeader& header, std::function<OwnPayload()> fetch, std::uint64_t bytes,
                                std::unique_ptr<ReplySink>& sink) {
  const auto update = std::make_shared<Update>(Update{engine_, {}, {}, {}});
  const std::uint64_t client = sink->client(), rest = sizeof(wire::PointsHeader) + header.records_bytes;
  const std::uint64_t count = (bytes - std::min(bytes, rest)) / sizeof(CloudPoint);
  const auto make = [=, this, fetch = std::move(fetch)](auto) {
    return update->make(answers_, header, fetch, [&](std::span<const std::byte> body) {
      return apply_points(*update->engine, header, body, client, update->body);
    });
  };
  const auto done = [=, this](bool made) {
    if (made && update->begins_again(engine_)) return false;
    if (made) points_of_body_[update->body] = std::move(update->points);
    update->points.release();
    stats_.records_ignored += update->ignored;
    if (!made) return true;
    ++stats_["points.updates"];
    stats_["points.applied"] += update->result.applied;
    poses_changed_ = true;
    return true;
  };
  const ServiceClass service = class_for(*sink, kDefaultOptions);
  quotas_.check_requests(client);
  quotas_.check_bytes(client, service, bytes, sink->unsent_bytes());
  if (count > options_.max_points_of_body)
    throw RejectedRequest{wire::ErrorCode::kTooLarge,
                          "points: " + std::to_string(count) + " points of one body are more than the " +
                              std::to_string(options_.max_points_of_body) +
                              " that there may be (limit max-body-points)"};
  points_.check(client, count);
  update->points = points_.take(client, count);
  PendingRequest asked{nullptr, header, quotas_.take(client, service, bytes)};
  asked.sink = std::move(sink);
  points_worker_.add(std::make_unique<BackgroundRequest>(answers_, std::move(asked), service, FrameType::kPosesDone,
                                                         turn_began_, make, done));
}

PoseUpdateResult Loop::on_poses(std::span<const BodyPose> poses, std::int64_t stamp_ns, std::int64_t sequence,
                                std::uint64_t publisher) {
  const PoseUpdateResult done = engine_->set_poses(poses, stamp_ns, sequence, publisher);
  count_poses(done);
  return done;
}

PoseUpdateResult Loop::on_joints(std::span<const JointPosition> positions, std::int64_t stamp_ns, std::int64_t sequence,
                                 std::uint64_t publisher) {
  const PoseUpdateResult done = engine_->set_joints(positions, stamp_ns, sequence, publisher);
  count_poses(done);
  return done;
}

void Loop::count_poses(const PoseUpdateResult& done) {
  ++stats_["poses.batches"];
  stats_["poses.applied"] += done.applied;
  stats_["poses.bad"] += done.bad;
  stats_["poses.unknown"] += done.unknown;
  stats_["poses.fixed"] += done.fixed;
  poses_changed_ = true;
}

wire::PosesResult Loop::attach(const FrameHeader& header, std::span<const std::byte> payload) {
  const wire::PayloadParts parts = wire::split_payload(header, payload);
  const auto [record, allowed, passed_over, epoch] = wire::parse_attach(parts.body, parts.records);
  answers_.check_epoch(header, epoch);
  stats_.records_ignored += passed_over.size();
  check_scene(*engine_, header, std::array{record.child}, true);
  if (record.parent != kNone) check_scene(*engine_, header, std::array{record.parent});
  check_scene(*engine_, header, allowed);
  const Pose X_pc = pose_of(record.pose);
  const bool is_behind = header.scene_revision && header.scene_revision != engine_->scene_revision();
  const auto done = engine_->attach(record.child, record.parent, record.has_pose ? &X_pc : nullptr, allowed);
  ++stats_["attachments"];
  poses_changed_ = true;
  // Who knew the scene before this knows the one after it; who was behind goes on with the ids that it knows.
  return result_of(done, is_behind ? header.scene_revision : engine_->scene_revision());
}

wire::PosesResult Loop::allow(const FrameHeader& header, std::span<const std::byte> payload) {
  const wire::AllowRecord record = wire::parse_allow(payload);
  check_scene(*engine_, header, std::array{record.a, record.b});
  const bool is_behind = header.scene_revision && header.scene_revision != engine_->scene_revision();
  const auto done = engine_->allow(record.a, record.b, record.allow);
  ++stats_[record.allow ? "pairs.allowed" : "pairs.forbidden"];
  return result_of(done, is_behind ? header.scene_revision : engine_->scene_revision());
}

}  // namespace clearance
