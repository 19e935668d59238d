// Snapshots made from older ones by copying only changes.
#include <gtest/gtest.h>

#include <cstring>
#include <deque>
#include <random>

#include "engine/state/pose_store.h"

namespace clearance {
namespace {

constexpr std::uint32_t kBodies = 200;

engine::Scene chain_and_crowd() {
  engine::Scene scene;
  for (std::uint32_t b = 0; b < kBodies; ++b) {
    engine::Scene::BodyOptions options;
    options.pose = Pose{{0.5 * b, 0, 0}};
    if (b > 0 && b < 5) options.parent = "b" + std::to_string(b - 1);
    scene.add_sphere("b" + std::to_string(b), 0.1, options);
  }
  return scene;
}

/// Checks that all bodies are placed according to their poses.
void expect_whole(const PoseSnapshot& snapshot) {
  PoseSnapshot anew = snapshot;
  anew.place_again(*anew.order);
  for (std::uint32_t b = 0; b < kBodies; ++b) {
    const PoseMatrix &as = snapshot.placed[b].pose, &should = anew.placed[b].pose;
    ASSERT_EQ(std::memcmp(&as.t_w, &should.t_w, sizeof as.t_w), 0) << "body " << b;
    ASSERT_EQ(std::memcmp(&as.R_wb, &should.R_wb, sizeof as.R_wb), 0) << "body " << b;
  }
}

TEST(PoseStore, ASmallUpdateOfALargeSceneCopiesLittleAndIsWhole) {
  const engine::Scene scene = chain_and_crowd();
  PoseStore store(scene, std::chrono::nanoseconds(0));
  std::mt19937 random(11);
  std::vector<Pose> poses;
  for (const Body& body : scene.bodies()) poses.push_back(*body.pose);
  std::deque<std::shared_ptr<const PoseSnapshot>> held;  // held as by jobs, some for long
  int in_part = 0, whole = 0;
  for (int round = 0; round < 3000; ++round) {
    if (random() % 100 == 0) {
      const std::uint32_t child = 6 + random() % 20;
      store.attach(child, random() % 2 ? kNone : 5, &poses[child], {});
    }
    const std::size_t count = random() % 50 == 0 ? 150 : 1 + random() % 4;
    std::vector<BodyPose> update;
    for (std::size_t i = 0; i < count; ++i) {
      const auto body = static_cast<std::uint32_t>(random() % kBodies);
      poses[body].translation = {1e-3 * round, static_cast<double>(body), static_cast<double>(i)};
      update.push_back({body, poses[body]});
    }
    const PoseUpdateResult result = store.set(update, 0, round + 1, 0);
    ++(result.copied_bytes < kBodies * sizeof(BodyPlacement) / 2 ? in_part : whole);
    const auto snapshot = store.snapshot();
    ASSERT_EQ(snapshot->revision, result.revision);
    ASSERT_EQ(std::memcmp(snapshot->local.data(), poses.data(), kBodies * sizeof(Pose)), 0) << "round " << round;
    expect_whole(*snapshot);
    if (random() % 3 == 0) held.push_back(snapshot);
    if (held.size() > 4) held.erase(held.begin() + static_cast<std::ptrdiff_t>(random() % held.size()));
  }
  EXPECT_GT(in_part, 1000);
  EXPECT_GT(whole, 100);
}

}  // namespace
}  // namespace clearance
