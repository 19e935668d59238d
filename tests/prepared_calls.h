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
    }
  }

  Prepared scales = front.prepare(as_free_scale(alone, weights));
  const std::vector<double> expected = front.free_scale(given, weights);
  EXPECT_GT(*std::ranges::max_element(expected), 0);
  expect_same(scales.run(positions).free_scale(), expected);
}

}  // namespace clearance::test
