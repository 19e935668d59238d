// Classes of clients, by priority.
#pragma once

#include <cstdint>

namespace clearance {

/// Requests of the class kControl are answered before those of kPlanning, and have connections and memory of their own.
enum class ServiceClass : std::uint8_t { kControl, kPlanning };
inline constexpr int kServiceClasses = 2;

/// Part of a shared resource (connections, bytes) kept for the class control, if clients may have it.
constexpr std::uint64_t kept_for_control(std::uint64_t all) {
  return all / 8;
}

}  // namespace clearance
