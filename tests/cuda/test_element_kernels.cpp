// The kernel that looks at clouds (engine/cuda/element_kernel.cuh), without a GPU: its code compiled for the host, its
// intervals held against the CPU's and against the distances of all points.
#include "engine/narrow/certify.h"
// Behind all that is included elsewhere.
#include "emulated_reduction.h"

namespace clearance::test {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

enum class Kind { kPoints, kGrown, kVoxels };

// Some convex bodies that move, one of them of two pieces, before a cloud that stays and a box.
struct Case {
  Case(Kind kind, std::size_t points, double room, std::uint32_t configurations, std::uint64_t seed, bool cloud_first) {
    Random random(seed);
    std::vector<CloudPoint> cloud;
    for (std::size_t i = 0; i < points; ++i) {  // a sheet with waves, a heap, and some far away
      const double u = random.uniform(-1, 1), v = random.uniform(-1, 1);
      const Vec3d p = i % 10 == 9  ? Vec3d{random.uniform(-3, 3), random.uniform(-3, 3), random.uniform(-3, 3)}
                      : i % 3 == 0 ? Vec3d{0.3 * u, 0.3 * v, 0.4 + 0.2 * random.uniform(-1, 1)}
                                   : Vec3d{u, v, 0.2 * std::sin(4 * u) * std::cos(3 * v)};
      cloud.push_back({static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z)});
    }
    const auto add_cloud = [&] {
      Scene::BodyOptions options{.is_static = true, .pose = random.pose(0.2)};
      if (kind == Kind::kGrown) options.radius = 0.03;
      scene.add_points("cloud", cloud, kind == Kind::kVoxels ? 0.05 : 0, options);
    };
    if (cloud_first) add_cloud();
    scene.add_hull("hull", cloud_on_sphere(60, 0.3, 4), {});
    scene.add_box("box", {0.3, 0.5, 0.1}, {});
    scene.add_capsule("capsule", 0.1, 0.4, {});
    Body two;
    two.name = "two";
    two.pieces = {make_piece({{0, 0, 0}, {0.2, 0, 0}, {0, 0.2, 0}, {0, 0, 0.2}}),
                  make_piece({{0.3, 0, 0}, {0.5, 0, 0}, {0.4, 0.2, 0}, {0.4, 0, 0.3}, {0.45, 0.3, 0.3}}, 0.02)};
    scene.add_body(std::move(two));
    if (!cloud_first) add_cloud();
    scene.add_box("wall", {0.1, 2, 2}, {.is_static = true, .pose = Pose{{1.5, 0, 0}}});
    const std::uint32_t first = cloud_first ? 1 : 0, cloud_at = cloud_first ? 0 : 4;
    for (std::uint32_t b = first; b < first + 4; ++b) {
      bodies.push_back(b);
      pairs.push_back(b % 2 ? BodyPair{cloud_at, b} : BodyPair{b, cloud_at});
      pairs.push_back({b, 5});
    }
    for (std::size_t i = 0; i < configurations * bodies.size(); ++i) poses.push_back(random.pose(room));
    q.all_pairs = false;
    q.fields = kAllFields;
    q.configuration_count = configurations;
    q.pairs = pairs;
    q.bodies = bodies;
    q.configurations = poses;
  }

  Scene scene;
  std::vector<std::uint32_t> bodies;
  std::vector<BodyPair> pairs;
  std::vector<Pose> poses;
  QueryView q;
};

struct Found {
  std::uint64_t apart = 0, overlap = 0, beyond = 0, open = 0, left = 0, rows = 0, narrow = 0;

  void add(const HostReduction& reduction, const QueryView& q) {
    for (std::uint64_t i = 0; i < reduction.row_count(); ++i, ++rows) {
      const auto status = static_cast<Status>(reduction.rows().status[i]);
      apart += status == Status::kOk;
      overlap += status == Status::kOverlap;
      beyond += status == Status::kBeyond;
      open += status == Status::kUnconverged;
      const double lower = reduction.rows().lower[i], upper = reduction.rows().upper[i];
      EXPECT_LE(lower, upper);
      if (status == Status::kOk && q.reduce != Reduce::kAny) {
        EXPECT_LE(upper - lower, tolerance_at(upper, q.abs_tol, default_rel_tol(q.precision))) << "row " << i;
        ++narrow;
      }
    }
  }
};

TEST(ElementKernels, HoldWhatTheCpuHolds) {
  for (const Kind kind : {Kind::kPoints, Kind::kGrown, Kind::kVoxels})
    for (const bool cloud_first : {true, false}) {
      Found min, within, nearest, any;
      for (const double room : {0.5, 1.0, 2.5}) {
        Case c(kind, 700, room, 17, 5, cloud_first);
        c.poses[4].translation.x = std::numeric_limits<double>::quiet_NaN();
        const Engine cpu(std::move(c.scene), {"cpu"});
        const auto run = [&](Found& found, const std::string& what) {
          HostReduction reduction(cpu, c.q);
          found.left += reduction.compare_bounds(what + ", kind " + std::to_string(static_cast<int>(kind)) + ", room " +
                                                 std::to_string(room));
          found.add(reduction, c.q);
        };
        for (const double distance : {kInf, 0.3, 0.02}) {
          c.q.max_distance = distance;
          const std::string what = "within " + std::to_string(distance);
          c.q.reduce = Reduce::kMin;
          run(min, "min " + what);
          c.q.reduce = Reduce::kNearest;
          run(nearest, "nearest " + what);
          c.q.reduce = Reduce::kWithin;
          run(within, "within " + what);
        }
        c.q.max_distance = kInf;
        c.q.reduce = Reduce::kAny;
        for (const double margin : {0.0, 1e-6, 0.02, 0.3}) {
          c.q.margin = margin;
          run(any, "any " + std::to_string(margin));
        }
      }
      for (const Found& found : {min, within, nearest, any}) {
        EXPECT_GT(found.overlap, 10u);
        EXPECT_LT(found.left, found.rows / 10) << "few are the CPU's to finish";
      }
      for (const Found& found : {min, nearest, any}) EXPECT_GT(found.beyond, 5u);
      for (const Found& found : {min, within, nearest}) EXPECT_GT(found.narrow, 5u);
      EXPECT_GT(any.apart, 5u) << "within their margins, and apart";
    }
}

}  // namespace
}  // namespace clearance::test
