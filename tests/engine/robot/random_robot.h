// Random numbers for tests of robots.
#pragma once

#include <cstdint>
#include <random>

#include "engine/pose/pose.h"

namespace clearance::test {

/// Seeded numbers for random robots and their poses.
class RobotRandom {
 public:
  explicit RobotRandom(std::uint64_t seed) : bits_(seed) {}
  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(bits_); }
  int below(int n) { return std::uniform_int_distribution<int>(0, n - 1)(bits_); }
  /// Of length 1.
  Vec3d direction() {
    std::normal_distribution<double> normal;
    const Vec3d v{normal(bits_), normal(bits_), normal(bits_)};
    return v * (1 / norm(v));
  }
  Pose pose(double far, double length) {
    return {{uniform(-far, far), uniform(-far, far), uniform(-far, far)},
            length * uniform(-1, 1),
            length * uniform(-1, 1),
            length * uniform(-1, 1),
            length * uniform(0.1, 1)};
  }

 private:
  std::mt19937_64 bits_;
};

}  // namespace clearance::test
