// Velocities that come with an update of poses or joints.
#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>

namespace clearance {

/// Throws std::invalid_argument unless there are no velocities, or one for each entry of the update.
inline void expect_velocities(std::size_t velocities, std::size_t entries) {
  if (velocities != 0 && velocities != entries)
    throw std::invalid_argument("velocities: expected one for each of " + std::to_string(entries) + " entries, got " +
                                std::to_string(velocities));
}

}  // namespace clearance
