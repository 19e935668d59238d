// A sphere has one ball, without children: the balls of the other body are divided alone.
#include <gtest/gtest.h>

#include <vector>

#include "engine/pose/pose.h"
#include "tests/engine/crowded_arm.h"

namespace clearance::test {
namespace {

TEST(MovedSpheres, AreDecidedByTheSmallestBallsOfOthers) {
  constexpr std::uint32_t kStates = 200;
  engine::Scene scene;
  scene.add_box("box", {0.3, 0.2, 0.1}, {});
  scene.add_sphere("sphere", 0.05, {});
  const engine::Engine engine(std::move(scene), {.backend = "cpu", .threads = 1});
  ASSERT_TRUE(engine.wait_covers(kCoversPatience));
  const std::vector<std::uint32_t> bodies = {engine.scene().find_body("box"), engine.scene().find_body("sphere")};
  // The first half is 8 to 20 mm above a face, the rest 8 to 20 mm deep.
  Random random(4);
  std::vector<Pose> poses;
  for (std::uint32_t k = 0; k < kStates; ++k) {
    const Pose box = random.pose(0.5);
    const double gap = (k < kStates / 2 ? 1 : -1) * random.uniform(0.008, 0.02);
    poses.push_back(box);
    poses.push_back(compose(box, Pose{{random.uniform(-0.1, 0.1), random.uniform(-0.05, 0.05), 0.1 + gap}}));
  }
  QueryView query;
  query.bodies = bodies;
  query.configurations = poses;
  query.configuration_count = kStates;
  query.reduce = Reduce::kAny;
  query.fields = kFieldVerdict;
  const Answer answer = evaluate(engine, query);
  EXPECT_EQ(answer.info.pairs_evaluated, 0u) << "covers decide all";
  for (std::uint32_t k = 0; k < kStates; ++k)
    EXPECT_EQ(answer.view.verdict[k] == static_cast<std::uint8_t>(Status::kBeyond), k < kStates / 2) << k;
}

}  // namespace
}  // namespace clearance::test
