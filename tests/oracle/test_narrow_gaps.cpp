// Solids whose gap is narrower than a tolerance: no tolerance makes a contact of more than 1 um.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "engine/engine.h"
#include "engine/hull/shapes.h"
#include "tests/engine/evaluate_query.h"
#include "tests/oracle/oracle_run.h"

namespace clearance::exact {
namespace {

constexpr int kPairs = 60;
constexpr double kMostContact = 1e-6;

/// Two cubes of 1 m with parallel faces this far apart, but for rounding, in any pose.
Case cubes(double gap, Random& random) {
  const Shape cube = make_box({1, 1, 1});
  Solid solid;
  solid.vertices = cube.vertices, solid.triangles = cube.triangles, solid.is_solid = true;
  const auto shared = std::make_shared<const Solid>(std::move(solid));
  Case c{shared, shared, random.rotation(), {}};
  const double angle = random.uniform(0, 6), s = std::sin(angle), k = std::cos(angle);
  const Pose& X = c.X_wa;
  const Vec3d normal = rotation_of(X) * Vec3d{0, 0, 1};
  c.X_wb = Pose{normal * (1 + gap), X.qw * k - X.qz * s, X.qx * k + X.qy * s, X.qy * k - X.qx * s, X.qz * k + X.qw * s};
  return c;
}

struct Rows {
  std::vector<double> lower, upper;
  std::vector<Status> status;
};

Rows rows_of(const Bench& bench, double abs_tol) {
  std::vector<BodyPair> pairs;
  for (std::uint32_t i = 0; i < kPairs; ++i) pairs.push_back({2 * i, 2 * i + 1});
  QueryView query;
  query.all_pairs = false;
  query.pairs = pairs;
  query.abs_tol = abs_tol;
  query.rel_tol = abs_tol > 0 ? 0 : 1e-12;
  const test::Answer answer = test::evaluate(bench.engine(), query);
  Rows rows;
  for (std::size_t i = 0; i < kPairs; ++i) {
    rows.lower.push_back(answer.view.lower[i]);
    rows.upper.push_back(answer.view.upper[i]);
    rows.status.push_back(static_cast<Status>(answer.view.status[i]));
  }
  return rows;
}

/// Compares rows to all tolerances with exact distances. Returns the number of contacts to the widest tolerance.
int contacts_of(double gap) {
  SCOPED_TRACE(gap);
  Random random(7);
  std::vector<Case> cases;
  for (int i = 0; i < kPairs; ++i) cases.push_back(cubes(gap, random));
  const Bench bench(cases, "cpu");
  const Rows last_digits = rows_of(bench, 0), micrometre = rows_of(bench, kMostContact);
  int contacts = 0;
  for (const double tolerance : {0.0, 1e-6, 1e-4, 1e-2, 1e-1}) {
    SCOPED_TRACE(tolerance);
    const Rows rows = rows_of(bench, tolerance);
    contacts = 0;
    for (std::size_t i = 0; i < kPairs; ++i) {
      const Value exact = exact_answer(cases[i], false).distance;
      EXPECT_GT(exact.compare(0.5 * gap), 0) << i;
      EXPECT_GE(exact.compare(rows.lower[i]), 0) << i;
      EXPECT_LE(exact.compare(rows.upper[i]), 0) << i;
      if (rows.status[i] == Status::kContact) {
        ++contacts;
        EXPECT_GT(tolerance, 0) << i << ": the last digits prove the gap";
        EXPECT_EQ(rows.lower[i], 0) << i;
        EXPECT_LE(rows.upper[i], kMostContact) << i;
      } else {
        EXPECT_EQ(rows.status[i], Status::kOk) << i;
        EXPECT_GT(rows.lower[i], 0) << i;
      }
      if (tolerance > kMostContact) {
        EXPECT_EQ(rows.status[i], micrometre.status[i]) << i << ": a wider tolerance than 1 um changes no status";
      }
      EXPECT_LE(last_digits.upper[i] - last_digits.lower[i], 1e-11 * last_digits.upper[i] + 1e-26) << i;
    }
  }
  std::printf("gap %g m: %d of %d are contacts\n", gap, contacts, kPairs);
  return contacts;
}

TEST(NarrowGaps, AreContactsWithinAMicrometreAlone) {
  EXPECT_GT(contacts_of(1e-12), 0);
  contacts_of(1e-9);
  EXPECT_EQ(contacts_of(2e-6), 0);
  EXPECT_EQ(contacts_of(1e-3), 0);
}

}  // namespace
}  // namespace clearance::exact
