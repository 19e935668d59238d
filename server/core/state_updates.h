// Requests that change the bodies' state: poses, joints, points, attachments and pairs that may touch.
#pragma once

#include <cstdint>
#include <string>
#include <unordered_map>

#include "server/core/request_context.h"
#include "server/limits/resource_quota.h"

namespace clearance {

/// Points of point clouds that clients set, at about 60 bytes each with their part of the tree.
struct PointLimits {
  std::uint64_t max_points_of_body = 2'000'000;    ///< of one update, kTooLarge beyond it
  std::uint64_t max_points_of_client = 8'000'000;  ///< set or under way, kTooLarge beyond it
  std::uint64_t max_points = 16'000'000;           ///< of all clients, kBusy beyond it
};

/// Used on the loop's thread.
class StateUpdates {
 public:
  StateUpdates(RequestContext& context, const PointLimits& limits);

  void set_poses(Request& request);   ///< or joint positions
  void set_points(Request& request);  ///< on a worker of its own, as the tree over the points takes long
  void attach(Request& request);
  void allow(Request& request);
  /// Counts an update of poses or joints, and returns its argument.
  const PoseUpdateResult& count(const PoseUpdateResult& done);

 private:
  void set_poses_on_worker(Request& request);
  /// Replies with the scene revision that the client's ids are valid in: the new one unless the client was behind.
  void reply_to_change(Request& request, const PoseUpdateResult& done, bool is_behind);
  bool is_behind(const Request& request) const;

  RequestContext& context_;
  const std::uint64_t max_points_of_body_;
  ResourceQuota points_;
  std::unordered_map<std::string, ResourceQuota::Share> points_of_body_;  // by name
};

}  // namespace clearance
