// The self-test of devices: known pairs asked of their kernels.
#pragma once

#include <vector>

#include "engine/narrow/self_test.h"

namespace clearance::cuda {

/// Asks devices all known pairs in one query, in float64 and in float32. What they leave to the CPU it answers, as
/// always. Without answers where they cannot be asked: whoever opens them next is told why. \param devices numbers;
/// none: the current
SelfTest self_test_devices(const std::vector<int>& devices);

/// The same once in a process for each list of devices, before they are used. Passed where something stands in for
/// them.
const SelfTest& device_self_test(const std::vector<int>& devices);

}  // namespace clearance::cuda
