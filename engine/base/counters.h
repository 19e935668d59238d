// Counters of a program's work.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace clearance {

/// Counters of a running engine.
using Counters = std::vector<std::pair<std::string, std::uint64_t>>;

}  // namespace clearance
