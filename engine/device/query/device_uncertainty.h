// What is not known of a query's bodies, as kernels know it.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/device/device.h"
#include "engine/selection/plan.h"

namespace clearance::cuda {

/// A body of the query's pairs that is not known exactly (docs/bounds.md, "Slack"), the first by its id; kNone: there
/// is none.
std::uint32_t uncertain_body(const Scene& scene, const Plan& plan);

/// The same of one whose doubt grows as time goes by: its pose ages, or that of what it follows.
std::uint32_t ageing_body(const Scene& scene, const Plan& plan);

/// Made of a plan with its doubts; its arrays live as long as this.
class DeviceUncertainty {
 public:
  DeviceUncertainty(const Scene& scene, const Plan& plan);
  /// Points a setup to the arrays.
  void tell(QuerySetup& setup) const;

 private:
  void take_links(const Scene& scene);
  void take_moved(const Scene& scene, const Plan& plan);

  std::vector<BodySlack> fixed_;
  std::vector<LinkPlace> links_;
  std::vector<LinkPairError> link_pairs_;
  std::vector<UncertaintyStep> moves_;
  std::vector<PlacedUncertainty> base_;
};

}  // namespace clearance::cuda
