// Distances of states side by side: the bounds and the rows that each state has alone.
#include <array>
#include <cmath>
#include <limits>
#include <tuple>
#include <vector>

#include "tests/engine/same_rows.h"
#include "tests/oracle/decision/pair_query.h"

namespace clearance::exact {
namespace {

constexpr std::size_t kStates = 45;  // five eights, and five more
constexpr Reduce kReduces[] = {Reduce::kMin, Reduce::kNearest, Reduce::kNone};

// An arm that folds, with joint tables, whose last link slides; among obstacles.
BallScene made_folding_among_obstacles() {
  Random random(21);
  engine::RobotOptions options;
  options.base = Pose{{1, 2, 0.5}, 0.5, 0.5, -0.5, 0.5};
  BallScene made(
      {{},
       {{{{0.125, 0.0625, 0}, 0.015625}}, 0, turning({0, 0, 0.25}, {0.25, 0, 1})},
       {{{{0, 0, 0}, 0.0078125}}, 1, turning({0.125, 0, 0}, {0, 0, 1})},
       {{{{0.0625, 0.03125, 0}, 0.015625}}, 2, turning({0.03125, 0, 0.03125}, {0, 1, 0.25})},
       {{{{0.03125, 0, 0}, 0.015625}}, 3, turning({0.0625, 0, 0}, {1, 0, 0.25})},
       {random_balls(random, 20, 0.0625, 0.015625), 4, sliding({0.125, 0, 0}, {1, 0.25, 0}, -0.0625, 0.125)}},
      options);
  for (int n = 0; n < 2; ++n)
    made.add_obstacle(random_balls(random, 4, 0.0625, 0.015625),
                      random.rotation(Vec3d{1, 2, 0.5} + random.direction() * 0.35));
  return made;
}

/// States of the arm, some of which covers cannot bound: also the first of an eight.
struct ArmStates {
  BallScene made = made_folding_among_obstacles();
  std::unique_ptr<JointTableStore> tables = tables_of(made);
  std::vector<BodyPair> pairs;
  std::vector<double> positions;

  static bool is_bad(std::size_t state) { return state % 16 == 0 || state == 13 || state == kStates - 1; }

