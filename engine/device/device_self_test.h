// Self-test of devices: runs pairs with known answers through their kernels.
#pragma once

#include <vector>

#include "engine/narrow/self_test.h"

namespace clearance::cuda {

/// Runs all known pairs in one query, in float64 and in float32. The CPU finishes unresolved pairs, as always. The
/// result is without answers if the devices cannot run them; opening them later reports the reason.
/// \param devices numbers; if empty, the current device
SelfTest self_test_devices(const std::vector<int>& devices);

/// The same, once per process for each list of devices, before they are used. Passes if devices are fake.
const SelfTest& device_self_test(const std::vector<int>& devices);

}  // namespace clearance::cuda
