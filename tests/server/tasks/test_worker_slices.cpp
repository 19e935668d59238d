// A worker yields after few units of work, however expensive a step of one query, measured by the units of one turn if
// the loop itself does the worker's share.
#include <gtest/gtest.h>

#include <algorithm>

#include "engine/narrow/work_meter.h"
#include "tests/server/core/loop_fixture.h"
#include "tests/source_file.h"

namespace clearance {
namespace {

using wire::FrameType;

/// Less than a millisecond.
constexpr std::uint64_t kMostUnitsOfSlice = 2048;
constexpr std::uint32_t kSpheres = 3000;

/// Single points far apart; group 0 has all of them.
engine::Scene spread_points() {
  engine::Scene scene;
  std::vector<std::string> names;
  for (std::uint32_t i = 0; i < kSpheres; ++i) {
    names.push_back("b" + std::to_string(i));
    scene.add_sphere(names.back(), 0.1, at(i % 50, i / 50, 0));
  }
  scene.add_group("all", names);
  return scene;
}

class WorkerSlices : public LoopTest {
 protected:
  /// Sends a frame and returns its reply, checking that no turn takes many units.
  std::unique_ptr<MemoryFrame> request_in_slices(std::vector<std::byte> frame) {
    transport_->send(a_, std::move(frame));
    std::uint64_t most = 0;
    turns_ = 0;
    while (a_.replies.empty()) {
      const std::uint64_t before = units_of_this_thread;
      loop_->turn();
      most = std::max(most, units_of_this_thread - before);
      ++turns_;
    }
    EXPECT_LE(most, kMostUnitsOfSlice);
    return take(a_);
  }
  int turns_ = 0;
};

TEST_F(WorkerSlices, GroupsAreExpandedInThem) {
  start(spread_points(), short_slices());
  TestQuery query;
  query.pairs = {{kGroupBit, kGroupBit}, {7, 5}, {kEveryBody, kGroupBit}};
  const auto table = request_in_slices(query.frame(1, FrameType::kPairs));
  const std::uint64_t each = std::uint64_t{kSpheres} * (kSpheres - 1) / 2;
  ASSERT_EQ(table->body().size(), sizeof(wire::PairsHeader) + (2 * each + 1) * sizeof(BodyPair));
  EXPECT_GT(turns_, 1000);

  query.pairs = {{kGroupBit, kGroupBit}};
  query.header.reduce = static_cast<std::uint8_t>(Reduce::kMin);
  const Result reply = result_of(request_in_slices(query.frame(1)));
  EXPECT_EQ(reply.pairs(), each);
  EXPECT_GT(turns_, 1000);
}

TEST_F(WorkerSlices, PairsOfMovedBodiesAreListedInThem) {
  start(spread_points(), short_slices());
  TestQuery query;
  query.header.reduce = static_cast<std::uint8_t>(Reduce::kMin);
  for (std::uint32_t b = 0; b < kSpheres; b += 2) query.bodies.push_back(b);
  for (std::size_t i = 0; i < query.bodies.size(); ++i)
    query.configurations.push_back({1000.0 + static_cast<double>(i), 0, 0, 1, 0, 0, 0});
  const std::uint64_t moved = kSpheres / 2;
  EXPECT_EQ(result_of(request_in_slices(query.frame(1))).pairs(), moved * (moved - 1) / 2 + moved * (kSpheres - moved));
  EXPECT_GT(turns_, 1000);
}

TEST_F(WorkerSlices, ListsOfPairsAreReadInThem) {
  start(spread_points(), short_slices());
  TestQuery query;
  query.header.reduce = static_cast<std::uint8_t>(Reduce::kMin);
  constexpr std::uint32_t kPairs = 1'000'000;
  for (std::uint32_t i = 0; i < kPairs; ++i) query.pairs.push_back({i % kSpheres, (i + 1 + i / kSpheres) % kSpheres});
  EXPECT_EQ(result_of(request_in_slices(query.frame(1))).pairs(), kPairs);
}

/// Corners of a ball, as many as a fine mesh has.
std::vector<Vec3d> ball(int corners, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::vector<Vec3d> vertices(static_cast<std::size_t>(corners));
  for (Vec3d& v : vertices) {
    v = {normal(random), normal(random), normal(random)};
    v = v * (1 / norm(v));
  }
  return vertices;
}

TEST_F(WorkerSlices, TheDepthOfOnePairOfPartsIsFoundInThem) {
  // One inside the other: the surface between them is refined until the memory is used up.
  engine::Scene scene;
  scene.add_hull("a", ball(5000, 1), at(0, 0, 0));
  scene.add_hull("b", ball(5000, 2), at(0, 0, 0));
  start(std::move(scene), short_slices());
  TestQuery query = small_query();
  query.header.signed_distance = 1;
  const Result reply = result_of(request_in_slices(query.frame(1)));
  EXPECT_LT(reply.upper()[0], -1.9);
  EXPECT_GT(turns_, 100);

  engine::Engine reference(engine_->scene(), engine::Engine::Options{.threads = 1});
  QueryView direct;
  direct.signed_distance = true;
  double lower, upper;
  ReplyView view;
  view.lower = &lower;
  view.upper = &upper;
  reference.start(direct, view).advance();
  EXPECT_EQ(reply.lower()[0], lower) << "slices do not change the bits";
  EXPECT_EQ(reply.upper()[0], upper);
}

TEST_F(WorkerSlices, WhatManyPairsLeaveToJointsIsFoundInThem) {
  engine::Scene scene = spread_points();
  scene.add_robot("arm", {.urdf = source_file("tests/engine/robot/arm.urdf"), .home = {{{"joint4", -1.5}}}});
  start(std::move(scene), short_slices());
  TestQuery query;
  query.header.reduce = static_cast<std::uint8_t>(Reduce::kAny);
  query.header.fields = kFieldFreeScale;
  query.joints = {0, 1, 2, 3};
  query.weights = {1, 1, 1, 1};
  for (int k = 0; k < 24; ++k) query.positions.push_back(-0.3 - 0.05 * k);
  const Result reply = result_of(request_in_slices(query.frame(1)));
  EXPECT_GT(turns_, 100);
  EXPECT_GT(reply.pairs(), 20000u);

  QueryView view;
  view.joints = query.joints;
  view.positions = query.positions;
  view.configuration_count = 6;
  const std::vector<double> expected = engine_->free_scale(view, query.weights);
  ASSERT_EQ(reply.rows(), 6u);
  EXPECT_TRUE(std::equal(expected.begin(), expected.end(), reply.free_scale().begin()));
}

}  // namespace
}  // namespace clearance
