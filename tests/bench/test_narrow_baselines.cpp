// The report's methods for distances compared with the exact oracle, on the case classes for which they are made, and
// cases that they are known to get wrong.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "bench/report/narrow.h"
#include "bench/report/triangles.h"
#include "engine/engine.h"
#include "tests/oracle/cases/cases.h"
#include "tests/source_file.h"

namespace clearance::baselines {
namespace {

using exact::Case;
using exact::CaseClass;

constexpr double kRight = 1e-10;  // relative to S, the bodies' sizes and separation
const std::vector<std::string> kWellConditioned = {
    "ordinary",          "size_nano",        "size_giga",           "gap_tiny",
    "gap_far",           "shape_duplicated", "shape_many_coplanar", "shape_dense_spheres",
    "relation_parallel", "relation_deep",    "relation_concentric", "input_quaternions"};

const CaseClass& class_of(const std::string& name) {
  const auto& all = exact::case_classes();
  const auto found = std::find_if(all.begin(), all.end(), [&](const CaseClass& c) { return c.name == name; });
  if (found == all.end()) throw std::invalid_argument("no class " + name);
  return *found;
}

// Nothing for a body without triangles (a flat one).
std::optional<World> world_of(const Case& c) {
  engine::Scene scene;
  scene.add_hull("a", c.a->vertices, {.pose = c.X_wa});
  scene.add_hull("b", c.b->vertices, {.pose = c.X_wb});
  try {
    return World(scene);
  } catch (const std::invalid_argument&) {
    return std::nullopt;
  }
}

PairAnswer evaluate(NarrowBaseline& baseline, const World& world) {
  const BodyPair pair{0, 1};
  PairAnswer answer;
  baseline.distances(world, {&pair, 1}, {&answer, 1});
  return answer;
}

/// A baseline, or null if it needs a GPU and there is none.
std::unique_ptr<NarrowBaseline> made(const std::string& name, NarrowOptions options = {}) {
  try {
    return make_narrow(name, options);
  } catch (const std::runtime_error& e) {
    if (name.starts_with("cuda_") && std::string(e.what()).starts_with("CUDA: no device")) return nullptr;
    throw;
  }
}

bool knows_no_neighbours(const World& world) {
  for (std::uint32_t b = 0; b < world.size(); ++b) {
    const Connections& c = *world.mesh(b).connections;
    for (std::size_t v = 0; v + 1 < c.neighbours_begin.size(); ++v)
      if (c.neighbours_begin[v] == c.neighbours_begin[v + 1]) return true;
  }
  return false;
}

// Checks that a world point is in a body, up to rounding.
void expect_inside(const Vec3d& point, const exact::SolidPtr& solid, const Pose& X, double tolerance,
                   const std::string& where) {
  const std::vector<Vec3d> one{point};
  EXPECT_LE(exact::exact_distance({one}, Pose{}, exact::view(*solid), X, false).distance.lower(), tolerance) << where;
}

class NarrowBaselines : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    baseline_ = made(GetParam(), {.threads = 3});
    if (!baseline_) GTEST_SKIP() << "no GPU on this machine";
  }
  std::unique_ptr<NarrowBaseline> baseline_;
};

TEST_P(NarrowBaselines, AreRightOnWellConditionedClasses) {
  const bool naive = GetParam().starts_with("naive"), hill = GetParam() == "gjk_hill";
  int apart = 0, overlapping = 0;
  for (const std::string& name : kWellConditioned) {
    if (naive && name == "shape_dense_spheres") continue;  // 10^9 pairs of faces
    const CaseClass& cls = class_of(name);
    for (int i = 0; i < 60 / cls.cost; ++i) {
      const Case c = exact::make_case(cls, 1, static_cast<std::uint64_t>(i));
      const std::optional<World> world = world_of(c);
      ASSERT_TRUE(world) << name;
      if (hill && knows_no_neighbours(*world)) continue;  // see HillClimbing below
      const std::string where = name + " case " + std::to_string(i);
      const exact::Result exact_value = exact::exact_answer(c, true);
      const double distance = exact_value.distance.lower(), tolerance = kRight * exact::scale_of(c);
      const PairAnswer answer = evaluate(*baseline_, *world);
      EXPECT_FALSE(answer.limit) << where;
      EXPECT_NEAR(answer.distance, std::max(0.0, distance), tolerance) << where;
      if (std::abs(distance) > tolerance) {
        EXPECT_EQ(answer.overlap != 0, distance < 0) << where;
      }
      if (distance > tolerance) {
        EXPECT_NEAR(norm(answer.point_b - answer.point_a), distance, tolerance) << where;
        expect_inside(answer.point_a, c.a, c.X_wa, tolerance, where);
        expect_inside(answer.point_b, c.b, c.X_wb, tolerance, where);
      }
      apart += distance > tolerance;
      overlapping += distance < -tolerance;
      if (HasFailure()) return;
    }
  }
  EXPECT_GT(apart, 150);
  EXPECT_GT(overlapping, 100);
}

