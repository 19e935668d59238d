// Prepared queries of an Engine or a Client, compared with the calls of the same name.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "wire/api/check.h"
#include "wire/api/prepared.h"
#include "wire/api/prepared_path.h"
#include "wire/api/scene_info.h"

namespace clearance::test {

/// Positions of joints within their limits or a turn, some of them free and some not.
inline std::vector<double> spread_positions(const Joints& joints, std::size_t configurations) {
  std::vector<double> positions;
  for (std::size_t k = 0; k < configurations; ++k)
    for (std::size_t j = 0; j < joints.size(); ++j) {
      const double lower = std::max(joints.limits[j].lower, -3.0), upper = std::min(joints.limits[j].upper, 3.0);
      const double share = static_cast<double>((7 * k + 3 * j + k * j) % 11) / 11;
      positions.push_back(lower + share * (upper - lower));
    }
  return positions;
}

inline void expect_same_path(const PathCheck& got, const PathCheck& expected) {
  EXPECT_EQ(got.free, expected.free);
  EXPECT_EQ(got.index, expected.index);
  EXPECT_EQ(got.t, expected.t);
  EXPECT_EQ(got.pair, expected.pair);
  EXPECT_EQ(got.status, expected.status);
  EXPECT_EQ(got.limit_violations.size(), expected.limit_violations.size());
}

/// Compares prepare_path() with check_path() of straight motions and of curves.
template <class Queried>
void expect_prepared_paths_answer_as_calls(Queried& front, const Joints& joints) {
  const std::vector<double> positions = spread_positions(joints, 24);
  for (const std::uint32_t points : {2u, 3u, 4u, 6u}) {
    Query query{.joints = joints.ids, .control_points = points};
    PreparedPath prepared = front.prepare_path(query);
    bool some_free = false, some_not = false;
    for (std::size_t k = 0; k < 24; k += points) {  // one motion, short or long
      std::vector<double> path(positions.begin() + static_cast<std::ptrdiff_t>(k * joints.size()),
                               positions.begin() + static_cast<std::ptrdiff_t>((k + points) * joints.size()));
      for (const double share : {1.0, 0.01}) {
        for (std::size_t i = joints.size(); i < path.size(); ++i)
          path[i] = path[i % joints.size()] + share * (path[i] - path[i % joints.size()]);
        query.positions = path;
        const PathCheck expected = front.check_path(query);
        (expected.free ? some_free : some_not) = true;
        expect_same_path(prepared.run(path), expected);
      }
    }
    EXPECT_TRUE(some_free && some_not) << points;
    query.positions = positions;
    const PathCheck whole = front.check_path(query);
    expect_same_path(prepared.run(positions), whole);
    if (points > 2) {  // a motion for each segment
      query.reduce = Reduce::kAny;
      query.fields = kFieldVerdict;
      const Result segments = front.motions(query);
      ASSERT_EQ(segments.rows(), 24 / points);
      const auto open = std::ranges::find_if(segments.verdict(), [](Status s) { return s != Status::kBeyond; });
      EXPECT_EQ(whole.index, static_cast<std::uint64_t>(open - segments.verdict().begin()));
    }
    EXPECT_THROW(prepared.run(std::span(positions).first(joints.size())), std::invalid_argument);
    EXPECT_FALSE(prepared.is_stale());
  }
}

/// \param front an Engine or a Client
template <class Queried>
void expect_prepared_calls_answer_as_calls(Queried& front, const Joints& joints) {
  constexpr std::size_t kConfigurations = 40;
  const std::vector<double> positions = spread_positions(joints, kConfigurations), weights(joints.size(), 1.0);
  const Query alone{.joints = joints.ids}, given{.joints = joints.ids, .positions = positions};
  const auto expect_same = [](const auto& got, const auto& expected) {
    EXPECT_TRUE(std::equal(got.begin(), got.end(), expected.begin(), expected.end()));
  };

  const Check check = front.check(given);
  EXPECT_TRUE(std::ranges::find(check.free, true) != check.free.end());
  EXPECT_TRUE(std::ranges::find(check.free, false) != check.free.end());
  Prepared checks = front.prepare(as_check(alone));
  expect_same(checks.run(positions).verdict(), check.verdict);
  for (std::size_t k = 0; k < kConfigurations; ++k)
    EXPECT_EQ(checks.run(std::span(positions).subspan(k * joints.size(), joints.size())).all_free(), check.free[k]);
  expect_same(checks.submit({positions}).get().pair(), check.pair);

  for (const Reduce reduce : {Reduce::kNone, Reduce::kMin, Reduce::kAny}) {
    Query query = given, of_motions = alone;
    query.reduce = of_motions.reduce = reduce;
    const Result motions = front.motions(query);
    ASSERT_EQ(motions.rows() % (kConfigurations / 2), 0u);
    Prepared prepared = front.prepare(as_motions(of_motions));
    for (const Result& result : {prepared.run(positions), prepared.submit({positions}).get()}) {
      expect_same(result.status(), motions.status());
      expect_same(result.lower(), motions.lower());
      expect_same(result.verdict(), motions.verdict());
      EXPECT_FALSE(result.all_free());  // some are not
    }
  }

  Prepared scales = front.prepare(as_free_scale(alone, weights));
  const std::vector<double> expected = front.free_scale(given, weights);
  EXPECT_GT(*std::ranges::max_element(expected), 0);
  expect_same(scales.run(positions).free_scale(), expected);
}

}  // namespace clearance::test
