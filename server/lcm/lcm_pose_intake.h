// Poses and joint positions from LCM: permission, order and publishers.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "clearance_lcm/joint_update_t.hpp"
#include "clearance_lcm/moving_joint_update_t.hpp"
#include "clearance_lcm/moving_pose_update_t.hpp"
#include "clearance_lcm/points_t.hpp"
#include "clearance_lcm/pose_update_t.hpp"
#include "server/lcm/lcm_metrics.h"
#include "server/lcm/lcm_publishers.h"
#include "server/requests/transport.h"

namespace clearance {

class LcmPoseIntake {
 public:
  /// The arguments must outlive this.
  LcmPoseIntake(RequestHandler& handler, LcmMetrics& metrics, LcmClients& clients, const LcmPoses& allowed)
      : handler_(handler), metrics_(metrics), clients_(clients), allowed_poses_(allowed) {}

  /// Adapts to a new scene, which may have other bodies.
  void set_scene(const engine::Scene& scene);
  /// Applies poses. Returns whether they were accepted.
  bool take(const clearance_lcm::pose_update_t& update);
  bool take(const clearance_lcm::joint_update_t& update);
  bool take(const clearance_lcm::moving_pose_update_t& update);
  bool take(const clearance_lcm::moving_joint_update_t& update);
  /// Body of a message with points. If they are rejected, counts and logs that, and returns nothing.
  std::optional<std::uint32_t> body_of(const clearance_lcm::points_t& points);
  /// Whether a cloud is newer than its publisher's last one.
  bool is_in_order(const clearance_lcm::points_t& points) { return is_in_order(message_of(points)); }
  std::size_t publishers() const { return publishers_.size(); }

 private:
  /// A message with its publisher's numbering.
  struct Message {
    const char* channel;
    int channel_number;
    std::int64_t publisher, sequence, stamp_ns;
    std::string who() const { return "publisher " + std::to_string(publisher) + " on " + channel; }
  };
  static Message message_of(const clearance_lcm::points_t& points) {
    return {"CLEARANCE_POINTS", 2, points.publisher_id, points.sequence, points.stamp_ns};
  }
  void reject_name(const std::string& name, const char* what);
  void reject_right(const std::string& name, const char* what);
  template <class Update>
  void take_poses(const Update& update);
  template <class Update>
  void take_positions(const Update& update);
  void add_pose(std::uint32_t body, const std::vector<double>& pose, const BodyTwist& velocity);
  void add_position(std::uint32_t joint, double position, double velocity);
  template <class Apply>
  bool apply(const Message& message, std::span<const std::uint32_t> ids, std::optional<OwnerLog>& owners, Apply apply);
  bool apply_poses(const Message& message);
  bool apply_positions(const Message& message);
  bool is_in_order(const Message& message);
  template <class Use>
  bool with_good_stamp(const Message& message, Use use);

  RequestHandler& handler_;
  LcmMetrics& metrics_;
  LcmClients& clients_;
  LcmPoses allowed_poses_;
  std::vector<bool> allowed_, allowed_joints_;  // by id
  PublisherLog publishers_;
  std::optional<OwnerLog> owners_, joint_owners_;
  // Of the message.
  std::vector<std::uint32_t> ids_;
  std::vector<BodyPose> poses_;
  std::vector<JointPosition> positions_;
};

}  // namespace clearance
