// Decisions with pairs of bodies that both stay: the same rows as without covers, which decide the other pairs.
#include "tests/oracle/decision/ball_scene.h"
#include "tests/oracle/decision/pose_states.h"

namespace clearance::exact {
namespace {

constexpr double kGap = 0.006;  // of the wall and the shelf, metres

/// The cell with a wall next to a shelf, and a mesh.
Scene made_shelves() {
  Scene scene = made_cell();
  scene.add_box("wall", {0.1, 1, 1}, {.is_static = true, .pose = Pose{{4, 0, 0}, 0.8, 0, 0, 0.6}});
  const Vec3d offset = rotation_of(Pose{{0, 0, 0}, 0.8, 0, 0, 0.6}) * Vec3d{0.1 + kGap, 0, 0};
  scene.add_box("shelf", {0.1, 0.5, 0.5}, {.is_static = true, .pose = Pose{Vec3d{4, 0, 0} + offset, 0.8, 0, 0, 0.6}});
  const std::vector<Vec3d> corners{{0, 0, 0}, {0.3, 0, 0}, {0, 0.3, 0}, {0, 0, 0.3}};
  const std::vector<std::array<std::uint32_t, 3>> faces{{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  scene.add_mesh("wedge", corners, faces, MeshAs::kSolid, {.is_static = true, .pose = Pose{{3, 1, 0}}});
  return scene;
}

std::vector<BodyPair> pairs_of(const Scene& scene, std::initializer_list<std::pair<const char*, const char*>> names) {
  std::vector<BodyPair> pairs;
  for (const auto& [a, b] : names) pairs.push_back({scene.find_body(a), scene.find_body(b)});
  return pairs;
}

TEST(StillPairs, RowsHaveTheBitsThatTheyHaveWithout) {
  const Scene scene = made_shelves();
  const Engines engines(scene);
  Random random(1);
  PoseStates states(scene);
  for (const char* other : {"box", "stone"}) states.add(engines.without, 0, "rock", other, 0, 0.1, 150, random);
  Counts all{};
  for (const bool is_last : {false, true})
    for (const double margin : {0.0, 0.005, 0.02}) {
      std::vector<BodyPair> pairs =
          pairs_of(scene, {{"rock", "box"}, {"crate", "wall"}, {"rock", "stone"}, {"bar", "wedge"}, {"wedge", "wall"}});
      pairs.insert(is_last ? pairs.end() : pairs.begin(), pairs_of(scene, {{"shelf", "wall"}})[0]);
      QueryView query = states.of();
      query.all_pairs = false;
      query.pairs = pairs;
      query.margin = margin;
      const Counts counts = expect_same(engines, query);
      for (std::size_t s = 0; s < all.size(); ++s) all[s] += counts[s];
      EXPECT_EQ(counts[static_cast<std::size_t>(Status::kBeyond)] == 0, margin > kGap);
      query.reduce = Reduce::kAny;
      query.fields = kFieldVerdict;
      const std::uint64_t with = test::evaluate(engines.with, query).info.pairs_evaluated;
      if (margin < kGap) {
        EXPECT_LT(with, query.configuration_count / 2) << "covers decide the pairs that move";
      }
    }
  EXPECT_GT(all[static_cast<std::size_t>(Status::kBeyond)], 100u);
  EXPECT_GT(all[static_cast<std::size_t>(Status::kOverlap)], 50u);
  EXPECT_GT(all[static_cast<std::size_t>(Status::kOk)], 100u);
}

// In many states the pair that stays is the nearest.
TEST(StillPairs, DistancesHaveTheBitsThatTheyHaveWithout) {
  const Scene scene = made_shelves();
  const Engines engines(scene);
  Random random(3);
  PoseStates states(scene);
  for (const double margin : {0.003, 0.02}) states.add(engines.without, 0, "rock", "box", margin, 0.002, 100, random);
  const std::vector<BodyPair> pairs = pairs_of(
      scene,
      {{"rock", "box"}, {"crate", "wall"}, {"shelf", "wall"}, {"rock", "stone"}, {"bar", "wedge"}, {"wedge", "wall"}});
  QueryView query = states.of();
  query.all_pairs = false;
  query.pairs = pairs;
  query.fields = kDefaultFields | kFieldPair;
  for (const Reduce reduce : {Reduce::kMin, Reduce::kNearest}) {
    query.reduce = reduce;
    query.abs_tol = 0, query.rel_tol = 1e-6;
    const Answer exact = test::evaluate(engines.without, query), narrow = test::evaluate(engines.with, query);
    test::expect_same_rows(exact, 0, narrow, exact.size.rows);
    EXPECT_LT(narrow.info.pairs_evaluated, exact.info.pairs_evaluated + pairs.size());
    query.abs_tol = 0.01;
    const Answer wide = test::evaluate(engines.with, query);
    int still = 0, others = 0;
    for (std::uint64_t k = 0; k < exact.size.rows; ++k) {
      EXPECT_LE(wide.view.lower[k], exact.view.upper[k]) << k;
      EXPECT_GE(wide.view.upper[k], exact.view.lower[k]) << k;
      ++(exact.view.pair[k] == pairs[2] ? still : others);
    }
    EXPECT_GT(std::min(still, others), 30);
  }
}

TEST(StillPairs, MotionsHaveTheVerdictsThatTheyHaveWithout) {
  Random random(2);
  BallScene made({{{{{0, 0, 0}, 0.125}}}, {{{{0.25, 0, 0}, 0.0625}}, 0, turning({0, 0, 0.25}, {0, 0.25, 1})}});
  const std::uint32_t post = made.add_obstacle({{{0, 0, 0}, 0.125}}, Pose{{0.25 + kGap, 0, 0}}),
                      ball = made.add_obstacle({{{0, 0, 0}, 0.125}}, Pose{{0, 0.375, 0.25}});
  const Engines engines(made.scene());
  std::vector<double> positions;
  for (int k = 0; k < 100; ++k)
    for (const double by : {0.0, 0.3}) positions.push_back((k % 2 ? positions.back() : random.uniform(-3, 3)) + by);
  const BodyPair pairs[] = {{made.link(1), ball}, {made.link(0), post}};
  const std::uint32_t joints[] = {0};
  QueryView query;
  query.joints = joints;
  query.positions = positions;
  query.configuration_count = 200;
  query.max_evaluations = 100;
  query.all_pairs = false;
  query.pairs = pairs;
  query.reduce = Reduce::kAny;
  query.fields = kFieldVerdict;
  for (const double margin : {0.0, 0.02}) {
    query.margin = margin;
    const Answer without = test::evaluate(engines.without, query), with = test::evaluate(engines.with, query);
    int free = 0;
    for (int k = 0; k < 100; ++k) {
      EXPECT_EQ(without.view.verdict[k], with.view.verdict[k]) << k << ", margin " << margin;
      free += with.view.verdict[k] == static_cast<std::uint8_t>(Status::kBeyond);
    }
    EXPECT_EQ(free > 10, margin < kGap) << free;
    if (margin < kGap) {
      EXPECT_LT(4 * with.info.pairs_evaluated, without.info.pairs_evaluated);
    }
  }
}

}  // namespace
}  // namespace clearance::exact
