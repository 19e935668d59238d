// What backend auto's router goes by: how long queries take on this machine's CPU and device, and where that is kept.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "engine/cache/cache.h"
#include "engine/device/router.h"
#include "engine/engine.h"

namespace clearance::cuda {

/// Times queries of made-up scenes on both backends: a few hundred ms. \param like threads and instruction set of the
/// CPU.
Calibration calibrate(const Engine::Options& like, Bodies bodies);

/// What was measured on this machine before, if the cache has kept it under this key.
std::optional<Calibration> load_calibration(const Cache& cache, const std::string& key);
/// Leaves it for the next time; where that is not possible, nothing happens.
void save_calibration(const Cache& cache, const std::string& key, const Calibration& calibration);
/// What a calibration depends on: device, version, threads, instruction set, bodies.
std::string calibration_key(const std::string& device_name, int threads, std::string_view instruction_set,
                            Bodies bodies);

}  // namespace clearance::cuda
