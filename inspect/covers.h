// Covers of a scene's bodies, with their widths and cost.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "engine/cover/cover.h"
#include "engine/scene/scene.h"

namespace clearance {

struct CoverReport {
  std::uint32_t body = kNone;  ///< one of those that share the cover
  std::uint64_t balls = 0;     ///< of all levels
  std::uint64_t bytes = 0;
  double seconds = 0;  ///< that making it took
  std::array<StandOut, Cover::kLevels> levels{};
};

/// Makes the covers that an engine of the scene would have, on all cores, or reads them from the cache. Made ones are
/// stored there.
std::vector<CoverReport> covers_of(const engine::Scene& scene);

}  // namespace clearance
