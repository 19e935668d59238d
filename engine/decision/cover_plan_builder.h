// Collects the parts of a CoverPlan. Included by its sources alone.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "engine/decision/cover_plan.h"
#include "engine/decision/slack_bounds.h"
#include "engine/pose/pose.h"

namespace clearance {

namespace cover_plan {

inline constexpr double kUnit = 0x1p-24;  ///< unit roundoff of float32
/// Rounding of world coordinates, relative to their lengths: the common frame has differences of them.
inline constexpr double kWorldUnit = 0x1p-46;
inline constexpr float kNever = -BallPacket::kNoRadius;

inline float up(double value) {
  const float rounded = static_cast<float>(value);
  return rounded < value ? std::nextafterf(rounded, std::numeric_limits<float>::infinity()) : rounded;
}
inline float down(double value) {
  return -up(-value);
}

}  // namespace cover_plan

class CoverPlanBuilder {
 public:
  /// As of CoverPlan::make().
  CoverPlanBuilder(const engine::Scene& scene, const Plan& plan, const CoverStore& store, const JointTableStore* tables,
                   std::span<const std::uint64_t> known)
      : scene_(scene),
        plan_(plan),
        snapshot_(*plan.snapshot),
        known_(known),
        store_(store),
        slack_(scene, plan),
        slot_(scene.bodies().size(), kNone),
        obstacle_of_(scene.bodies().size(), kUnseen) {
    out_->tables_ = TablePlan(scene, plan, slack_, tables);
  }

  std::unique_ptr<const CoverPlan> build();

 private:
  static constexpr std::uint32_t kUnseen = kNone - 1;
  /// A pair of a moved body and an obstacle, which is one part of a body.
  struct ObstaclePair {
    std::uint32_t obstacle, body;
    std::uint64_t position;
    double margin;
    Slack slack;
  };

  bool is_known(std::uint64_t position) const { return std::binary_search(known_.begin(), known_.end(), position); }
  bool take_slides();
  bool take_frame();
  bool has_pose(std::uint32_t body, const DecidedBody& decided) const;
  bool take_bodies();
  void take_link(std::uint32_t body, DecidedBody& decided);
  void take_still_meshes();
  void take_still_mesh(std::uint32_t body);
  void add(DecidedBody& decided);
  Pose in_frame(const Pose& X_w) const {
    return frame_body_ == kNone ? X_w : compose(frame_inverse_, frame_inverse_rotation_, X_w);
  }
  Mat3d in_frame(const Mat3d& R_w) const { return frame_body_ == kNone ? R_w : R_wf_.transpose_times(R_w); }
  void find_reach();
  bool take_sources();
  void take_errors();
  bool is_nowhere(std::uint32_t body) const;
  std::uint32_t obstacles_of(std::uint32_t body);
  void take(std::uint64_t position);
  void take_moved(std::uint64_t position, std::uint32_t a, std::uint32_t b);
  void sort_obstacles();
  void divide_obstacles(std::span<std::uint32_t> order, std::uint32_t first);
  void bound_nodes();
  void add_to_row(std::uint32_t pair);
  void leave_repeats(std::size_t columns);
  void finish();
  const Cover* cover(std::uint32_t slot) const { return out_->covers_[slot].get(); }

  const engine::Scene& scene_;
  const Plan& plan_;
  const PoseSnapshot& snapshot_;
  const std::span<const std::uint64_t> known_;
  const CoverStore& store_;
  const SlackBounds slack_;
  std::unique_ptr<CoverPlan> out_{new CoverPlan};
  std::uint32_t frame_body_ = kNone;        // carries the common frame, or kNone for the world's
  std::vector<std::uint32_t> slot_;         // by body: index in bodies_, or kNone
  std::vector<std::uint32_t> obstacle_of_;  // by body: first obstacle, kNone if it is none
  std::vector<std::uint32_t> parts_of_;     // by obstacle: count of the body's obstacles, at its first one
  std::vector<std::uint8_t> has_pose_;      // by moved body: in every state whose given poses are usable
  std::vector<double> world_;               // by moved body: lengths in the world that its place is a difference of
  std::vector<double> errors_;              // by moved body: centre_error()
  std::vector<SpanRates::Source> sources_;  // of motions
  std::vector<ObstaclePair> obstacle_pairs_;
  double reach_ = 0;      // of all moved bodies in the common frame
  Pose frame_inverse_{};  // the world in the common frame
  Mat3d frame_inverse_rotation_ = Mat3d::identity(), R_wf_ = Mat3d::identity();
};

}  // namespace clearance