// As scenes/random_*.
engine::Scene random_spheres(int count, double box) {
  PortableRandom random(1);
  engine::Scene scene;
  for (int i = 0; i < count; ++i)
    scene.add_uv_sphere("s" + std::to_string(i), 2, 5, {.pose = random.pose({box, box, box})});
  return scene;
}

// Many pairs at once, enough for OpenMP to distribute and a GPU to batch.
TEST_P(NarrowBaselines, AnswerManyPairsAsTheEngineDoes) {
  engine::Scene scene = random_spheres(10, 13);
  scene.add_box("box", {3, 2, 1}, {.pose = Pose{{1, 2, 3}, 0.9, 0.1, 0.3, 0.2}});
  scene.add_uv_sphere("small", 0.5, 4, {.pose = Pose{{1.2, 2, 3}, 1, 0, 0, 0}});  // inside the box
  const World world(scene);
  std::vector<BodyPair> pairs;
  for (std::uint32_t a = 0; a < world.size(); ++a)
    for (std::uint32_t b = a + 1; b < world.size(); ++b) pairs.push_back(a % 2 ? BodyPair{a, b} : BodyPair{b, a});
  std::vector<PairAnswer> answers(pairs.size());
  baseline_->distances(world, pairs, answers);

  const engine::Engine engine(std::move(scene), {"reference"});
  std::vector<double> lower(pairs.size()), upper(pairs.size());
  QueryView query;
  query.all_pairs = false;
  query.pairs = pairs;
  query.rel_tol = 0;
  query.fields = kFieldLower | kFieldUpper;
  ReplyView reply;
  reply.lower = lower.data(), reply.upper = upper.data();
  Job job = engine.start(query, reply);
  while (!job.advance()) {
  }
  int overlaps = 0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    EXPECT_GE(answers[i].distance, lower[i] - 1e-10) << i;
    EXPECT_LE(answers[i].distance, upper[i] + 1e-10) << i;
    EXPECT_EQ(answers[i].overlap != 0, upper[i] == 0) << i;
    overlaps += answers[i].overlap;
  }
  EXPECT_GE(overlaps, 1);
  EXPECT_LT(overlaps, 20);
}

// A float64 world coordinate of 1e9 m has a resolution of 1e-7 m: meshes in world coordinates lose digits that relative
// poses keep.
TEST_P(NarrowBaselines, LoseDigitsFarFromTheWorldsOrigin) {
  const CaseClass& cls = class_of("place_far_from_world");
  int wrong = 0;
  for (int i = 0; i < 60; ++i) {
    const Case c = exact::make_case(cls, 1, static_cast<std::uint64_t>(i));
    const std::optional<World> world = world_of(c);
    ASSERT_TRUE(world);
    const double distance = std::max(0.0, exact::exact_answer(c, false).distance.lower());
    const double error = std::abs(evaluate(*baseline_, *world).distance - distance);
    EXPECT_LE(error, 64 * 0x1p-53 * norm(c.X_wa.translation) + kRight * exact::scale_of(c)) << i;
    wrong += error > kRight * exact::scale_of(c);
  }
  EXPECT_GT(wrong, 5);
}

// So many vertices that gjk_omp scans them with all threads, and so many faces that all their pairs would be 4e9.
class NarrowBaselinesOfLargeMeshes : public NarrowBaselines {};

TEST_P(NarrowBaselinesOfLargeMeshes, AnswerOnePair) {
  engine::Scene scene;
  scene.add_uv_sphere("a", 1, 120, {});
  scene.add_uv_sphere("b", 1, 120, {.pose = Pose{{1.5, 1.5, 0.5}, 0.9, 0.1, 0.3, 0.2}});
  const World world(scene);
  PairAnswer expected = evaluate(*make_narrow("gjk"), world);
  EXPECT_NEAR(expected.distance, 0.18, 0.01);
  EXPECT_NEAR(evaluate(*baseline_, world).distance, expected.distance, 1e-12);
}

INSTANTIATE_TEST_SUITE_P(All, NarrowBaselines, testing::ValuesIn(narrow_names()),
                         [](const auto& p) { return p.param; });

std::vector<std::string> names_without_naive() {
  std::vector<std::string> names = narrow_names();
  std::erase_if(names, [](const std::string& name) { return name.starts_with("naive"); });
  return names;
}
INSTANTIATE_TEST_SUITE_P(All, NarrowBaselinesOfLargeMeshes, testing::ValuesIn(names_without_naive()),
                         [](const auto& p) { return p.param; });

