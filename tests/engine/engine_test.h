// Fixture of the engine tests, which run on every available backend. test_engine.cpp instantiates the suite.
#pragma once

#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "tests/engine/engine_test_util.h"

namespace clearance::test {

inline constexpr double kInf = std::numeric_limits<double>::infinity();

class EngineTest : public ::testing::TestWithParam<std::string> {
 protected:
  engine::Engine make(engine::Scene scene, int threads = 2) {
    return engine::Engine(std::move(scene), {GetParam(), threads});
  }
};

// All bits of an answer.
inline std::vector<std::byte> bits(const Answer& a) {
  std::uint64_t bytes = 0;
  reply_view_over(nullptr, a.size.rows, a.size.fields, &bytes);
  std::vector<std::byte> all;
  const auto append = [&](const void* p, std::size_t n) {
    const auto* b = static_cast<const std::byte*>(p);
    all.insert(all.end(), b, b + n);
  };
  append(a.view.distance, 8 * a.info.rows);
  append(a.view.lower, 8 * a.info.rows);
  append(a.view.upper, 8 * a.info.rows);
  append(a.view.status, a.info.rows);
  append(a.view.flags, 2 * a.info.rows);
  return all;
}

}  // namespace clearance::test
