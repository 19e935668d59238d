// The bodies that a query moves, each with the chain of bodies it follows, in the layout of kernels.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/device/query/moved_links.h"
#include "engine/selection/plan.h"

namespace clearance::cuda {

/// Owns the arrays that kernels get.
class MovedChains {
 public:
  MovedChains(const engine::Scene& scene, const Plan& plan);
  /// Views of the arrays.
  MovedSetup setup() const;

 private:
  std::uint8_t state_of(const engine::Scene& scene, const Plan& plan, std::uint32_t slot) const;

  const std::vector<std::uint32_t>& moved_;
  MovedLinks links_;
  std::uint32_t given_count_;
  std::vector<std::uint8_t> has_base_, slot_state_;
  std::vector<std::uint32_t> source_, chain_begin_, chain_;
  std::vector<Pose> own_;
  std::vector<BodyPlacement> base_;
};

}  // namespace clearance::cuda