TEST(NarrowByName, BadOptionsAndUnknownNamesAreRejected) {
  EXPECT_THROW(make_narrow("gjk_gpu"), std::invalid_argument);
  EXPECT_THROW(make_narrow("gjk_omp", {.threads = -1}), std::invalid_argument);
  for (const std::string& name : narrow_names())
    if (name.starts_with("cuda_")) {
      EXPECT_THROW(make_narrow(name, {.block_size = 0}), std::invalid_argument) << name;
      EXPECT_THROW(make_narrow(name, {.block_size = 1025}), std::invalid_argument) << name;
    }
}

// The second mesh of this scene has dents: the baselines and the engine use its hull.
TEST(Worlds, TakeTheHullOfAMesh) {
  const engine::Scene scene = engine::Scene::load(source_file("scenes/benchmark_lite/scene.yaml"));
  const World world(scene);
  for (std::uint32_t b = 0; b < world.size(); ++b)
    EXPECT_EQ(world.mesh(b).vertices.size(), scene.bodies()[b].parts[0]->vertices.size());
  EXPECT_EQ(world.mesh(0).connections->triangles.size(), 2400u);
  EXPECT_LT(world.mesh(1).vertices.size(), scene.bodies()[1].display->vertices.size());
  const double by_scan = evaluate(*make_narrow("gjk"), world).distance;
  EXPECT_NEAR(evaluate(*make_narrow("gjk_hill"), world).distance, by_scan, 1e-12);
  EXPECT_NEAR(evaluate(*make_narrow("naive_omp"), world).distance, by_scan, 1e-12);
}

TEST(Worlds, RejectWhatTheReportDoesNotKnow) {
  engine::Scene round, many;
  round.add_sphere("ball", 1, {});
  EXPECT_THROW(World{round}, std::invalid_argument);
  Body body;
  body.name = "two";
  body.parts = {make_convex_part({{0, 0, 0}}), make_convex_part({{1, 0, 0}})};
  many.add_body(body);
  EXPECT_THROW(World{many}, std::invalid_argument);
}

// A block of any size gives the same bits as one thread on the CPU.
TEST(CudaBlocks, OfAnySizeGiveTheBitsOfTheCpu) {
  if (std::find(narrow_names().begin(), narrow_names().end(), "cuda_batched") == narrow_names().end() ||
      !made("cuda_batched"))
    GTEST_SKIP() << "no CUDA in this build, or no GPU on this machine";
  const World world(random_spheres(100, 28));
  std::vector<BodyPair> pairs;
  for (std::uint32_t a = 0; a < world.size(); ++a)
    for (std::uint32_t b = a + 1; b < world.size(); b += 3) pairs.push_back({a, b});
  std::vector<PairAnswer> expected(pairs.size()), answers(pairs.size());
  make_narrow("gjk")->distances(world, pairs, expected);
  for (const int block_size : {1, 7, 25, 31, 32, 33, 64, 100, 1000, 1024})
    for (const std::string& name : narrow_names()) {
      if (!name.starts_with("cuda_")) continue;
      make_narrow(name, {.block_size = block_size})->distances(world, pairs, answers);
      for (std::size_t i = 0; i < pairs.size(); ++i) {
        ASSERT_EQ(answers[i].distance, expected[i].distance) << name << " block " << block_size << " pair " << i;
        ASSERT_EQ(answers[i].iterations, expected[i].iterations) << name << " block " << block_size << " pair " << i;
        ASSERT_EQ(answers[i].point_a.x, expected[i].point_a.x) << name << " block " << block_size << " pair " << i;
      }
    }
}

// ---- known failures

// Algorithm 1 alone considers surfaces only: for a body inside another it returns the distance of the surfaces.
TEST(KnownFailures, SurfacesDoNotSeeABodyInsideAnother) {
  engine::Scene scene;
  scene.add_box("large", {2, 2, 2}, {});
  scene.add_box("small", {1, 1, 1}, {});
  const World world(scene);
  const PairAnswer surfaces = least_triangle_distance(world.mesh(0), world.mesh(1));
  EXPECT_EQ(surfaces.overlap, 0);
  EXPECT_DOUBLE_EQ(surfaces.distance, 0.5);
  EXPECT_EQ(evaluate(*make_narrow("naive"), world).overlap, 1);
}

// Section 2.2.1 takes the minimum over pairs of edges alone: a vertex over the middle of a face is nearer than any
// edge.
TEST(KnownFailures, EdgesAloneMissAVertexOverAFace) {
  const PreparedTriangle floor({-3, -3, 0}, {3, -3, 0}, {0, 3, 0}), above({0, 0, 0.5}, {0.1, 0, 2}, {0, 0.1, 2});
  double edges = 1e9;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      edges = std::min(
          edges, nearest_on_segments(floor.corner[i], floor.edge[i], above.corner[j], above.edge[j]).squared_distance);
  NearestPoints best{1e9, {}, {}};
  EXPECT_FALSE(take_triangle_pair(floor, above, best));
  EXPECT_DOUBLE_EQ(best.squared_distance, 0.25);
  EXPECT_GT(edges, 1.0);
}

