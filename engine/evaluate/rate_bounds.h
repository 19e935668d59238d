// Certified interval of how fast the distance of two parts changes: docs/trust/bounds_robots.md, "Rates".
#pragma once

#include <vector>

#include "engine/evaluate/feature_pair.h"
#include "engine/hull/convex_part.h"
#include "engine/narrow/certify.h"
#include "engine/narrow/narrow_phase.h"
#include "engine/narrow/work_meter.h"
#include "engine/pose/placed.h"
#include "engine/selection/body_poses.h"

namespace clearance {

/// Velocities of two bodies at one moment. World axes.
struct PairMotion {
  Vec3d turn_a{0, 0, 0}, turn_b{0, 0, 0};    ///< rad/s
  Vec3d shift_a{0, 0, 0}, shift_b{0, 0, 0};  ///< m/s, of the bodies' origins
};

/// Interval with -bound as its lower end.
inline Interval within(double bound) {
  return {-bound, bound};
}

/// Bounds for two convex parts with nearest points of their bodies.
class PartRate {
 public:
  /// The arguments must outlive this.
  /// \param normal unit, from a towards b
  /// \param features that meet, a proposal; null without one
  /// \param upper bound on the distance of the bodies, metres
  /// \param inner slack of the pair
  PartRate(const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b, const PoseMatrix& pose_b,
           const Vec3d& normal, std::optional<FeaturePair> features, double upper, double inner);
  /// Lower bound on the distance of these parts' cores; if it exceeds `upper`, no nearest points are theirs.
  double gap() const { return gap_; }
  /// Contains n . (v_b - v_a) for all nearest points of the bodies that belong to these parts, n being their unit
  /// difference and v their velocities.
  Interval of(const PairMotion& motion) const;
  double upper() const { return upper_; }

 private:
  struct Lean;
  double gap_at(double time, const PairMotion& motion, const Lean& lean) const;
  Interval by(const Lean& lean, const PairMotion& motion, double most) const;
  double fastest(const PairMotion& motion) const;

  const ConvexPart &a_, &b_;
  const PoseMatrix &pose_a_, &pose_b_;
  Vec3d normal_, away_;  // of a's origin to b's
  std::optional<FeaturePair> features_;
  double upper_, inner_, size_a_, size_b_;
  double gap_ = 0, normal_error_ = 2;
};

/// Bounds for two bodies.
class RateBounds {
 public:
  /// The arguments must outlive this.
  /// \param answer of the pair, with its witness points
  /// \param features of the answer's parts
  /// \param slack of the pair
  RateBounds(const Body& a, const PoseMatrix& pose_a, const Body& b, const PoseMatrix& pose_b, const PairAnswer& answer,
             const std::optional<FeaturePair>& features, const Slack& slack, WorkMeter& meter);
  /// Contains all one-sided derivatives of the distance by time.
  Interval of(const PairMotion& motion, WorkMeter& meter) const;

 private:
  void take_parts(const PairAnswer& answer, const std::optional<FeaturePair>& features, const Slack& slack,
                  WorkMeter& meter);

  const Body &a_, &b_;
  const PoseMatrix &pose_a_, &pose_b_;
  double inner_;
  // If more may be nearest, or finding them takes more work, only the speeds bound the rate.
  static constexpr std::size_t kMostParts = 256;
  static constexpr std::uint64_t kMostUnits = 1u << 18;

  std::vector<PartRate> parts_;  // if there are none, only the speeds of the bodies bound the rate
};

}  // namespace clearance
