// Poses from LCM: which are taken, in what order, and who sent them.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "clearance_lcm/named_pose_update_t.hpp"
#include "clearance_lcm/pose_update_t.hpp"
#include "lcm_figures.h"
#include "lcm_publishers.h"
#include "transport.h"

namespace clearance {

class LcmPoseIntake {
 public:
  /// What is passed must outlive this.
  LcmPoseIntake(Inbox& inbox, LcmFigures& figures, LcmClients& clients, const LcmPoses& allowed)
      : inbox_(inbox), figures_(figures), clients_(clients), allowed_poses_(allowed) {}

  /// Takes note of the scene that is served now, which may have other bodies.
  void meet(const Scene& scene);
  /// Hands poses in. Returns whether it did.
  bool take(const clearance_lcm::pose_update_t& update);
  bool take(const clearance_lcm::named_pose_update_t& update);
  std::size_t publishers() const { return publishers_.size(); }

 private:
  /// A message as its publisher numbered it.
  struct Message {
    const char* channel;
    int channel_number;
    std::int64_t publisher, sequence, stamp_ns;
    std::string who() const { return "publisher " + std::to_string(publisher) + " on " + channel; }
  };
  void add_pose(std::uint32_t body, const std::vector<double>& pose);
  bool apply(const Message& message);
  bool is_in_order(const Message& message);
  void note_quarrels(const Message& message);
  template <class Use>
  bool with_good_stamp(const Message& message, Use use);

  Inbox& inbox_;
  LcmFigures& figures_;
  LcmClients& clients_;
  LcmPoses allowed_poses_;
  std::vector<bool> allowed_;  // by body
  PublisherLog publishers_;
  std::optional<OwnerLog> owners_;
  std::vector<BodyPose> poses_;  // of the message
};

}  // namespace clearance
