#include "engine/robot/lane_kinematics.h"

#include <algorithm>
#include <cassert>

#include "engine/base/instruction_sets.h"

namespace clearance {

#ifdef CLEARANCE_LANES_X86
extern const LaneFunctions kLaneFunctionsAvx512, kLaneFunctionsAvx2;
#endif
extern const LaneFunctions kLaneFunctionsBaseline;

std::span<const LaneFunctions> lane_kinematics() {
  static const auto& kernels = *new std::vector<LaneFunctions>([] {  // queries may outlast main()
    std::vector<LaneFunctions> k;
#ifdef CLEARANCE_LANES_X86
    if (has_avx512_lanes()) k.push_back(kLaneFunctionsAvx512);
    if (has_avx2_lanes()) k.push_back(kLaneFunctionsAvx2);
#endif
    k.push_back(kLaneFunctionsBaseline);
    return k;
  }());
  return kernels;
}

LaneKinematics::LaneKinematics(const Kinematics& robot)
    : robot_(robot), frames_(robot.links()), twists_(robot.links()) {
  for (const KinematicStep& step : robot.steps()) {
    from_.push_back(robot.carrier_of(step));
    axes_.push_back(axis_of_step(step));
  }
  for (const std::uint32_t root : robot.roots()) std::fill_n(frames_[root].part[0].lane, kMostLanes, 1.0);
}

void LaneKinematics::place(std::span<const DoubleInLanes> positions, const LaneFunctions& kernel) {
  assert(positions.size() == robot_.columns());
  kernel.place({robot_.steps().data(), from_.data(), from_.size(), positions.data(), frames_.data()});
}

void LaneKinematics::take_twists(std::span<const double> change, const LaneFunctions& kernel) {
  assert(change.size() == robot_.columns());
  kernel.twists(
      {robot_.steps().data(), from_.data(), axes_.data(), from_.size(), change.data(), frames_.data(), twists_.data()});
}

}  // namespace clearance
