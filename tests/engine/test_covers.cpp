// Covers of an engine's bodies: which ones it makes, and that engines of a changed scene share them.
#include <gtest/gtest.h>

#include <cstdlib>

#include "engine/cover/cover_store.h"
#include "engine/editor/scene_editor.h"
#include "tests/engine/arm_scene.h"
#include "tests/engine/engine_test_util.h"

namespace clearance::test {
namespace {

constexpr std::chrono::minutes kPatience{10};

class CoversTest : public testing::Test {
 protected:
  void SetUp() override { ::setenv("CLEARANCE_CACHE", "off", 1); }
};

std::uint64_t counter(const engine::Engine& engine, const std::string& name) {
  for (const auto& [known, value] : engine.stats())
    if (known == name) return value;
  return ~std::uint64_t{0};
}

TEST_F(CoversTest, AreMadeForBodiesThatMayMove) {
  const engine::Engine engine(arm_scene(at_home()), {.backend = "cpu", .threads = 1});
  ASSERT_TRUE(engine.wait_covers(kPatience));
  std::set<const Cover*> covers;
  std::uint64_t bytes = 0;
  for (const Body& body : engine.scene().bodies()) {
    const auto cover = engine.cover_store()->find(body.parts);
    EXPECT_EQ(cover != nullptr, body.name != "table" && !body.parts.empty()) << body.name;
    if (cover && covers.insert(cover.get()).second) bytes += cover->resident_bytes();
  }
  EXPECT_GT(covers.size(), 2);
  EXPECT_EQ(counter(engine, "engine.covers"), covers.size());
  EXPECT_EQ(counter(engine, "engine.covers_pending"), 0);
  EXPECT_EQ(counter(engine, "engine.cover_bytes"), bytes);
}

}  // namespace
}  // namespace clearance::test
