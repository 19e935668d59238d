// Hulls in device memory: a changed scene adds its new hulls to those that a device holds.
#include <gtest/gtest.h>

#include <vector>

#include "engine/device/hull_arrays.h"
#include "tests/engine/engine_test_util.h"

namespace clearance::test {
namespace {

constexpr std::uint32_t kMostShared = 96 * 1024;

/// Device memory as it is after several scenes: their arrays, one after another.
struct Held {
  cuda::HeldHulls hulls;
  std::vector<double> x, z;
  std::vector<float> f32;
  std::vector<std::uint16_t> words;

  void take(const cuda::HullArrays& arrays) {
    x.insert(x.end(), arrays.x.begin(), arrays.x.end());
    z.insert(z.end(), arrays.z.begin(), arrays.z.end());
    f32.insert(f32.end(), arrays.f32.begin(), arrays.f32.end());
    words.insert(words.end(), arrays.words.begin(), arrays.words.end());
    hulls = arrays.held();
  }
};

Body body_of(const std::string& name, std::vector<ConvexPartPtr> parts) {
  Body body;
  body.name = name;
  body.parts = std::move(parts);
  return body;
}

engine::Scene scene_of(const std::vector<Body>& bodies) {
  engine::Scene scene;
  for (Body body : bodies) scene.add_body(std::move(body));
  return scene;
}

/// Expects each hull of the arrays as it is without a scene before.
void expect_the_hulls_of(const engine::Scene& scene, const cuda::HullArrays& arrays, const Held& held) {
  const cuda::HullArrays fresh(scene, kMostShared);
  ASSERT_EQ(arrays.part_begin, fresh.part_begin);
  ASSERT_EQ(held.hulls.vertices, held.x.size());
  ASSERT_EQ(held.hulls.words, held.words.size());
  for (std::size_t b = 0; b < fresh.of_body.size(); ++b)
    EXPECT_EQ(arrays.of_body[b] >= cuda::kSeveral, fresh.of_body[b] >= cuda::kSeveral) << b;
  for (std::size_t p = 0; p < fresh.part_hull.size(); ++p) {
    const cuda::HullHead &now = arrays.heads[arrays.part_hull[p]], &expected = fresh.heads[fresh.part_hull[p]];
    ASSERT_EQ(now.count, expected.count);
    ASSERT_EQ(now.words, expected.words);
    EXPECT_EQ(now.rho, expected.rho);
    for (std::uint32_t i = 0; i < now.count; ++i) {
      EXPECT_EQ(held.x[now.first + i], fresh.x[expected.first + i]);
      EXPECT_EQ(held.z[now.first + i], fresh.z[expected.first + i]);
      EXPECT_EQ(held.f32[4 * (now.first + i) + 1], fresh.f32[4 * (expected.first + i) + 1]);
    }
    for (std::uint32_t w = 0; w < now.words; ++w)
      EXPECT_EQ(held.words[now.first_word + w], fresh.words[expected.first_word + w]);
  }
}

TEST(HullArrays, OfAChangedSceneHoldWhatIsNew) {
  Random random(3);
  const auto part = [&](int vertices) { return make_convex_part(random.cloud(vertices, {0.5, 0.4, 0.3})); };
  std::vector<Body> bodies{body_of("a", {part(200)}), body_of("b", {part(30), part(60)}), body_of("c", {part(8)})};
  Held held;
  held.take(cuda::HullArrays(scene_of(bodies), kMostShared));
  const std::size_t first = held.x.size();
  EXPECT_GT(held.words.size(), 0u);

  bodies.push_back(body_of("d", {part(100), bodies[0].parts[0]}));
  const std::size_t new_vertices = bodies.back().parts[0]->vertices.size();
  engine::Scene scene = scene_of(bodies);
  ASSERT_TRUE(held.hulls.suits(scene));
  const cuda::HullArrays added(scene, kMostShared, held.hulls);
  EXPECT_EQ(added.x.size(), new_vertices) << "the shared part is there already";
  held.take(added);
  EXPECT_EQ(held.x.size(), first + new_vertices);
  expect_the_hulls_of(scene, added, held);

  bodies.erase(bodies.begin() + 1);
  scene = scene_of(bodies);
  ASSERT_TRUE(held.hulls.suits(scene));
  const cuda::HullArrays removed(scene, kMostShared, held.hulls);
  EXPECT_TRUE(removed.x.empty());
  EXPECT_TRUE(removed.words.empty());
  held.take(removed);
  expect_the_hulls_of(scene, removed, held);
}

TEST(HullArrays, OfRemovedBodiesDoNotAccumulate) {
  Random random(4);
  const auto part = [&] { return make_convex_part(random.cloud(50, {0.5, 0.4, 0.3})); };
  std::vector<Body> bodies{body_of("kept", {part()}), body_of("a", {part()})};
  const cuda::HeldHulls held = cuda::HullArrays(scene_of(bodies), kMostShared).held();
  bodies[1].parts = {part()};
  EXPECT_TRUE(held.suits(scene_of(bodies)) || bodies[0].parts[0]->vertices.size() < held.vertices / 2);
  bodies[0].parts = {part()};
  EXPECT_FALSE(held.suits(scene_of(bodies)));
}

}  // namespace
}  // namespace clearance::test
