// Simulated approaches of arms and of persons, which brake at the last moment that check_stop() proves.
#pragma once

#include <cstdint>
#include <string>

namespace clearance::stops {

/// Findings. wrong() must be 0.
struct Findings {
  std::int64_t approaches = 0;  ///< that braked, each from the last of its moments that was proved
  std::int64_t contacts = 0;    ///< wrong: a person touched a robot that still moved
  std::int64_t close = 0;       ///< of approaches: a person came within 10 mm before standstill
  std::int64_t harder = 0;      ///< of approaches: the robot braked harder than its law
  std::int64_t apart = 0;       ///< of approaches: each joint stopped by itself
  std::int64_t compared = 0;    ///< moments not proved at full speed, compared with a capsule model
  std::int64_t slower = 0;      ///< of those: the capsule model kept a greater speed
  /// Wrong: even with 0.2 mm more, above the model error of cylinders in motions.
  std::int64_t slower_still = 0;
  double least = 1e300;                 ///< metres: the least distance before standstill
  double speed = 0, capsule_speed = 0;  ///< sums of the proved shares of the speed, and of the capsule model's

  std::int64_t wrong() const { return contacts + slower_still; }
  void add(const Findings& other);
  std::string text() const;
};

/// Approaches of one arm, until `count` of them have braked. A seed determines them, apart from the ages of poses,
/// which are microseconds. Those of odd seeds are decided with covers.
Findings approach(std::uint64_t seed, std::int64_t count);

}  // namespace clearance::stops
