// Whose queries go first.
#pragma once

#include <cstdint>

namespace clearance {

/// What is asked in the class kControl is answered before what is asked in kPlanning, and has places and memory that
/// the others cannot take.
enum class ServiceClass : std::uint8_t { kControl, kPlanning };
inline constexpr int kServiceClasses = 2;

/// How much of what all share (places, bytes) is kept for the class control, where anybody may have it.
constexpr std::uint64_t kept_for_control(std::uint64_t all) {
  return all / 8;
}

}  // namespace clearance
