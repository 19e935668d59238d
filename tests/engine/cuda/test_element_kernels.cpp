// The kernel for clouds and meshes (engine/cuda/mesh/element_kernel.cuh), compiled for the host: its intervals are
// compared with the CPU's and checked by the exact oracle. The oracle must find each of its mutants
// (tests/mutants). No GPU needed.
#include "tests/engine/cuda/element_case.h"
#include "tests/oracle/exact/exact_surface.h"
// After all other headers.
#include "tests/engine/cuda/emulated_reduction.h"

namespace clearance::test {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr ElementKind kKinds[] = {ElementKind::kPoints,  ElementKind::kGrown, ElementKind::kVoxels,
                                  ElementKind::kSurface, ElementKind::kSolid, ElementKind::kGrownSolid};

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
  for (const ElementKind kind : kKinds) {
    Found min, within, nearest, any;
    for (const double room : {0.5, 1.0, 2.5}) {
      ElementCase c(kind, is_mesh(kind) ? 2 : 700, room, 9, 5, room == 1, 0.05, room == 0.5);
      c.poses[4].translation.x = std::numeric_limits<double>::quiet_NaN();
      const engine::Engine cpu(std::move(c.scene), {.backend = "cpu", .covers = engine::Covers::kOff});
      const auto run = [&](Found& found, const std::string& what) {
        HostReduction reduction(cpu, c.q);
        found.left += reduction.compare_bounds(what + ", kind " + std::to_string(static_cast<int>(kind)) + ", room " +
                                               std::to_string(room));
        found.add(reduction, c.q);
      };
      for (const double distance : {kInf, 0.1}) {
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
      for (const double margin : {0.0, 0.02, 0.3}) {
        c.q.margin = margin;
        run(any, "any " + std::to_string(margin));
      }
    }
    for (const Found& found : {min, within, nearest, any}) {
      EXPECT_GT(found.overlap, 10u);
      EXPECT_LT(found.left, found.rows / 10) << "few are the CPU's to finish";
    }
    for (const Found& found : {min, nearest, any}) EXPECT_GT(found.beyond, 3u);
    for (const Found& found : {min, within, nearest}) EXPECT_GT(found.narrow, 3u);
    EXPECT_GT(any.apart, 3u) << "within their margins, and apart";
  }
}

// Bodies that touch no triangle: in a block, in a cavity, in a shelf, and outside of all. None is left to the CPU.
TEST(ElementKernels, KnowWhatASolidHolds) {
  for (const ElementKind kind : {ElementKind::kSurface, ElementKind::kSolid, ElementKind::kGrownSolid})
    for (const bool elements_first : {true, false}) {
      ElementCase c(kind, 4, 1, 24, 7, elements_first);
      const std::uint32_t box = c.bodies[1];
      c.pairs = {elements_first ? BodyPair{0, box} : BodyPair{box, 4}};
      c.q.pairs = c.pairs;
      Random random(3);
      for (std::uint32_t k = 0; k < 24; ++k) c.put(k, MeshOfCase::kPlaces[k % 4], random);
      const engine::Engine cpu(std::move(c.scene), {.backend = "cpu", .covers = engine::Covers::kOff});
      for (const Reduce reduce : {Reduce::kMin, Reduce::kAny}) {
        c.q.reduce = reduce;
        HostReduction reduction(cpu, c.q);
        EXPECT_EQ(reduction.compare_bounds("what a solid holds"), 0u);
        for (std::uint32_t k = 0; k < 24; ++k) {
          const bool overlaps = static_cast<Status>(reduction.rows().status[k]) == Status::kOverlap;
          EXPECT_EQ(overlaps, k % 4 == 0 && kind != ElementKind::kSurface) << "configuration " << k;
        }
      }
    }
}

// Without a cutoff no bound excludes any of a large mesh at first; the stack must still suffice.
TEST(ElementKernels, HoldEnoughForLargeTrees) {
  ElementCase c(ElementKind::kSurface, 40, 0.6, 3, 3, false);
  const engine::Engine cpu(std::move(c.scene), {.backend = "cpu", .covers = engine::Covers::kOff});
  c.q.reduce = Reduce::kWithin;
  HostReduction reduction(cpu, c.q);
  EXPECT_EQ(reduction.compare_bounds("86,400 triangles"), 0u);
}

// Rays through faces, edges and corners, whose points differ from corners only in x.
TEST(ElementKernels, CountHowOftenTrianglesWind) {
  const ElementCase c(ElementKind::kSolid, 4, 1, 1, 7, true);
  const HostElements elements(c.scene);
  const ElementSet& set = elements.view().sets[0];
  const Surface& surface = *c.scene.bodies()[0].parts[0]->surface;
  Random random(17);
  std::uint64_t within[2] = {};
  std::vector<std::uint32_t> stack(320);
  for (std::uint32_t i = 0; i < 600; ++i) {
    const bool by_corner = i % 2 == 0;
    Vec3d p{random.uniform(-1.2, 1.2), random.uniform(-2, 2), random.uniform(-1.1, 1.1)};
    if (by_corner) {
      const Vec3d& v = surface.vertices()[random.below(surface.vertices().size())];
      p = {p.x, v.y, v.z};
    }
    emulated::Winding found{};
    EmulatedGrid::one().launch(1, 32, [&] { found = emulated::count_winding(set, p, stack.data(), 320); });
    if (!found.is_sure) {
      EXPECT_TRUE(by_corner) << "float64 knows the others";
      continue;
    }
    EXPECT_EQ(found.number, winding_number(surface, p)) << "point " << i;
    within[by_corner] += found.number != 0;
  }
  EXPECT_GT(within[0], 30u);
  EXPECT_GT(within[1], 5u);
}

// The doubles next to the exact distance of two bodies; 0 if they overlap.
struct Exact {
  double below = kInf, above = kInf;
};
// Elements for the oracle: a cloud's points as triangles of one corner each, its voxels as solids.
struct CheckedElements {
  std::vector<Vec3d> vertices;
  std::vector<Triangle> triangles;
  bool is_solid;