  ArmStates() {
    const auto bodies = static_cast<std::uint32_t>(made.scene().bodies().size());
    for (const std::uint32_t obstacle : {bodies - 2, bodies - 1})
      for (const std::size_t link : {1u, 3u, 4u, 5u}) pairs.push_back({made.link(link), obstacle});
    for (const std::size_t link : {1u, 2u}) pairs.push_back({made.link(link), made.link(link + 2)});
    pairs.push_back({made.link(1), made.link(5)});
    Random random(22);
    constexpr std::array<double, 3> kBad = {std::numeric_limits<double>::quiet_NaN(), 1e9, 50};
    for (std::size_t k = 0; k < kStates; ++k) {
      std::vector<double> q = random_positions(made, random);
      if (is_bad(k)) q[k % 3 == 2 ? 4 : k % 5] = kBad[k % 3];  // the last one of the joint that slides
      positions.insert(positions.end(), q.begin(), q.end());
    }
  }
};

/// A group's bounds in one state, with the pairs left.
using Group = std::tuple<bool, double, double, std::uint64_t, std::uint64_t, std::uint32_t,
                         std::vector<std::pair<std::uint64_t, float>>>;

// (states, groups)
std::vector<Group> groups_of(PairQuery& query, Reduce reduce, double abs_tol, Placing placing, std::size_t batch) {
  std::vector<Group> groups;
  query.bound_states(reduce, abs_tol, placing, batch,
                     [&](std::size_t, std::size_t count, const CoverBounds::Room& room) {
                       ASSERT_EQ(room.bounds.size(), count * query.groups(reduce));
                       for (const DistanceBounds& b : room.bounds) {
                         std::vector<std::pair<std::uint64_t, float>> left;
                         for (std::uint32_t i = b.left_begin; i < b.left_end; ++i)
                           left.emplace_back(room.left[i].position, room.left[i].lower);
                         groups.emplace_back(b.is_listed, b.lower, b.upper, b.lower_at, b.upper_at, b.packets, left);
                       }
                     });
  return groups;
}

TEST(StateLanes, BoundsAreThoseOfEachStateAlone) {
  const ArmStates of;
  PairQuery query(of.made, of.pairs, of.positions, 0, false, of.tables.get()),
      without(of.made, of.pairs, of.positions, 0);
  ASSERT_TRUE(query.can_place_lanes());
  EXPECT_GE(query.view().tabled_count, 2u);
  int by_tables = 0;
  for (const Reduce reduce : kReduces)
    for (const double abs_tol : {1e-6, 0.005, 0.05}) {
      const std::vector<Group> alone = groups_of(query, reduce, abs_tol, Placing::kByPoses, 1);
      ASSERT_EQ(alone.size(), kStates * query.groups(reduce));
      EXPECT_EQ(groups_of(query, reduce, abs_tol, Placing::kByPoses, kStates), alone);
      EXPECT_EQ(groups_of(query, reduce, abs_tol, Placing::kOneByOne, 1), alone);
      for (std::size_t batch = 1; batch <= kMostLanes; ++batch)
        EXPECT_EQ(groups_of(query, reduce, abs_tol, Placing::kInLanes, batch), alone) << batch << " side by side";
      std::size_t listed = 0, others = 0;
      for (std::size_t i = 0; i < alone.size(); ++i) {
        const bool is_listed = std::get<0>(alone[i]);
        EXPECT_EQ(is_listed, !ArmStates::is_bad(i / query.groups(reduce))) << i;
        listed += is_listed;
        others += i >= query.groups(reduce) && alone[i] != alone[i - query.groups(reduce)];
      }
      EXPECT_GT(listed, alone.size() / 2);
      if (reduce != Reduce::kNearest) {
        EXPECT_GT(others, alone.size() / 2) << "states differ, so that one in the place of another is seen";
      }
      by_tables += groups_of(without, reduce, abs_tol, Placing::kByPoses, kStates) != alone;
    }
  EXPECT_GT(by_tables, 3) << "tables bound pairs, so that a cell of another state is seen";
}

// Expects a row to have the exact engine's status, or to hold its interval.
void expect_exact(const test::Answer& exact, const test::Answer& rows, std::uint64_t row) {
  const auto status = static_cast<Status>(exact.view.status[row]);
  if (status != Status::kOk && status != Status::kOverlap) {
    EXPECT_EQ(rows.view.status[row], exact.view.status[row]) << row;
    return;
  }
  EXPECT_LE(rows.view.lower[row], exact.view.upper[row]) << row;
  EXPECT_GE(rows.view.upper[row], exact.view.lower[row]) << row;
}

TEST(StateLanes, RowsAreThoseOfEachStateAlone) {
  const ArmStates of;
  const engine::Engine with(engine::Scene(of.made.scene()), {.backend = "cpu", .threads = 1}),
      without(engine::Scene(of.made.scene()), {.backend = "cpu", .threads = 1, .covers = engine::Covers::kOff});
  ASSERT_TRUE(with.wait_covers(std::chrono::minutes(10)));
  const std::vector<std::uint32_t> joints = {0, 1, 2, 3, 4};
  QueryView query;
  query.joints = joints;
  query.all_pairs = false;
  query.pairs = of.pairs;
  query.fields = kDefaultFields | kFieldPair | kFieldFlags;
  for (const Reduce reduce : kReduces)
    for (const double abs_tol : {0.0, 0.005, 0.05}) {
      query.reduce = reduce;
      query.abs_tol = abs_tol;
      query.rel_tol = abs_tol > 0 ? 0 : 1e-6;
      const auto in = [&](std::size_t first, std::size_t count) {
        QueryView some = query;
        some.positions = std::span(of.positions).subspan(first * joints.size(), count * joints.size());
        some.configuration_count = static_cast<std::uint32_t>(count);
        return some;
      };
      QueryView exactly = in(0, kStates);
      exactly.abs_tol = 0;
      exactly.rel_tol = 1e-12;
      const test::Answer exact = test::evaluate(without, exactly), all = test::evaluate(with, in(0, kStates));
      if (reduce != Reduce::kNone || abs_tol > 0) {
        EXPECT_LT(all.info.pairs_evaluated, exact.info.pairs_evaluated) << "covers answer some";
      }
      const std::uint64_t groups = exact.size.rows / kStates;
      for (std::uint64_t row = 0; row < exact.size.rows; ++row) expect_exact(exact, all, row);
      for (std::size_t k = 0; k < kStates; ++k)
        test::expect_same_rows(all, k * groups, test::evaluate(with, in(k, 1)), groups);
      for (std::size_t count = 3; count <= 2 * kMostLanes; ++count)
        test::expect_same_rows(all, 0, test::evaluate(with, in(0, count)), count * groups);
    }
}

}  // namespace
}  // namespace clearance::exact
