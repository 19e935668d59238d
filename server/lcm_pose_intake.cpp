#include "lcm_pose_intake.h"

#include "log.h"
#include "log_text.h"

namespace clearance {

void LcmPoseIntake::meet(const Scene& scene) {
  owners_.emplace(scene.bodies().size());
  allowed_.assign(scene.bodies().size(), allowed_poses_.any);
  for (const std::string& name : allowed_poses_.allowed) {
    const std::uint32_t body = scene.find_body(name), group = scene.find_group(name);
    if (body != kNone) allowed_[body] = true;
    if (group != kNone)
      for (const std::uint32_t member : scene.groups()[group].bodies) allowed_[member] = true;
    if (body == kNone && group == kNone) log::warn("event=lcm_allow_unknown name=\"{}\"", log_text(name));
  }
}

bool LcmPoseIntake::take(const clearance_lcm::pose_update_t& update) {
  const Engine& engine = inbox_.engine();
  static_assert(sizeof update.bodies[0] == sizeof(std::uint32_t));
  const std::span ids(reinterpret_cast<const std::uint32_t*>(update.bodies.data()), update.bodies.size());
  if (update.scene_revision != 0 && !engine.still_means(static_cast<std::uint64_t>(update.scene_revision), ids, true)) {
    ++figures_.wrong_scene;
    figures_.complain("scene", "poses for scene " + std::to_string(update.scene_revision) + " refused, this is " +
                                   std::to_string(static_cast<std::int64_t>(engine.scene_revision())));
    return false;
  }
  poses_.clear();
  for (std::int32_t i = 0; i < update.count; ++i)
    add_pose(static_cast<std::uint32_t>(update.bodies[i]), update.poses[i]);
  return apply({"CLEARANCE_POSES", 0, update.publisher_id, update.sequence, update.stamp_ns});
}

bool LcmPoseIntake::take(const clearance_lcm::named_pose_update_t& update) {
  const Scene& scene = inbox_.engine().scene();
  poses_.clear();
  for (std::int32_t i = 0; i < update.count; ++i) {
    const std::uint32_t body = scene.find_body(update.names[i]);
    if (body == kNone) {
      ++figures_.unknown;
      figures_.complain("name", "a pose for '" + update.names[i] + "', which is no body of this scene");
      continue;
    }
    add_pose(body, update.poses[i]);
  }
  return apply({"CLEARANCE_POSES_NAMED", 1, update.publisher_id, update.sequence, update.stamp_ns});
}

void LcmPoseIntake::add_pose(std::uint32_t body, const std::vector<double>& pose) {
  if (body < allowed_.size() && !allowed_[body]) {
    ++figures_.not_allowed;
    figures_.complain("not_allowed", "a pose for '" + inbox_.engine().scene().bodies()[body].name +
                                         "', whose poses are not taken from LCM (--lcm-poses)");
    return;
  }
  poses_.push_back({body, {{pose[0], pose[1], pose[2]}, pose[3], pose[4], pose[5], pose[6]}});
}

template <class Use>
bool LcmPoseIntake::with_good_stamp(const Message& message, Use use) {
  try {
    use();
    return true;
  } catch (const QueryError& error) {
    ++figures_.bad_stamps;
    figures_.complain("stamp", message.who() + ": left out: " + error.what());
    return false;
  }
}

bool LcmPoseIntake::apply(const Message& message) {
  if (message.publisher == 0)
    return figures_.accept(std::string(message.channel) + ": publisher_id is 0; draw one at random");
  // First: a publisher is not known by what is no time.
  if (!with_good_stamp(message, [&] { inbox_.engine().check_stamp(message.stamp_ns); })) return false;
  if (!is_in_order(message)) return false;
  note_quarrels(message);
  if (poses_.empty() && !allowed_poses_.any) return false;  // nothing that would be taken
  ++figures_.poses;
  with_good_stamp(message, [&] {
    const std::uint64_t client = clients_.number_of(message.publisher);
    figures_.unknown += inbox_.on_poses(poses_, message.stamp_ns, message.sequence, client).unknown;
  });
  return true;
}

/// Whether a message is newer than its publisher's last one.
bool LcmPoseIntake::is_in_order(const Message& message) {
  const auto& [channel, channel_number, publisher, sequence, stamp_ns] = message;
  const PublisherLog::Note note =
      publishers_.note(channel_number, publisher, sequence, stamp_ns, PublisherLog::Clock::now());
  const auto complain = [&](const char* kind, const std::string& what) {
    figures_.complain(kind, message.who() + what);
  };
  switch (note.verdict) {
    case PublisherLog::Verdict::kNew:
      log::info("event=lcm_publisher channel={} id={}", channel, publisher);
      break;
    case PublisherLog::Verdict::kNext:
      break;
    case PublisherLog::Verdict::kGap:
      figures_.gaps += note.missing;
      complain("gap", ": " + std::to_string(note.missing) + " messages missing before " + std::to_string(sequence));
      break;
    case PublisherLog::Verdict::kRestart:
      ++figures_.restarts;
      complain("restart", " counts anew, from " + std::to_string(sequence));
      break;
    case PublisherLog::Verdict::kRepeated:
      ++figures_.repeated;
      complain("repeated", ": sequence " + std::to_string(sequence) + " came again, left out");
      break;
    case PublisherLog::Verdict::kOld:
      ++figures_.reordered;
      complain("old", ": sequence " + std::to_string(sequence) + " is older than the last, left out");
      break;
  }
  return note.use();
}

void LcmPoseIntake::note_quarrels(const Message& message) {
  const auto contested = owners_->note(message.publisher, poses_, OwnerLog::Clock::now());
  if (contested.empty()) return;
  figures_.contested += contested.size();
  figures_.complain("contested", "two publishers move body '" +
                                     inbox_.engine().scene().bodies()[contested.front()].name + "' in turns; one is " +
                                     std::to_string(message.publisher));
}

}  // namespace clearance
