#include "server/core/state_updates.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>
#include <vector>

#include "engine/narrow/work_meter.h"
#include "server/requests/request_payload.h"
#include "server/requests/scene_check.h"

namespace clearance {
namespace {

using wire::FrameHeader;
using wire::FrameType;

ResourceQuota::Limit point_limit(std::uint64_t most, const char* whose, const char* option, wire::ErrorCode code) {
  return {most, code, [=](std::uint64_t held, std::uint64_t more) {
            return "points: " + std::to_string(held + more) + " points " + whose +
                   ", with those that they replace are more than the " + std::to_string(most) + " that are allowed (" +
                   option + ")";
          }};
}

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

/// An update, which may be applied to several engines, one after the other.
struct Update {
  std::shared_ptr<engine::Engine> engine;
  FrameHeader header;
  std::uint64_t client = 0;
  std::function<OwnPayload()> fetch = nullptr;  // on a worker
  OwnPayload payload = {};
  std::string body = {};  // whose points these are, found in the first engine: its id may differ in another scene
  ResourceQuota::Share points = {};
  PoseUpdateResult result = {};

  /// \param content the payload with its records
  void apply(const ReplyWriter& answers, std::span<const std::byte> content, std::uint64_t& ignored);
  void apply_poses(const wire::PosesParts& parts);
  void apply_joints(const wire::JointUpdateParts& parts);
  void apply_points(std::span<const std::byte> content);
  std::vector<std::byte> apply_on_worker(const ReplyWriter& answers, std::uint64_t& ignored);
  /// Returns true if the daemon has replaced the engine, whose successor then needs the same update.
  bool begins_again(const std::shared_ptr<engine::Engine>& now) {
    if (engine == now) return false;
    engine = now;
    return true;
  }
};

void Update::apply(const ReplyWriter& answers, std::span<const std::byte> content, std::uint64_t& ignored) {
  const auto type = static_cast<FrameType>(header.type);
  if (type == FrameType::kSetPoints) return apply_points(without_records(answers, header, content, ignored));
  count_copied(content.size());
  const wire::PayloadParts whole = wire::split_payload(header, content);
  const auto accept = [&](const wire::UpdateExtras& extras) {
    ignored += extras.passed_over.size();
    answers.check_epoch(header, extras.epoch);
  };
  if (type == FrameType::kSetJoints) {
    const wire::JointUpdateParts parts = wire::parse_joint_update(whole.body, whole.records);
    accept(parts.extras);
    return apply_joints(parts);
  }
  const wire::PosesParts parts = wire::parse_poses(whole.body, whole.records);
  accept(parts.extras);
  apply_poses(parts);
}

void Update::apply_poses(const wire::PosesParts& parts) {
  const wire::Records<double>& velocities = parts.extras.velocities;
  std::vector<BodyPose> poses(parts.poses.size());
  std::vector<std::uint32_t> ids(parts.poses.size());
  for (std::uint64_t i = 0; i < parts.poses.size(); ++i) {
    const wire::PoseRecord record = parts.poses[i];
    poses[i] = {record.body, pose_of(record.pose)};
    for (std::size_t k = 0; k < 6 && velocities.size() > 0; ++k) poses[i].velocity[k] = velocities[6 * i + k];
    ids[i] = record.body;
  }
  check_scene(*engine, header, ids, true);
  result = engine->set_poses(poses, parts.header.stamp_ns, parts.header.sequence, client);
}

void Update::apply_joints(const wire::JointUpdateParts& parts) {
  const wire::Records<double>& velocities = parts.extras.velocities;
  std::vector<JointPosition> positions(parts.joints.size());
  std::vector<std::uint32_t> ids(parts.joints.size());
  for (std::uint64_t i = 0; i < parts.joints.size(); ++i) {
    const wire::JointRecord record = parts.joints[i];
    positions[i] = {record.joint, record.position, velocities.size() > 0 ? velocities[i] : kUnknownSpeed};
    ids[i] = record.joint;
  }
  check_joint_scene(*engine, header, ids);
  result = engine->set_joints(positions, parts.header.stamp_ns, parts.header.sequence, client);
}

void Update::apply_points(std::span<const std::byte> content) {
  const auto& [head, xyz] = wire::parse_points(content);
  std::uint32_t id = head.body;
  const auto& bodies = engine->scene().bodies();
  if (body.empty()) {
    check_scene(*engine, header, std::array{id});
    if (id < bodies.size()) body = bodies[id].name;
  } else {
    id = engine->scene().find_body(body);
  }
  std::vector<CloudPoint> copy;  // of points that arrived unaligned
  std::span<const CloudPoint> cloud(reinterpret_cast<const CloudPoint*>(xyz.data()), head.count);
  if (reinterpret_cast<std::uintptr_t>(xyz.data()) % alignof(float) != 0) {
    copy.resize(cloud.size());
    std::memcpy(copy.data(), xyz.data(), xyz.size());
    cloud = copy;
  }
  const std::optional<double> radius = head.has_radius ? std::optional(head.radius) : std::nullopt;
  result = engine->set_points(id, cloud, radius, head.stamp_ns, head.sequence, client);
}

/// Returns the reply's payload.
std::vector<std::byte> Update::apply_on_worker(const ReplyWriter& answers, std::uint64_t& ignored) {
  if (fetch) payload = std::exchange(fetch, nullptr)();
  apply(answers, payload.span(), ignored);
  const wire::PosesResult done = result_of(result, engine->scene_revision());
  const auto bytes = bytes_of(done);
  return {bytes.begin(), bytes.end()};
}

BackgroundRequest::Make applying(const std::shared_ptr<Update>& update, const ReplyWriter& answers) {
  return [update, &answers](auto, std::uint64_t& ignored) { return update->apply_on_worker(answers, ignored); };
}

}  // namespace

StateUpdates::StateUpdates(RequestContext& context, const PointLimits& limits)
    : context_(context),
      max_points_of_body_(limits.max_points_of_body),
      points_(point_limit(limits.max_points_of_client, "of this client", "limit max-client-points",
                          wire::ErrorCode::kTooLarge),
              point_limit(limits.max_points, "of all clients", "limit max-points", wire::ErrorCode::kBusy)) {}

void StateUpdates::set_poses(Request& request) {
  engine::Engine& engine = *context_.engine;
  const bool moves_many = request.type->type == FrameType::kSetJoints && engine.scene().bodies().size() > kFewBodies;
  if (request.is_large() || moves_many || context_.has_pose_updates(request.sink->client()))
    return set_poses_on_worker(request);
  Update update{context_.engine, request.header, request.sink->client()};
  update.apply(context_.answers, request.payload, context_.stats.records_ignored);
  count(update.result);
  context_.reply(request, bytes_of(result_of(update.result, engine.scene_revision())));
}

void StateUpdates::set_poses_on_worker(Request& request) {
  const std::uint64_t client = request.sink->client();
  const ServiceClass service = context_.class_for(*request.sink, request.header);
  const auto update = std::make_shared<Update>(Update{context_.engine, request.header, client, request.take_payload()});
  const auto done = [=, this](bool made) {
    if (made && update->begins_again(context_.engine)) return false;
    context_.end_pose_update(client);
    if (made) count(update->result);
    return true;
  };
  context_.reply_in_background(request, request.bytes, applying(update, context_.answers), done);
  context_.begin_pose_update(client, service);
}

void StateUpdates::set_points(Request& request) {
  const std::uint64_t client = request.sink->client(), rest = sizeof(wire::PointsHeader) + request.header.records_bytes;
  const std::uint64_t points = (request.bytes - std::min(request.bytes, rest)) / sizeof(CloudPoint);
  const auto update = std::make_shared<Update>(Update{context_.engine, request.header, client, request.take_payload()});
  const auto done = [=, this](bool made) {
    if (made && update->begins_again(context_.engine)) return false;
    if (made) points_of_body_[update->body] = std::move(update->points);
    update->points.release();
    if (!made) return true;
    ++context_.stats["points.updates"];
    context_.stats["points.applied"] += update->result.applied;
    context_.poses_changed = true;
    return true;
  };
  context_.check_quota(request, request.bytes);
  if (points > max_points_of_body_)
    throw RejectedRequest{wire::ErrorCode::kTooLarge,
                          "points: " + std::to_string(points) + " points of one body are more than the " +
                              std::to_string(max_points_of_body_) + " that are allowed (limit max-body-points)"};
  points_.check(client, points);
  update->points = points_.take(client, points);
  context_.submit(request, request.bytes, applying(update, context_.answers), done);
}

const PoseUpdateResult& StateUpdates::count(const PoseUpdateResult& done) {
  Stats& stats = context_.stats;
  ++stats["poses.batches"];
  stats["poses.applied"] += done.applied;
  stats["poses.bad"] += done.bad;
  stats["poses.unknown"] += done.unknown;
  stats["poses.fixed"] += done.fixed;
  context_.poses_changed = true;
  return done;
}

bool StateUpdates::is_behind(const Request& request) const {
  const std::uint64_t revision = request.header.scene_revision;
  return revision && revision != context_.engine->scene_revision();
}

void StateUpdates::reply_to_change(Request& request, const PoseUpdateResult& done, bool is_behind) {
  context_.reply(request, bytes_of(result_of(
                              done, is_behind ? request.header.scene_revision : context_.engine->scene_revision())));
}

void StateUpdates::attach(Request& request) {
  const FrameHeader& header = request.header;
  engine::Engine& engine = *context_.engine;
  const wire::PayloadParts parts = wire::split_payload(header, request.payload);
  const auto [record, allowed, passed_over, epoch] = wire::parse_attach(parts.body, parts.records);
  context_.answers.check_epoch(header, epoch);
  context_.stats.records_ignored += passed_over.size();
  check_scene(engine, header, std::array{record.child}, true);
  if (record.parent != kNone) check_scene(engine, header, std::array{record.parent});
  check_scene(engine, header, allowed);
  const Pose X_pc = pose_of(record.pose);
  const bool was_behind = is_behind(request);
  const auto done = engine.attach(record.child, record.parent, record.has_pose ? &X_pc : nullptr, allowed);
  ++context_.stats["attachments"];
  context_.poses_changed = true;
  reply_to_change(request, done, was_behind);
}

void StateUpdates::allow(Request& request) {
  const wire::AllowRecord record = wire::parse_allow(request.payload);
  check_scene(*context_.engine, request.header, std::array{record.a, record.b});
  const bool was_behind = is_behind(request);
  const auto done = context_.engine->allow(record.a, record.b, record.allow);
  ++context_.stats[record.allow ? "pairs.allowed" : "pairs.forbidden"];
  reply_to_change(request, done, was_behind);
}

}  // namespace clearance