// A vertex without faces has no neighbours: hill climbing that starts there stops there.
TEST(KnownFailures, HillClimbingNeedsEveryVertexToHaveNeighbours) {
  const CaseClass& cls = class_of("shape_duplicated");
  const auto hill = make_narrow("gjk_hill"), by_scan = make_narrow("gjk");
  int wrong = 0;
  for (int i = 0; i < 300; ++i) {
    const std::optional<World> world = world_of(exact::make_case(cls, 1, static_cast<std::uint64_t>(i)));
    ASSERT_TRUE(world);
    if (std::abs(evaluate(*hill, *world).distance - evaluate(*by_scan, *world).distance) < 1e-6) continue;
    ++wrong;
    EXPECT_TRUE(knows_no_neighbours(*world)) << i;
  }
  EXPECT_GT(wrong, 3);
}

// Signs of barycentric coordinates select wrong features of slivers, which result from bodies of very different sizes.
TEST(KnownFailures, SignsPickWrongFeaturesOfSlivers) {
  const CaseClass& cls = class_of("size_ratio");
  const auto gjk = make_narrow("gjk");
  int wrong = 0;
  for (int i = 0; i < 300; ++i) {
    const Case c = exact::make_case(cls, 1, static_cast<std::uint64_t>(i));
    const std::optional<World> world = world_of(c);
    ASSERT_TRUE(world);
    const double distance = exact::exact_answer(c, false).distance.lower();
    wrong += std::abs(evaluate(*gjk, *world).distance - std::max(0.0, distance)) >
             1e-6 * distance + 1e-12 * exact::scale_of(c);
  }
  EXPECT_GE(wrong, 2);
}

// Figure 3 taken literally drops all vertices with negative coordinates at once. Obtuse simplices then lose the vertex
// that carries the nearest point, v gets no nearer, and the iteration ends too early.
TEST(KnownFailures, FigureThreeIsWrongWhereSimplicesAreObtuse) {
  const CaseClass& cls = class_of("ordinary");
  const auto drawn = make_narrow("gjk", {.reduction = Reduction::kFigure3});
  int wrong = 0, missed = 0;
  for (int i = 0; i < 300; ++i) {
    const Case c = exact::make_case(cls, 1, static_cast<std::uint64_t>(i));
    const std::optional<World> world = world_of(c);
    ASSERT_TRUE(world);
    const double distance = exact::exact_answer(c, true).distance.lower();
    const PairAnswer answer = evaluate(*drawn, *world);
    wrong += std::abs(answer.distance - std::max(0.0, distance)) > 1e-3;
    missed += distance < 0 && !answer.overlap;
  }
  EXPECT_GT(wrong, 20);
  EXPECT_GT(missed, 0);
}

// Algorithm 2 as printed returns once a support vertex is not past the origin: the bodies are apart then, but v is not
// the distance yet.
TEST(KnownFailures, AlgorithmTwoAsPrintedStopsBeforeTheDistanceIsKnown) {
  const CaseClass& cls = class_of("ordinary");
  int apart = 0, early = 0;
  for (int i = 0; i < 200; ++i) {
    const Case c = exact::make_case(cls, 1, static_cast<std::uint64_t>(i));
    const std::optional<World> world = world_of(c);
    ASSERT_TRUE(world);
    const double distance = exact::exact_answer(c, false).distance.lower();
    if (!(distance > 1e-6)) continue;
    const std::span<const Vec3d> a = world->mesh(0).vertices, b = world->mesh(1).vertices;
    const auto farthest = [](std::span<const Vec3d> v, const Vec3d& d) {
      return scan(OneThread{}, v.data(), static_cast<std::uint32_t>(v.size()), d);
    };
    SignGjk s;
    s.begin(a[0] - b[0]);
    double at_stop = 0;
    for (bool stopped = false; !stopped && !s.done;) {
      const std::uint32_t p = farthest(a, -s.v), q = farthest(b, s.v);
      s.next = {a[p] - b[q], p, q};
      stopped = dot(s.next.w, s.v) >= 0;  // their d is -v
      s.take();
      if (s.done) break;
      for (int term = 0; term < Terms::kCount; ++term) s.terms.compute(s.p, s.size, term);
      s.reduce(Reduction::kRegions);
      at_stop = std::sqrt(s.vv);
    }
    ++apart;
    early += at_stop > 1.01 * distance;
  }
  EXPECT_GT(apart, 40);
  EXPECT_GT(early, apart / 4);
}

}  // namespace
}  // namespace clearance::baselines
