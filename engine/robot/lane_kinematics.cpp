#include "engine/robot/lane_kinematics.h"

#include <algorithm>
#include <cassert>

#include "engine/base/instruction_sets.h"

namespace clearance {

#ifdef CLEARANCE_LANES_X86
extern const PlaceLanes kPlaceLanesAvx512, kPlaceLanesAvx2;
#endif
extern const PlaceLanes kPlaceLanesBaseline;

std::span<const PlaceLanes> lane_kinematics() {
  static const auto& kernels = *new std::vector<PlaceLanes>([] {  // queries may outlast main()
    std::vector<PlaceLanes> k;
#ifdef CLEARANCE_LANES_X86
    if (has_avx512_lanes()) k.push_back(kPlaceLanesAvx512);
    if (has_avx2_lanes()) k.push_back(kPlaceLanesAvx2);
#endif
    k.push_back(kPlaceLanesBaseline);
    return k;
  }());
  return kernels;
}

LaneKinematics::LaneKinematics(const Kinematics& robot) : robot_(robot), frames_(robot.links()) {
  for (const KinematicStep& step : robot.steps()) from_.push_back(robot.carrier_of(step));
  for (const std::uint32_t root : robot.roots()) std::fill_n(frames_[root].part[0].lane, kMostLanes, 1.0);
}

void LaneKinematics::place(std::span<const DoubleInLanes> positions, PlaceLanes kernel) {
  assert(positions.size() == robot_.columns());
  kernel({robot_.steps().data(), from_.data(), from_.size(), positions.data(), frames_.data()});
}

}  // namespace clearance
