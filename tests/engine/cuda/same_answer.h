// Bitwise comparison of whole replies.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "engine/selection/query.h"
#include "tests/engine/engine_test_util.h"
#include "tests/gpu/skip_without_device.h"

namespace clearance::test {

template <class T>
bool same_bits(const T& a, const T& b) {
  if constexpr (std::is_floating_point_v<T>)
    if (std::isnan(a) && std::isnan(b)) return true;  // the payload of a NaN is irrelevant
  return std::memcmp(&a, &b, sizeof a) == 0;
}

/// Expects the same bits in every column; shows the first few differences.
/// \param reduced the number of evaluated pairs may differ
inline void expect_same(const Answer& device, const Answer& cpu, const std::string& what, bool reduced = false) {
  ASSERT_EQ(device.size.rows, cpu.size.rows) << what;
  ASSERT_EQ(device.info.rows, cpu.info.rows) << what;
  EXPECT_EQ(device.info.total, cpu.info.total) << what;
  if (!reduced) {
    EXPECT_EQ(device.info.pairs_evaluated, cpu.info.pairs_evaluated) << what;
  }
  int column = 0;
  const auto compare = [&](auto* d, auto* c, std::uint64_t width) {
    ASSERT_EQ(d == nullptr, c == nullptr) << what;
    int shown = 0;
    std::uint64_t different = 0;
    for (std::uint64_t i = 0; d && i < width * cpu.info.rows; ++i) {
      if (same_bits(d[i], c[i])) continue;
      ++different;
      if (++shown > 3) continue;
      const std::uint64_t row = i / width;
      ADD_FAILURE() << what << ": column " << column << " row " << row << " differs; bounds "
                    << (device.view.lower ? device.view.lower[row] : 0) << ' '
                    << (device.view.upper ? device.view.upper[row] : 0) << " and "
                    << (cpu.view.lower ? cpu.view.lower[row] : 0) << ' ' << (cpu.view.upper ? cpu.view.upper[row] : 0)
                    << "; flags " << (device.view.flags ? device.view.flags[row] : 0) << " and "
                    << (cpu.view.flags ? cpu.view.flags[row] : 0);
    }
    EXPECT_EQ(different, 0u) << what << ": of column " << column;
    ++column;
  };
  for_each_column(compare, device.view, cpu.view);
}

inline std::vector<Vec3d> cloud_on_sphere(int count, double radius, std::uint64_t seed) {
  Random random(seed);
  std::vector<Vec3d> v = random.cloud(count, {1, 1, 1});
  for (Vec3d& p : v) p = p * (radius / norm(p));
  return v;
}

inline std::uint64_t counter(const engine::Engine& engine, const std::string& name) {
  for (const auto& [key, value] : engine.stats())
    if (key == name) return value;
  ADD_FAILURE() << "no counter " << name;
  return 0;
}

}  // namespace clearance::test
