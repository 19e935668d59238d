// Compares robots with the oracle of kinematics: the exact distance of links with 60-digit poses lies in every
// interval, also in those that are as narrow as the arithmetic allows. Linked once with the engine, and once with each
// faulty one that omits a part of the kinematics' own error (CMakeLists.txt).
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <limits>
#include <vector>

#include "tests/engine/evaluate_query.h"
#include "tests/oracle/cases/link_scene.h"

namespace clearance::exact {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

struct Findings {
  int requested = 0;
  int misses = 0;  // intervals without the exact distance
  int wide = 0;    // intervals wider than documented for robots
  int all() const { return misses + wide; }
};

void hold(double lower, double upper, const Real& exact_value, Findings& findings) {
  ++findings.requested;
  const Real distance = std::max(exact_value, Real(0));
  findings.misses += Real(lower) > distance || Real(upper) < distance;
}

// All pairs of some configurations, and their reductions.
void check_robot(LinkScene& scene, bool by_joints, Findings& findings) {
  constexpr std::uint32_t kCount = 4;
  std::vector<double> rows;
  for (std::uint32_t k = 0; k < (by_joints ? kCount : 1); ++k) {
    const std::vector<double> row = scene.row();
    rows.insert(rows.end(), row.begin(), row.end());
  }
  const std::size_t width = scene.joints().size();
  QueryView query;
  query.rel_tol = 0;
  if (by_joints) {
    query.joints = scene.joints();
    query.positions = rows;
    query.configuration_count = kCount;
  } else {
    scene.set(rows);
  }
  const std::vector<BodyPair> pairs = scene.engine().pairs(query);
  std::vector<std::vector<Real>> exact_values;
  for (std::size_t k = 0; k * width < rows.size(); ++k)
    exact_values.push_back(scene.exact_values(pairs, std::span(rows).subspan(k * width, width)));
  const test::Answer dense = test::evaluate(scene.engine(), query);
  for (std::size_t k = 0; k < exact_values.size(); ++k)
    for (std::size_t p = 0; p < pairs.size(); ++p) {
      const double lower = dense.view.lower[k * pairs.size() + p], upper = dense.view.upper[k * pairs.size() + p];
      hold(lower, upper, exact_values[k][p], findings);
      findings.wide += upper - lower > scene.claim();
    }
  for (const double max_distance : {kInf, 0.5}) {
    query.reduce = Reduce::kMin;
    query.max_distance = max_distance;
    const test::Answer least = test::evaluate(scene.engine(), query);
    for (std::size_t k = 0; k < exact_values.size(); ++k) {
      const Real exact_value = *std::min_element(exact_values[k].begin(), exact_values[k].end());
      if (least.view.status[k] != static_cast<std::uint8_t>(Status::kBeyond))
        hold(least.view.lower[k], least.view.upper[k], exact_value, findings);
      else
        findings.misses += exact_value <= max_distance;
    }
  }
}

Findings run(const Draw& draw, int scenes, std::uint64_t seed) {
  test::RobotRandom random(seed);
  Findings findings;
  for (int i = 0; i < scenes; ++i) {
    LinkScene scene(random, draw);
    check_robot(scene, true, findings);
    check_robot(scene, false, findings);
  }
  std::printf("%d answers: %d misses, %d wide\n", findings.requested, findings.misses, findings.wide);
  return findings;
}

const Draw kArm, kLongLinks{.offset = 0.01, .arm = 4}, kSlides{.offset = 0.01, .arm = 0.01, .travel = 100},
    kFar{.travel = 1, .far = 1e4};

TEST(LinkSlack, HoldsLinksWhere60DigitsPutThem) {
  for (const Draw& draw : {kArm, kLongLinks, kSlides, kFar}) {
    const Findings found = run(draw, 12, 3);
    EXPECT_GT(found.requested, 1500);
    EXPECT_EQ(found.all(), 0);
  }
}

// For any pose of the base, the distance of its links depends on their joints only.
TEST(LinkSlack, LinksOfOneRobotStandOnOneBase) {
  test::RobotRandom random(7);
  LinkScene scene(random, kArm, true);
  QueryView query;
  query.rel_tol = 0;
  const std::vector<BodyPair> pairs = scene.engine().pairs(query);
  const test::Answer answer = test::evaluate(scene.engine(), query);
  int links = 0, others = 0;
  for (std::size_t p = 0; p < pairs.size(); ++p) {
    const double width = answer.view.upper[p] - answer.view.lower[p];
    const auto robot_of = [&](std::uint32_t body) { return scene.engine().scene().bodies()[body].robot; };
    if (robot_of(pairs[p].a) != kNone && robot_of(pairs[p].b) != kNone) {
      ++links;
      EXPECT_LE(width, scene.claim());
    } else if (pairs[p].a == 0 && robot_of(pairs[p].b) != kNone && answer.view.lower[p] > 0) {
      ++others;
      EXPECT_GE(width, 0.01);
    }
  }
  EXPECT_GT(links, 2);
  EXPECT_GT(others, 2);
}

}  // namespace
}  // namespace clearance::exact
