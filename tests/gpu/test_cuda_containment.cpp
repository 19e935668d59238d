// A million pairs on the device, all and reduced, in float64 and float32, each checked by the exact oracle. The
// same test runs a part of them on the CPU.
#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <numeric>
#include <thread>

#include "tests/engine/cuda/same_answer.h"
#include "tests/oracle/exact/exact_distance.h"

namespace clearance::test {
namespace {

constexpr std::uint32_t kBodies = 48, kBatch = 100;
constexpr double kInf = std::numeric_limits<double>::infinity();

engine::Scene bodies_of_all_kinds() {
  Random random(31);
  engine::Scene scene;
  for (std::uint32_t i = 0; i < kBodies; ++i) {
    const std::string name = "b" + std::to_string(i);
    switch (i % 6) {
      case 0:
        scene.add_box(name, {random.uniform(0.2, 1), random.uniform(0.2, 1), random.uniform(0.2, 1)}, {});
        break;
      case 1:
        scene.add_capsule(name, 0.2, 0.5, {});
        break;
      case 2:
        scene.add_uv_sphere(name, 0.4, 5, {});
        break;
      case 3:
        scene.add_hull(name, cloud_on_sphere(120, 0.5, i), {});
        break;
      case 4:
        scene.add_hull(name, random.cloud(20, {0.5, 0.5, 0.01}), {});
        break;
      default: {
        Body body;
        body.name = name;
        body.parts = {make_convex_part(random.cloud(6, {0.4, 0.4, 0.4}))};
        for (std::uint32_t p = 0; p < i / 6 % 4; ++p) {  // up to four convex parts
          std::vector<Vec3d> v = random.cloud(12, {0.2, 0.2, 0.2});
          const Vec3d at{random.uniform(-0.8, 0.8), random.uniform(-0.8, 0.8), 0};
          for (Vec3d& x : v) x += at;
          body.parts.push_back(make_convex_part(std::move(v), p == 1 ? 0.1 : 0.0));
        }
        scene.add_body(std::move(body));
      }
    }
  }
  return scene;
}

// Most poses are random within a box. Some place bodies axis-aligned at round coordinates, so that faces and edges
// touch exactly.
std::vector<Pose> poses_of(Random& random) {
  std::vector<Pose> poses;
  for (std::uint32_t k = 0; k < kBatch; ++k)
    for (std::uint32_t i = 0; i < kBodies; ++i) {
      Pose p = random.pose(k % 2 == 0 ? 2.5 : 1.2);
      if (k % 10 == 9) {
        p = {{std::round(4 * p.translation.x) / 4, std::round(4 * p.translation.y) / 4,
              std::round(4 * p.translation.z) / 4}};
        if (i % 2) p.qw = p.qx = 0.5, p.qy = p.qz = 0.5;
      }
      poses.push_back(p);
    }
  return poses;
}

/// The doubles on either side of a distance, which is 0 for overlapping bodies.
struct Exact {
  double below = 0, above = 0;
};

/// The exact distance of every pair in every configuration, in the order of a query's rows.
std::vector<Exact> exact_answer(const engine::Scene& scene, const std::vector<BodyPair>& pairs,
                                const std::vector<Pose>& poses) {
  std::vector<Exact> rows(kBatch * pairs.size());
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    for (std::size_t i; (i = next++) < rows.size();) {
      const BodyPair pair = pairs[i % pairs.size()];
      const Pose* X = poses.data() + i / pairs.size() * kBodies;
      const auto view = [](const ConvexPartPtr& part) { return exact::ConvexPartView{part->vertices, part->radius}; };
      rows[i] = {kInf, kInf};
      for (const ConvexPartPtr& a : scene.bodies()[pair.a].parts)
        for (const ConvexPartPtr& b : scene.bodies()[pair.b].parts) {
          const exact::Value d = exact::exact_distance(view(a), X[pair.a], view(b), X[pair.b], false).distance;
          const Exact one = d.compare(0) > 0 ? Exact{d.lower(), d.upper()} : Exact{};
          rows[i] = {std::min(rows[i].below, one.below), std::min(rows[i].above, one.above)};
        }
    }
  };
  std::vector<std::jthread> threads;
  for (unsigned t = 0; t < std::max(1u, std::thread::hardware_concurrency()); ++t) threads.emplace_back(work);
  threads.clear();  // waits for them
  return rows;
}

/// The least over all pairs, or over those of a body.
/// \param rows of one configuration
Exact least_of(const std::vector<BodyPair>& pairs, const Exact* rows, Reduce reduce, std::uint32_t body) {
  const Exact* least = nullptr;
  for (std::size_t p = 0; p < pairs.size(); ++p)
    if (reduce == Reduce::kMin || pairs[p].a == body || pairs[p].b == body)
      if (!least || rows[p].above < least->above) least = rows + p;
  return *least;
}

class ManyPairs : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    if (GetParam() == "cuda") SKIP_WITHOUT_DEVICE();
  }
  std::uint64_t wanted() const {
    const char* given = std::getenv("CLEARANCE_CONTAINMENT_PAIRS");
    return given ? std::strtoull(given, nullptr, 10) : GetParam() == "cuda" ? 1'000'000 : 100'000;
  }
};

