// Second derivatives of distances, and their derivatives by time at a query's velocities.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "engine/evaluate/joint_gradient.h"
#include "engine/narrow/certify.h"
#include "engine/narrow/work_meter.h"
#include "engine/selection/columns.h"

namespace clearance {

class FeaturePair;  // engine/evaluate/feature_pair.h
class RateBounds;   // engine/evaluate/rate_bounds.h

/// Computes the rows of kSecondOrderFields from the features that meet: docs/trust/bounds_robots.md, second order. One
/// per job, shared by its workers.
class SecondOrder {
 public:
  /// \param scene, plan outlive this.
  SecondOrder(const engine::Scene& scene, const Plan& plan);

  /// \param meter counts the row's work, which is not divided
  SecondOrderRow row(const BodyPoses& placement, BodyPair pair, std::uint32_t configuration, const PairAnswer& answer,
                     WorkMeter& meter) const;

 private:
  struct Chains;
  void find_ways(BodyPair pair, Chains& chains) const;
  void find_movers(const BodyPoses& placement, std::uint32_t configuration, const Vec3d& point_a, const Vec3d& point_b,
                   Chains& chains) const;
  const double* twist_of(std::uint32_t body, std::uint32_t configuration) const;
  void combine(const FeaturePair& features, const Chains& chains, SecondOrderRow& row, WorkMeter& meter) const;

  Interval bound_rate(const BodyPoses& placement, BodyPair pair, const PairAnswer& answer,
                      const std::optional<FeaturePair>& features, const Chains& chains, WorkMeter& meter) const;
  double speed_errors(const RateBounds& bounds, const BodyPoses& placement, BodyPair pair, const PairAnswer& answer,
                      const Chains& chains, const Slack& slack, double tilt, WorkMeter& meter) const;

  const engine::Scene& scene_;
  const Plan& plan_;
  bool is_current_;  // the query's poses and velocities are those of the snapshot
  JointGradient joints_;
  std::vector<std::uint32_t> given_of_;  // by body: index in the query's bodies, or kNone
  std::vector<std::uint32_t> carrier_;   // by body: JointGradient::carrier_of()
};

}  // namespace clearance
