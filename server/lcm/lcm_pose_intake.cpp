#include "server/lcm/lcm_pose_intake.h"

#include <algorithm>

#include "server/base/log.h"
#include "server/base/log_text.h"

namespace clearance {

void LcmPoseIntake::set_scene(const engine::Scene& scene) {
  owners_.emplace(scene.bodies().size());
  allowed_.assign(scene.bodies().size(), allowed_poses_.any);
  joint_owners_.emplace(scene.joints().size());
  allowed_joints_.assign(scene.joints().size(), allowed_poses_.any);
  for (const std::string& name : allowed_poses_.allowed) {
    for (const JointGroup& joints : scene.joint_groups())
      if (joints.name == name)
        for (const std::uint32_t joint : joints.joints) allowed_joints_[joint] = true;
    const std::uint32_t body = scene.find_body(name), group = scene.find_group(name);
    if (body != kNone) allowed_[body] = true;
    if (group != kNone)
      for (const std::uint32_t member : scene.groups()[group].bodies) allowed_[member] = true;
    if (body == kNone && group == kNone) log::warn("event=lcm_allow_unknown name=\"{}\"", log_text(name));
  }
}

namespace {

BodyTwist velocity_in(const clearance_lcm::pose_update_t&, std::size_t) {
  return kUnknownTwist;
}
BodyTwist velocity_in(const clearance_lcm::moving_pose_update_t& update, std::size_t i) {
  BodyTwist velocity;
  std::copy_n(update.velocities[i].begin(), velocity.size(), velocity.begin());
  return velocity;
}
double velocity_in(const clearance_lcm::joint_update_t&, std::size_t) {
  return kUnknownSpeed;
}
double velocity_in(const clearance_lcm::moving_joint_update_t& update, std::size_t i) {
  return update.velocities[i];
}

}  // namespace

template <class Update>
void LcmPoseIntake::take_poses(const Update& update) {
  const engine::Scene& scene = handler_.engine().scene();
  poses_.clear();
  for (std::int32_t i = 0; i < update.count; ++i) {
    const std::uint32_t body = scene.find_body(update.names[i]);
    if (body == kNone)
      reject_name(update.names[i], "a pose for '%', which is not a body of this scene");
    else
      add_pose(body, update.poses[i], velocity_in(update, static_cast<std::size_t>(i)));
  }
}

bool LcmPoseIntake::take(const clearance_lcm::pose_update_t& update) {
  take_poses(update);
  return apply_poses({"CLEARANCE_POSES", 0, update.publisher_id, update.sequence, update.stamp_ns});
}
bool LcmPoseIntake::take(const clearance_lcm::moving_pose_update_t& update) {
  take_poses(update);
  return apply_poses({"CLEARANCE_MOVING_POSES", 3, update.publisher_id, update.sequence, update.stamp_ns});
}

template <class Update>
void LcmPoseIntake::take_positions(const Update& update) {
  const engine::Scene& scene = handler_.engine().scene();
  positions_.clear();
  for (std::int32_t i = 0; i < update.count; ++i) {
    const std::uint32_t joint = scene.find_joint(update.names[i]);
    if (joint == kNone)
      reject_name(update.names[i], "a position of '%', which is not a joint of this scene");
    else
      add_position(joint, update.positions[i], velocity_in(update, static_cast<std::size_t>(i)));
  }
}

bool LcmPoseIntake::take(const clearance_lcm::joint_update_t& update) {
  take_positions(update);
  return apply_positions({"CLEARANCE_JOINTS", 1, update.publisher_id, update.sequence, update.stamp_ns});
}
bool LcmPoseIntake::take(const clearance_lcm::moving_joint_update_t& update) {
  take_positions(update);
  return apply_positions({"CLEARANCE_MOVING_JOINTS", 4, update.publisher_id, update.sequence, update.stamp_ns});
}

std::optional<std::uint32_t> LcmPoseIntake::body_of(const clearance_lcm::points_t& points) {
  const std::uint32_t body = handler_.engine().scene().find_body(points.body);
  if (points.publisher_id == 0) {
    metrics_.accept("CLEARANCE_POINTS: publisher_id is 0; draw one at random");
  } else if (body == kNone) {
    reject_name(points.body, "points of '%', which is not a body of this scene");
  } else if (!allowed_[body]) {
    reject_right(points.body, "points of '%', which are not accepted from LCM (--lcm-poses)");
  } else if (with_good_stamp(message_of(points), [&] { handler_.engine().check_stamp(points.stamp_ns); })) {
    return body;
  }
  return std::nullopt;
}

/// @param what with '%' for the name
void LcmPoseIntake::reject_name(const std::string& name, const char* what) {
  ++metrics_.unknown;
  metrics_.log_rate_limited("name", std::string(what).replace(std::string_view(what).find('%'), 1, name));
}

void LcmPoseIntake::reject_right(const std::string& name, const char* what) {
  ++metrics_.not_allowed;
  metrics_.log_rate_limited("not_allowed", std::string(what).replace(std::string_view(what).find('%'), 1, name));
}

void LcmPoseIntake::add_pose(std::uint32_t body, const std::vector<double>& pose, const BodyTwist& velocity) {
  if (body < allowed_.size() && !allowed_[body])
    return reject_right(handler_.engine().scene().bodies()[body].name,
                        "a pose for '%', whose poses are not accepted from LCM (--lcm-poses)");
  poses_.push_back({body, {{pose[0], pose[1], pose[2]}, pose[3], pose[4], pose[5], pose[6]}, velocity});
}

void LcmPoseIntake::add_position(std::uint32_t joint, double position, double velocity) {
  if (joint < allowed_joints_.size() && !allowed_joints_[joint])
    return reject_right(handler_.engine().scene().joints()[joint].name,
                        "a position of '%', which is not accepted from LCM (--lcm-poses)");
  positions_.push_back({joint, position, velocity});
}

template <class Use>
bool LcmPoseIntake::with_good_stamp(const Message& message, Use use) {
  try {
    use();
    return true;
  } catch (const engine::QueryError& error) {
    ++metrics_.bad_stamps;
    metrics_.log_rate_limited("stamp", message.who() + ": left out: " + error.what());
    return false;
  }
}

/// @param ids of the bodies or joints that the message moves
/// @param apply applies the message
template <class Apply>
bool LcmPoseIntake::apply(const Message& message, std::span<const std::uint32_t> ids, std::optional<OwnerLog>& owners,
                          Apply apply) {
  if (message.publisher == 0)
    return metrics_.accept(std::string(message.channel) + ": publisher_id is 0; draw one at random");
  // First, as a wrong stamp must not affect the publisher's record.
  if (!with_good_stamp(message, [&] { handler_.engine().check_stamp(message.stamp_ns); })) return false;
  if (!is_in_order(message)) return false;
  if (const auto contested = owners->note(message.publisher, ids, OwnerLog::Clock::now()); !contested.empty()) {
    metrics_.contested += contested.size();
    const engine::Scene& scene = handler_.engine().scene();
    const bool is_joint = &owners == &joint_owners_;
    const std::uint32_t first = contested.front();
    metrics_.log_rate_limited("contested", std::string("two publishers move ") + (is_joint ? "joint '" : "body '") +
                                               (is_joint ? scene.joints()[first].name : scene.bodies()[first].name) +
                                               "' in turns; one is " + std::to_string(message.publisher));
  }
  if (ids.empty() && !allowed_poses_.any) return false;  // nothing is allowed
  ++metrics_.poses;
  with_good_stamp(message, [&] { metrics_.unknown += apply(clients_.number_of(message.publisher)).unknown; });
  return true;
}

bool LcmPoseIntake::apply_poses(const Message& message) {
  ids_.clear();
  for (const BodyPose& pose : poses_) ids_.push_back(pose.body);
  return apply(message, ids_, owners_, [&](std::uint64_t client) {
    return handler_.on_poses(poses_, message.stamp_ns, message.sequence, client);
  });
}

bool LcmPoseIntake::apply_positions(const Message& message) {
  ids_.clear();
  for (const JointPosition& position : positions_) ids_.push_back(position.joint);
  return apply(message, ids_, joint_owners_, [&](std::uint64_t client) {
    return handler_.on_joints(positions_, message.stamp_ns, message.sequence, client);
  });
}

/// Whether a message is newer than its publisher's last one.
bool LcmPoseIntake::is_in_order(const Message& message) {
  const auto& [channel, channel_number, publisher, sequence, stamp_ns] = message;
  const PublisherLog::Note note =
      publishers_.note(channel_number, publisher, sequence, stamp_ns, PublisherLog::Clock::now());
  const auto log_rate_limited = [&](const char* kind, const std::string& what) {
    metrics_.log_rate_limited(kind, message.who() + what);
  };
  switch (note.sequencing) {
    case PublisherLog::Sequencing::kNew:
      log::info("event=lcm_publisher channel={} id={}", channel, publisher);
      break;
    case PublisherLog::Sequencing::kNext:
      break;
    case PublisherLog::Sequencing::kGap:
      metrics_.gaps += note.missing;
      log_rate_limited("gap",
                       ": " + std::to_string(note.missing) + " messages missing before " + std::to_string(sequence));
      break;
    case PublisherLog::Sequencing::kRestart:
      ++metrics_.restarts;
      log_rate_limited("restart", " restarted its count, from " + std::to_string(sequence));
      break;
    case PublisherLog::Sequencing::kRepeated:
      ++metrics_.repeated;
      log_rate_limited("repeated", ": sequence " + std::to_string(sequence) + " came again, left out");
      break;
    case PublisherLog::Sequencing::kOld:
      ++metrics_.reordered;
      log_rate_limited("old", ": sequence " + std::to_string(sequence) + " is older than the last, left out");
      break;
  }
  return note.use();
}

}  // namespace clearance
