#include "engine/device/query/device_movers.h"

#include <algorithm>

namespace clearance::cuda {

DeviceMovers::DeviceMovers(const JointGradient& gradient, const Plan& plan)
    : movers_(gradient.movers()), of_body_(gradient.mover_of()) {
  std::vector<std::uint32_t> ref_of(of_body_.size());
  for (std::uint32_t body = 0; body < ref_of.size(); ++body) ref_of[body] = body;
  for (std::uint32_t slot = 0; slot < plan.moved.size(); ++slot) ref_of[plan.moved[slot]] = slot | kMovedBit;
  for (JointMover& mover : movers_) {
    mover.link = ref_of[mover.link];
    mover.carrier = ref_of[mover.carrier];
  }
}

MoversSetup DeviceMovers::setup() const {
  return {movers_, of_body_};
}

}  // namespace clearance::cuda
