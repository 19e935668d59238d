// Least distances of the crowded arm, compared with exact ones.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "tests/engine/crowded_arm.h"
#include "tests/engine/same_rows.h"

namespace clearance::test {

inline constexpr std::uint32_t kBoundFields =
    kDefaultFields | kFieldPair | kFieldPairLower | kFieldFlags | kFieldBounds;

struct Tolerance {
  double abs, rel;
};

inline ArmStates least_distances(const engine::Scene& scene, int count) {
  ArmStates states(scene, count);
  states.query.reduce = Reduce::kMin;
  states.query.fields = kBoundFields;
  return states;
}
inline Answer bounds_of(const engine::Engine& engine, QueryView query, const Tolerance& tolerance) {
  query.abs_tol = tolerance.abs;
  query.rel_tol = tolerance.rel;
  return evaluate(engine, query);
}
inline bool has(const Answer& answer, std::uint64_t row, Status status) {
  return answer.view.status[row] == static_cast<std::uint8_t>(status);
}

/// Expects the exact distances in the rows, and no row wider than the tolerance. Returns how many are apart.
inline int expect_true_rows(const Answer& exact, const Answer& rows, const Tolerance& tolerance, std::uint64_t count) {
  int apart = 0;
  for (std::uint64_t k = 0; k < count; ++k) {
    const double lower = rows.view.lower[k], upper = rows.view.upper[k];
    EXPECT_LE(lower, exact.view.upper[k]) << k;
    EXPECT_GE(upper, exact.view.lower[k]) << k;
    EXPECT_LE(rows.view.bounds[2 * k], lower) << k;
    EXPECT_GE(rows.view.bounds[2 * k + 1], upper) << k;
    if (has(exact, k, Status::kOverlap)) {
      EXPECT_TRUE(has(rows, k, Status::kOverlap)) << k << ": an overlap is proved at any tolerance";
      EXPECT_EQ(upper, 0) << k;
    } else if (has(exact, k, Status::kOk)) {
      ++apart;
      EXPECT_TRUE(has(rows, k, Status::kOk)) << k << ": status " << int(rows.view.status[k]);
      EXPECT_GT(lower, 0) << k << ": a distance is not reported as contact";
      if (!(rows.view.flags[k] & kFlagUncertaintyLimited)) {
        EXPECT_LE(upper - lower, std::max(tolerance.abs, tolerance.rel * upper)) << k;
      }
      EXPECT_EQ(rows.view.distance[k], upper) << k;
    }
  }
  return apart;
}

/// Two engines on one scene, the first with the covers of another.
struct SameCovers {
  engine::Engine with, without;

  SameCovers(const engine::Scene& scene, const CoverEngines& engines)
      : with(engine::Scene(scene), {.backend = "cpu", .threads = 1, .cover_store = engines.with.cover_store()}),
        without(engine::Scene(scene), {.backend = "cpu", .threads = 1, .covers = engine::Covers::kOff}) {
    EXPECT_TRUE(with.wait_covers(kCoversPatience));
  }
};

/// Pairs of a body and the links beyond the elbow.
inline std::vector<BodyPair> pairs_with(const engine::Scene& scene, const std::string& body) {
  std::vector<BodyPair> pairs;
  for (std::uint32_t b = scene.find_body("arm/elbow"); b < scene.bodies().size(); ++b)
    if (scene.bodies()[b].robot != kNone && !scene.bodies()[b].parts.empty())
      pairs.push_back({scene.find_body(body), b});
  return pairs;
}

}  // namespace clearance::test