  explicit CheckedElements(const Surface& cloud) : is_solid(cloud.edge() > 0 || cloud.is_solid()) {
    if (!cloud.is_cloud()) {
      vertices.assign(cloud.vertices().begin(), cloud.vertices().end());
      triangles.assign(cloud.triangles().begin(), cloud.triangles().end());
      return;
    }
    for (std::uint32_t i = 0; i < cloud.size(); ++i) {
      const auto first = static_cast<std::uint32_t>(vertices.size());
      const ElementCorners corners = cloud.element(i);
      vertices.insert(vertices.end(), corners.span().begin(), corners.span().end());
      if (!is_solid) {
        triangles.push_back({first, first, first});
        continue;
      }
      constexpr std::uint32_t kFaces[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                              {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
      for (const auto& f : kFaces) {
        triangles.push_back({first + f[0], first + f[1], first + f[2]});
        triangles.push_back({first + f[0], first + f[2], first + f[3]});
      }
    }
  }
};
Exact exact_answer(const Body& a, const Pose& at_a, const Body& b, const Pose& at_b) {
  Exact least;
  for (const ConvexPartPtr& of_a : a.parts)
    for (const ConvexPartPtr& of_b : b.parts) {
      std::vector<CheckedElements> elements;
      elements.reserve(2);
      const auto view = [&](const ConvexPart& part) {
        if (!part.surface) return exact::BodyView{part.vertices, {}, false, part.radius};
        const CheckedElements& of = elements.emplace_back(*part.surface);
        return exact::BodyView{of.vertices, of.triangles, of.is_solid, part.radius};
      };
      const exact::BodyView view_a = view(*of_a), view_b = view(*of_b);
      const exact::Value d = exact::exact_distance(view_a, at_a, view_b, at_b).distance;
      const Exact one = d.compare(0) > 0 ? Exact{d.lower(), d.upper()} : Exact{0, 0};
      least = {std::min(least.below, one.below), std::min(least.above, one.above)};
    }
  return least;
}

TEST(ElementKernels, HoldTheExactDistance) {
  std::uint64_t wrong = 0;
  for (const ElementKind kind : kKinds) {
    std::uint64_t apart = 0, overlap = 0, near = 0, far = 0;
    for (const double room : {0.6, 1.2}) {
      constexpr std::uint32_t kConfigurations = 8;
      ElementCase c(kind, is_mesh(kind) ? 1 : 90, room, kConfigurations, 11, true, 0.0625,
                    room == 1.2);  // whose voxels have exact corners
      Random random(9);
      if (is_mesh(kind))
        for (std::uint32_t k = 0; k < 4; ++k) c.put(k, MeshOfCase::kPlaces[k], random);
      const engine::Engine cpu(std::move(c.scene), {.backend = "cpu", .covers = engine::Covers::kOff});
      const std::vector<Body>& bodies = cpu.scene().bodies();
      const auto pose = [&](std::uint32_t k, std::uint32_t b) {
        const auto at = std::find(c.bodies.begin(), c.bodies.end(), b);
        if (at == c.bodies.end()) return *bodies[b].pose;
        return c.poses[k * c.bodies.size() + static_cast<std::size_t>(at - c.bodies.begin())];
      };
      std::vector<Exact> exact;  // (K, P)
      for (std::uint32_t k = 0; k < kConfigurations; ++k)
        for (const BodyPair p : c.pairs)
          exact.push_back(exact_answer(bodies[p.a], pose(k, p.a), bodies[p.b], pose(k, p.b)));
      const auto exact_of = [&](std::uint32_t k, BodyPair p) {
        return exact[k * c.pairs.size() +
                     static_cast<std::size_t>(std::find(c.pairs.begin(), c.pairs.end(), p) - c.pairs.begin())];
      };
      const auto least = [&](std::uint32_t k) {
        const auto begin = exact.begin() + static_cast<std::ptrdiff_t>(k * c.pairs.size());
        return *std::min_element(begin, begin + static_cast<std::ptrdiff_t>(c.pairs.size()),
                                 [](const Exact& a, const Exact& b) { return a.above < b.above; });
      };
      const auto holds = [&](const ReplyView& rows, std::uint64_t i, const Exact& d) {
        wrong += !(rows.lower[i] <= d.below && rows.upper[i] >= d.above);
        (d.above > 0 ? apart : overlap) += 1;
      };
      for (const Reduce reduce : {Reduce::kWithin, Reduce::kMin}) {
        c.q.reduce = reduce;
        c.q.max_distance = reduce == Reduce::kMin ? kInf : 1;
        HostReduction reduction(cpu, c.q);
        reduction.answer();
        const ReplyView& rows = reduction.rows();
        std::uint64_t expected = 0;
        for (const Exact& d : exact) expected += d.above <= 1;
        wrong += reduction.row_count() != (reduce == Reduce::kMin ? kConfigurations : expected);
        for (std::uint64_t i = 0; i < reduction.row_count(); ++i) {
          const std::uint32_t k = rows.configuration[i];
          holds(rows, i, reduce == Reduce::kMin ? least(k) : exact_of(k, rows.pair[i]));
        }
      }
      c.q.reduce = Reduce::kAny;
      c.q.max_distance = kInf;
      for (const double margin : {0.0, 0.05, 0.2}) {
        c.q.margin = margin;
        HostReduction reduction(cpu, c.q);
        reduction.answer();
        const ReplyView& rows = reduction.rows();
        for (std::uint32_t k = 0; k < kConfigurations; ++k) {
          const bool is_far = static_cast<Status>(rows.status[k]) == Status::kBeyond;
          wrong += is_far != (least(k).below > margin);
          (is_far ? far : near) += 1;
          if (!is_far) holds(rows, k, exact_of(k, rows.pair[k]));
        }
      }
      ASSERT_EQ(wrong, 0u) << "rows, or how many there are; kind " << static_cast<int>(kind);
    }
    EXPECT_GT(apart, 30u);
    EXPECT_GT(overlap, 20u);
    EXPECT_GT(near, 10u);
    EXPECT_GT(far, 5u);
  }
}

}  // namespace
}  // namespace clearance::test
