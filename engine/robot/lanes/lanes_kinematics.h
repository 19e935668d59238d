// place_batch() in SIMD lanes, compiled once for each instruction set (lanes_kinematics_avx512.cpp and similar).
#pragma once

#include "engine/base/pack.h"
#include "engine/robot/kinematics_step.h"

namespace clearance {
namespace CLEARANCE_ISA {

struct PackIo {
  static constexpr std::size_t kLanes = Pack<double>::kLanes;
  HWY_INLINE static Pack<double> load(const double* at) { return Pack<double>::load(at); }
  HWY_INLINE static void store(Pack<double> x, double* at) { x.store(at); }
};
static_assert(kMostLanes % PackIo::kLanes == 0);

}  // namespace CLEARANCE_ISA
}  // namespace clearance
