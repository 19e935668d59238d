// Uncertainty of a query's bodies, in the layout of kernels.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/device/device.h"
#include "engine/selection/plan.h"

namespace clearance::cuda {

/// The uncertain body with the least id in the query's pairs (docs/trust/bounds_bodies.md, "Slack"), or kNone.
std::uint32_t uncertain_body(const engine::Scene& scene, const Plan& plan);

/// The same for bodies whose uncertainty grows with time: their pose, or that of a parent, ages.
std::uint32_t ageing_body(const engine::Scene& scene, const Plan& plan);

/// Built from a plan and its uncertainty. Owns the arrays that kernels get.
class DeviceUncertainty {
 public:
  DeviceUncertainty(const engine::Scene& scene, const Plan& plan);
  /// Views of the arrays.
  UncertaintySetup setup() const;

 private:
  void take_links(const engine::Scene& scene);
  void take_moved(const engine::Scene& scene, const Plan& plan);

  std::vector<BodySlack> fixed_;
  std::vector<LinkPlace> links_;
  std::vector<LinkPairError> link_pairs_;
  std::vector<UncertaintyStep> moves_;
  std::vector<PlacedUncertainty> base_;
};

}  // namespace clearance::cuda
