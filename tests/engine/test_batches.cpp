// The bits of an answer do not depend on what else is asked: pairs fill lanes with whatever hulls there are, bodies of
// several pieces search in rounds, and each gets what it would get alone.
#include <gtest/gtest.h>

#include <limits>
#include <memory>

#include "engine/narrow/lanes.h"
#include "engine_test_util.h"
#include "same_rows.h"

namespace clearance::test {
namespace {

// Bodies of one to five pieces, of 1 to 150 vertices, some of them rounded; the first two share their pieces.
Scene pieces_scene(Random& random, int count) {
  Scene scene;
  std::vector<PiecePtr> shared;
  for (int i = 0; i < count; ++i) {
    Body body;
    body.name = "body" + std::to_string(i);
    const int pieces = i % 3 == 0 ? 1 : 1 + static_cast<int>(random.below(5));
    for (int p = 0; p < pieces; ++p) {
      const int sizes[] = {1, 2, 8, 30, 64, 150};
      std::vector<Vec3d> cloud = random.cloud(sizes[random.below(6)], {0.2, 0.2, 0.2});
      for (Vec3d& v : cloud) v += Vec3d{0.7 * p, random.uniform(-0.3, 0.3), 0};
      body.pieces.push_back(make_piece(std::move(cloud), random.below(3) == 0 ? 0.05 : 0));
    }
    if (i == 0) shared = body.pieces;
    if (i == 1) body.pieces = shared;
    scene.add_body(std::move(body));
  }
  return scene;
}

TEST(Batches, GiveEachPairTheBitsThatItHasAlone) {
  constexpr std::uint32_t kBodies = 12, kConfigurations = 9;
  Random random(3);
  std::vector<std::uint32_t> moved;
  std::vector<Pose> poses;
  for (std::uint32_t b = 0; b < kBodies; ++b) moved.push_back(b);
  for (std::uint32_t i = 0; i < kBodies * kConfigurations; ++i) poses.push_back(random.pose(2.5));
  std::array<std::uint64_t, 8> seen{};
  for (const LaneKernel& kernel : lane_kernels()) {
    Random same(4);
    Engine::Options options;
    options.instruction_set = kernel.name;
    const Engine engine(pieces_scene(same, kBodies), options);
    for (const Precision precision : {Precision::kF64, Precision::kF32})
      for (const bool signed_distance : {false, true})
        for (const double max_distance : {1.0, std::numeric_limits<double>::infinity()}) {
          QueryView query;
          query.precision = precision;
          query.signed_distance = signed_distance;
          query.max_distance = max_distance;
          query.fields = kAllFields;
          query.bodies = moved;
          query.configuration_count = kConfigurations;
          query.configurations = poses;
          const Answer all = ask(engine, query);
          const std::vector<BodyPair> pairs = engine.pairs({});
          ASSERT_EQ(all.size.rows, pairs.size() * kConfigurations);
          for (std::uint32_t k = 0; k < kConfigurations; ++k)
            for (std::size_t p = 0; p < pairs.size(); ++p) {
              QueryView one = query;
              one.all_pairs = false;
              one.pairs = std::span(&pairs[p], 1);
              one.configuration_count = 1;
              one.configurations = std::span(poses).subspan(k * kBodies, kBodies);
              const Answer alone = ask(engine, one);
              *alone.view.configuration = k;
              const auto seen_here = expect_same_rows(all, k * pairs.size() + p, alone, 1);
              for (std::size_t s = 0; s < seen.size(); ++s) seen[s] += seen_here[s];
              if (HasFatalFailure())
                FAIL() << kernel.name << ", f32 " << (precision == Precision::kF32) << ", signed " << signed_distance
                       << ", within " << max_distance << ", configuration " << k << ", pair " << pairs[p].a << ' '
                       << pairs[p].b;
            }
        }
  }
  for (const Status status : {Status::kOk, Status::kOverlap, Status::kBeyond})
    EXPECT_GT(seen[static_cast<std::size_t>(status)], 20u) << "status " << int(status) << " was not met";
}

// A small query that has not begun, and what it gets alone.
struct Small {
  std::vector<BodyPair> pairs;
  std::vector<std::uint32_t> bodies;
  std::vector<Pose> configurations;
  QueryView query;
  Answer room, alone;
  std::unique_ptr<Job> job;
};

// Draws what small queries ask out of a few settings, so that many ask the same of their pairs and many do not.
std::unique_ptr<Small> draw_small(const Engine& engine, Random& random, std::uint32_t body_count) {
  auto small = std::make_unique<Small>();
  QueryView& q = small->query;
  q.all_pairs = random.below(12) == 0;
  for (std::uint64_t i = random.below(9); i > 0; --i) {
    const auto a = static_cast<std::uint32_t>(random.below(body_count + 1));  // one id that is none
    small->pairs.push_back({a, static_cast<std::uint32_t>((a + 1 + random.below(body_count - 1)) % body_count)});
    if (small->pairs.back().a == small->pairs.back().b) small->pairs.pop_back();
  }
  q.pairs = small->pairs;
  if (random.below(3) == 0) {
    small->bodies = {static_cast<std::uint32_t>(random.below(body_count))};
    q.configuration_count = 1 + static_cast<std::uint32_t>(random.below(4));
    for (std::uint32_t k = 0; k < q.configuration_count; ++k) small->configurations.push_back(random.pose(2));
    if (random.below(4) == 0) small->configurations[0].qw = std::numeric_limits<double>::quiet_NaN();
  }
  q.bodies = small->bodies;
  q.configurations = small->configurations;
  const std::uint64_t kind = random.below(6);
  if (kind == 1) q.precision = Precision::kF32;
  if (kind == 2) q.max_distance = 1;
  if (kind == 3) q.signed_distance = true;
  if (kind == 4) q.max_pose_age_ns = 1 + random.below(2) * std::int64_t{3'600'000'000'000}, q.fields |= kFieldFlags;
  if (random.below(2) == 0) q.fields = kAllFields;
  if (random.below(8) == 0) q.format = Format::kCompact;
  if (random.below(30) == 0) q.reduce = Reduce::kMin;
  small->alone = ask(engine, q);
  small->room = room_for(engine, q);
  small->job = std::make_unique<Job>(engine.start(q, small->room.view));
  return small;
}

TEST(Batches, OfQueriesOfSeveralClientsGiveEachTheBitsThatItHasAlone) {
  constexpr std::uint32_t kBodies = 12;
  std::array<std::uint64_t, 8> seen{};
  std::uint64_t together = 0, alone = 0, other_poses = 0;
  for (const LaneKernel& kernel : lane_kernels()) {
    Random random(21);
    Engine::Options options;
    options.instruction_set = kernel.name;
    Engine engine(pieces_scene(random, kBodies), options);
    for (int round = 0; round < 40; ++round) {
      std::vector<std::unique_ptr<Small>> waiting;
      for (int i = 0; i < 24; ++i) {
        if (i % 5 == 0) {  // a snapshot is as old as its query
          const BodyPose moved{static_cast<std::uint32_t>(random.below(kBodies)), random.pose(2)};
          engine.set_poses(std::span(&moved, 1), round);
        }
        waiting.push_back(draw_small(engine, random, kBodies));
      }
      while (!waiting.empty()) {
        std::vector<std::unique_ptr<Small>> batch;
        batch.push_back(std::move(waiting.front()));
        waiting.erase(waiting.begin());
        std::erase_if(waiting, [&](std::unique_ptr<Small>& small) {
          if (!small->job->joins(*batch[0]->job)) return false;
          batch.push_back(std::move(small));
          return true;
        });
        std::vector<Job*> jobs;
        for (const auto& small : batch) jobs.push_back(small->job.get());
        if (jobs.size() > 1) {
          Job::finish_together(jobs);
          together += jobs.size();
          other_poses += jobs[0]->info().snapshot_revision != jobs.back()->info().snapshot_revision;
        } else {
          while (!jobs[0]->advance()) {
          }
          ++alone;
        }
        for (const auto& small : batch) {
          const ReplyInfo &got = small->job->info(), &wanted = small->alone.info;
          EXPECT_EQ(got.rows, wanted.rows);
          EXPECT_EQ(got.total, wanted.total);
          EXPECT_EQ(got.snapshot_revision, wanted.snapshot_revision);
          EXPECT_EQ(got.pairs_evaluated, wanted.pairs_evaluated);
          const auto seen_here = expect_same_rows(small->room, 0, small->alone, wanted.rows);
          for (std::size_t s = 0; s < seen.size(); ++s) seen[s] += seen_here[s];
          if (HasFatalFailure()) FAIL() << kernel.name << ", round " << round << ", " << jobs.size() << " queries";
        }
      }
    }
  }
  const std::size_t versions = lane_kernels().size();
  EXPECT_GT(together, 500 * versions);
  EXPECT_GT(alone, 100 * versions) << "what asks something else stays alone";
  EXPECT_GT(other_poses, 50 * versions) << "batches of queries that began at different poses";
  for (const Status status :
       {Status::kOk, Status::kOverlap, Status::kBeyond, Status::kBadPose, Status::kNoPose, Status::kUnknownBody})
    EXPECT_GT(seen[static_cast<std::size_t>(status)], 20u) << "status " << int(status) << " was not met";
}

}  // namespace
}  // namespace clearance::test
