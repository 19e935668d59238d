// Signed distances of non-convex bodies, whose depth is only bounded by an interval. Compared with the oracle: a shift
// by -lower along the normal separates the bodies, and no shift shorter than -upper does.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <string>

#include "engine/engine.h"
#include "tests/oracle/oracle_run.h"

namespace clearance::exact {
namespace {

constexpr std::uint64_t kSeed = 1, kFirst = 500;
constexpr int kCases = 12, kWays = 6;

struct Depth {
  double lower, upper;
  Status status;
  Vec3d normal;
};

/// \param second null, or another part of a
Depth evaluate(const Case& c, const SolidPtr& second = nullptr) {
  engine::Scene scene;
  Body a, b;
  a.name = "a", b.name = "b";
  a.parts = {part_of(*c.a)};
  if (second) a.parts.push_back(part_of(*second));
  b.parts = {part_of(*c.b)};
  a.pose = c.X_wa, b.pose = c.X_wb;
  scene.add_body(std::move(a));
  scene.add_body(std::move(b));
  const engine::Engine engine(std::move(scene), {.threads = 1, .covers = engine::Covers::kOff});
  Depth d{};
  QueryView q;
  q.signed_distance = true;
  q.fields = kFieldLower | kFieldUpper | kFieldStatus | kFieldNormal;
  ReplyView reply;
  double normal[3];
  std::uint8_t status;
  reply.rows = 1;
  reply.lower = &d.lower;
  reply.upper = &d.upper;
  reply.status = &status;
  reply.normal = normal;
  engine.start(q, reply).advance();
  d.status = static_cast<Status>(status);
  d.normal = {normal[0], normal[1], normal[2]};
  return d;
}

// Whether the case has a cloud, whose depth is rejected.
bool has_points(const Case& c) {
  return !c.a->cloud.empty() || !c.b->cloud.empty();
}

bool is_apart(Case c, const Vec3d& shift) {
  c.X_wb.translation += shift;
  return exact_answer(c, false).distance.compare(0) > 0;
}

TEST(MeshDepths, WhatTakesHullsApartTakesApartWhatTheyAreAround) {
  Random random(kSeed);
  int apart = 0, overlapping = 0, proved = 0, converged = 0;
  for (const CaseClass& cls : mesh_classes())
    for (std::uint64_t i = kFirst; i < kFirst + kCases; ++i) {
      const Case c = make_case(cls, kSeed, i);
      if (has_points(c)) continue;
      const Result exact_value = exact_answer(c, false);
      const Depth d = evaluate(c);
      const std::string where = std::string(cls.name) + " " + std::to_string(i);
      ASSERT_LE(d.lower, d.upper) << where;
      converged += d.status != Status::kUnconverged;
      if (exact_value.distance.compare(0) > 0) {
        ++apart;
        EXPECT_LE(exact_value.distance.compare(d.upper), 0) << where;
        if (d.lower > 0) {
          EXPECT_GE(exact_value.distance.compare(d.lower), 0) << where;
        }
        continue;
      }
      ++overlapping;
      ASSERT_LE(d.lower, 0) << where;
      const double little = 1e-9 * (reach(*c.a) + reach(*c.b) + 1);
      EXPECT_TRUE(is_apart(c, d.normal * (little - d.lower))) << where << ": " << d.lower;
      if (!(-d.upper > little)) continue;
      ++proved;
      for (int k = 0; k < kWays; ++k)
        EXPECT_FALSE(is_apart(c, random.direction() * (-d.upper - little))) << where << ": " << d.upper;
    }
  std::printf("%d apart, %d overlapping, of which %d are proved to by a length; %d settled\n", apart, overlapping,
              proved, converged);
  EXPECT_GT(apart, 50);
  EXPECT_GT(overlapping, 50);
  EXPECT_GT(proved, 5);
  EXPECT_GE(converged, apart / 2);
}

TEST(MeshDepths, TheDeepestPairOfPartsCounts) {
  int first = 0, second = 0;
  for (const CaseClass& cls : mesh_classes())
    for (std::uint64_t i = kFirst; i < kFirst + kCases; ++i) {
      const Case c = make_case(cls, kSeed, i), other{make_case(cls, kSeed, i + kCases).b, c.b, c.X_wa, c.X_wb};
      if (has_points(c) || has_points(other)) continue;
      const double one = evaluate(c).lower, two = evaluate(other).lower, both = evaluate(c, other.a).lower;
      if (std::min(one, two) > 0) continue;
      EXPECT_LE(both, std::min(one, two) + 1e-9) << cls.name << ' ' << i;
      if (one < two - 1e-6) ++first;
      if (two < one - 1e-6) ++second;
    }
  std::printf("the first piece is the deeper one in %d cases, the second in %d\n", first, second);
  EXPECT_GT(first, 10);
  EXPECT_GT(second, 10);
}

}  // namespace
}  // namespace clearance::exact
