// Comparison of answers, bit for bit.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "tests/engine/engine_test_util.h"

namespace clearance::test {

template <class T>
inline void expect_same_column(const char* name, const T* all, std::uint64_t at, const T* few, std::uint64_t count,
                               std::uint64_t width) {
  ASSERT_EQ(all == nullptr, few == nullptr) << name;
  for (std::uint64_t i = 0; all && i < count * width; ++i) {
    if constexpr (std::is_floating_point_v<T>)
      if (std::isnan(all[at * width + i]) && std::isnan(few[i])) continue;
    ASSERT_EQ(std::memcmp(&all[at * width + i], &few[i], sizeof(T)), 0) << name << ", row " << at + i / width;
  }
}

/// Expects the rows of one answer from `at` on to have the bits of the first rows of another. Returns the number of
/// rows by status.
inline std::array<std::uint64_t, 8> expect_same_rows(const Answer& all, std::uint64_t at, const Answer& few,
                                                     std::uint64_t count) {
  const ReplyView &v = all.view, &w = few.view;
  expect_same_column("distance", v.distance, at, w.distance, count, 1);
  expect_same_column("lower", v.lower, at, w.lower, count, 1);
  expect_same_column("upper", v.upper, at, w.upper, count, 1);
  expect_same_column("status", v.status, at, w.status, count, 1);
  expect_same_column("flags", v.flags, at, w.flags, count, 1);
  expect_same_column("point_a", v.point_a, at, w.point_a, count, 3);
  expect_same_column("point_b", v.point_b, at, w.point_b, count, 3);
  expect_same_column("normal", v.normal, at, w.normal, count, 3);
  expect_same_column("pieces", v.parts, at, w.parts, count, 2);
  expect_same_column("gradient", v.gradient, at, w.gradient, count, 12);
  expect_same_column("pair", v.pair, at, w.pair, count, 1);
  expect_same_column("configuration", v.configuration, at, w.configuration, count, 1);
  expect_same_column("points32", v.points32, at, w.points32, count, 6);
  expect_same_column("bounds", v.bounds, at, w.bounds, count, 2);
  std::array<std::uint64_t, 8> seen{};
  for (std::uint64_t i = 0; i < count; ++i) ++seen[v.status[at + i]];
  return seen;
}

/// Number of rows with a status, of those that expect_same_rows() has counted.
inline std::uint64_t count_of(const std::array<std::uint64_t, 8>& seen, Status status) {
  return seen[static_cast<std::size_t>(status)];
}

/// The same bodies with uncertainty.
inline engine::Scene with_uncertainty(const engine::Scene& known) {
  engine::Scene scene;
  for (Body body : known.bodies()) {
    body.uncertainty = {0.01, 0.1};
    scene.add_body(std::move(body));
  }
  return scene;
}

/// Expects each row of a query of all pairs to have the bits of the same pair alone in its configuration. Adds the
/// number of rows by status.
inline void expect_rows_as_alone(const engine::Engine& engine, const QueryView& query,
                                 std::array<std::uint64_t, 8>& seen) {
  const Answer all = evaluate(engine, query);
  const std::vector<BodyPair> pairs = engine.pairs({});
  const std::size_t moved = query.bodies.size();
  ASSERT_EQ(all.size.rows, pairs.size() * query.configuration_count);
  for (std::uint32_t k = 0; k < query.configuration_count; ++k)
    for (std::size_t p = 0; p < pairs.size(); ++p) {
      QueryView one = query;
      one.all_pairs = false;
      one.pairs = std::span(&pairs[p], 1);
      one.configuration_count = 1;
      one.configurations = query.configurations.subspan(k * moved, moved);
      const Answer alone = evaluate(engine, one);
      *alone.view.configuration = k;
      const auto seen_here = expect_same_rows(all, k * pairs.size() + p, alone, 1);
      for (std::size_t s = 0; s < seen.size(); ++s) seen[s] += seen_here[s];
      if (::testing::Test::HasFatalFailure())
        FAIL() << "configuration " << k << ", bodies " << pairs[p].a << ' ' << pairs[p].b;
    }
}

}  // namespace clearance::test
