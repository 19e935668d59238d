// Numbers that show what a program does.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace clearance {

/// Numbers that a running engine keeps about itself.
using Counters = std::vector<std::pair<std::string, std::uint64_t>>;

}  // namespace clearance