TEST_P(ManyPairs, HaveTheirExactDistanceInTheInterval) {
  engine::Engine engine(bodies_of_all_kinds(), {GetParam()});
  std::vector<std::uint32_t> bodies(kBodies);
  std::iota(bodies.begin(), bodies.end(), 0u);
  Random random(32);
  QueryView q;
  q.bodies = bodies;
  q.configuration_count = kBatch;
  q.fields = kDefaultFields;
  std::uint64_t pairs = 0, apart = 0, near = 0, overlapping = 0, outside = 0;
  while (pairs < wanted()) {
    const std::vector<Pose> poses = poses_of(random);
    q.configurations = poses;
    q.reduce = Reduce::kNone;
    const std::vector<BodyPair> requested = engine.pairs(q);
    const std::vector<Exact> exact = exact_answer(engine.scene(), requested, poses);
    for (const Exact& one : exact) {
      overlapping += !(one.above > 0);
      apart += one.above > 0;
      near += one.above > 0 && one.above < 1e-2;
    }
    pairs += exact.size();

    const auto hold = [&](const Exact& one, double lower, double upper, const std::string& what) {
      if (lower <= one.below && one.above <= upper) return;
      if (++outside <= 5)
        ADD_FAILURE() << what << ": [" << lower << ", " << upper << "] does not hold the exact distance, which is in ["
                      << one.below << ", " << one.above << ']';
    };
    for (const Precision precision : {Precision::kF64, Precision::kF32}) {
      const std::string name = precision == Precision::kF64 ? "f64 " : "f32 ";
      q.precision = precision;
      q.reduce = Reduce::kNone;
      const Answer answer = evaluate(engine, q);
      ASSERT_EQ(answer.info.backend, GetParam());
      ASSERT_EQ(answer.size.rows, exact.size());
      for (std::uint64_t i = 0; i < exact.size(); ++i) hold(exact[i], answer.view.lower[i], answer.view.upper[i], name);
      const std::size_t P = exact.size() / kBatch;
      for (const Reduce reduce : {Reduce::kMin, Reduce::kNearest}) {
        q.reduce = reduce;
        const Answer least = evaluate(engine, q);
        ASSERT_EQ(least.info.backend, GetParam());
        const std::size_t groups = reduce == Reduce::kMin ? 1 : kBodies;
        ASSERT_EQ(least.size.rows, kBatch * groups);
        for (std::size_t row = 0; row < least.size.rows; ++row) {
          const Exact of_group =
              least_of(requested, &exact[row / groups * P], reduce, static_cast<std::uint32_t>(row % groups));
          hold(of_group, least.view.lower[row], least.view.upper[row], name + "least");
        }
      }
    }
    // At the bodies' current poses.
    q.precision = Precision::kF64;
    for (std::uint32_t k = 0; k < kBatch; k += 7) {
      std::vector<BodyPose> stand;
      for (std::uint32_t b = 0; b < kBodies; ++b) stand.push_back({b, poses[k * kBodies + b]});
      engine.set_poses(stand);
      QueryView here;
      here.reduce = Reduce::kNearest;
      const Answer nearest = evaluate(engine, here);
      for (std::uint32_t b = 0; b < kBodies; ++b)
        hold(least_of(requested, &exact[k * requested.size()], Reduce::kNearest, b), nearest.view.lower[b],
             nearest.view.upper[b], "at the current poses");
    }
  }
  EXPECT_EQ(outside, 0u);
  EXPECT_GT(apart, pairs / 4);
  EXPECT_GT(overlapping, pairs / 50);
  EXPECT_GT(near, pairs / 1000);
  std::printf("%s: %zu pairs: %zu apart, %zu of them by less than 0.01, %zu overlapping\n", GetParam().c_str(),
              std::size_t{pairs}, std::size_t{apart}, std::size_t{near}, std::size_t{overlapping});
}

INSTANTIATE_TEST_SUITE_P(Backends, ManyPairs, testing::Values("cpu", "cuda"), [](const auto& p) { return p.param; });

}  // namespace
}  // namespace clearance::test
