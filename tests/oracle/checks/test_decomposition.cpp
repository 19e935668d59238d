// Compares proved decompositions with the oracle, for convex parts and meshes of many kinds. Samples of the mesh are no
// farther from the parts, and samples of the parts no farther from the enclosed volume, than the proved bounds, and
// some are nearly as far.
//
// All vertices lie on a lattice, so that a sample is exactly a double.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <string>

#include "engine/decomposition/prove.h"
#include "tests/oracle/cases/mesh_shapes.h"
#include "tests/oracle/cases/proposals.h"

namespace clearance::exact {
namespace {

constexpr std::uint64_t kSeed = 21;
constexpr double kInf = std::numeric_limits<double>::infinity();
/// A combination of points with weights in 64ths.
Vec3d sample(Random& random, std::span<const Vec3d> of) {
  Vec3d p{0, 0, 0};
  int left = 64;
  for (std::size_t i = 0; i + 1 < of.size(); ++i) {
    const int weight = random.integer(0, left);
    p += of[i] * (weight / 64.0);
    left -= weight;
  }
  return p + of.back() * (left / 64.0);
}

struct Tally {
  int cases = 0, samples = 0, wrong = 0, bitten = 0, requested = 0;
  double worst = kInf;  // least ratio of observed to bound among tight cases
  void take(double bound, double observed, double negligible) {
    ++cases;
    if (bound < negligible) return;
    ++requested;
    worst = std::min(worst, observed / bound);
    bitten += observed > 0.5 * bound;
  }
};

/// Approximate distance, rounded up, and whether it exceeds a bound.
struct Distance {
  double about;
  bool exceeds;
};
Distance against(const Result& r, double bound) {
  if (r.cores_overlap) return {0, bound < 0};
  return {r.distance.upper(), r.distance.compare(bound) > 0};
}

void check_inner(Random& random, const Mesh& mesh, const Decomposition& d, double size, Tally& tally) {
  double farthest = 0;
  std::vector<Vec3d> points = mesh.vertices;
  for (int i = 0; i < 120; ++i) {
    const Triangle& t = mesh.triangles[static_cast<std::size_t>(random.integer(0, int(mesh.triangles.size()) - 1))];
    points.push_back(sample(random, std::array{mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]}));
  }
  for (const Vec3d& p : points) {
    double nearest = kInf;
    bool exceeds = true;
    for (const ConvexPartPtr& part : d.parts) {
      if (!exceeds && nearest <= farthest) break;
      const Distance r = against(exact_distance({{&p, 1}, 0}, {}, {part->vertices, 0}, {}, false), d.inner);
      nearest = std::min(nearest, r.about);
      exceeds = exceeds && r.exceeds;
    }
    ++tally.samples;
    tally.wrong += exceeds;
    farthest = std::max(farthest, nearest);
  }
  tally.take(d.inner, farthest, 2e-3 * size);
}

void check_outer(Random& random, const Mesh& mesh, const Decomposition& d, double size, Tally& tally) {
  const BodyView exact_value{mesh.vertices, mesh.triangles, true, 0};
  for (std::size_t i = 0; i < d.parts.size(); ++i) {
    const std::vector<Vec3d>& corners = d.parts[i]->vertices;
    double farthest = 0;
    for (int k = 0; k < 30; ++k) {
      std::vector<Vec3d> some;
      for (int c = random.integer(2, 4); c > 0; --c)
        some.push_back(corners[static_cast<std::size_t>(random.integer(0, int(corners.size()) - 1))]);
      const Vec3d p = sample(random, some);
      const Distance r = against(exact_distance(BodyView{{&p, 1}, {}, false, 0}, {}, exact_value, {}), d.outer[i]);
      ++tally.samples;
      tally.wrong += r.exceeds;
      farthest = std::max(farthest, r.about);
    }
    tally.take(d.outer[i], farthest, 0.05 * size);
  }
}

/// \param ends stop at the first error
void try_meshes(int count, bool ends, Tally& inner, Tally& outer) {
  Random random(kSeed);
  for (int i = 0; i < count; ++i)
    for (const Kind kind : kKinds) {
      if (ends && inner.wrong + outer.wrong > 0) return;
      const Mesh mesh = concave_mesh(random, 400);
      const double size = size_of(mesh);
      const Surface exact_value(mesh.vertices, mesh.triangles, true);
      const ProvedDecomposition proved = prove_decomposition(exact_value, propose(random, mesh, kind));
      check_inner(random, mesh, proved.decomposition, size, inner);
      check_outer(random, mesh, proved.decomposition, size, outer);
    }
}

void print(const char* what, const Tally& t) {
  std::printf("%s: %d bounds, %d samples, %d beyond; %d of %d bounds met to a half, the least to %.3g\n", what, t.cases,
              t.samples, t.wrong, t.bitten, t.requested, t.worst);
}

#ifdef CLEARANCE_MUTANT
TEST(Decomposition, MutantsAreFound) {
  Tally inner, outer;
  try_meshes(8, true, inner, outer);
  print("inner", inner);
  print("outer", outer);
  EXPECT_GT(inner.wrong + outer.wrong, 0);
}
#else
TEST(Decomposition, BoundsHoldAndBite) {
  Tally inner, outer;
  try_meshes(4, false, inner, outer);
  print("inner", inner);
  print("outer", outer);
  EXPECT_EQ(inner.wrong, 0);
  EXPECT_EQ(outer.wrong, 0);
  EXPECT_GE(inner.requested, 6);
  EXPECT_GE(outer.requested, 20);
  EXPECT_GE(inner.bitten, 0.6 * inner.requested);
  EXPECT_GE(outer.bitten, 0.5 * outer.requested);
}

TEST(Decomposition, OfWhatIsOneIsExact) {
  // An L of two boxes that share a side.
  const std::array<Point2, 3> path{{{0, 1}, {0, 0}, {1, 0}}};
  const Mesh bar = on_lattice(bent_bar(path, 0.25, 0.5));
  ConvexParts boxes(2);
  for (const Vec3d& v : bar.vertices) {
    if (v.x <= 0.125) boxes[0].push_back(v);
    if (v.x > 0.125 || v.y <= 0.125) boxes[1].push_back(v);
  }
  const ProvedDecomposition proved = prove_decomposition(Surface(bar.vertices, bar.triangles, true), boxes);
  EXPECT_LE(proved.decomposition.inner, 1e-9);
  for (const double outer : proved.decomposition.outer) EXPECT_LE(outer, 1e-3);
  std::printf("inner %.3g, outer %.3g %.3g\n", proved.decomposition.inner, proved.decomposition.outer[0],
              proved.decomposition.outer[1]);
}

TEST(Decomposition, ABareSurfaceHasNothingWithin) {
  const Mesh box = box_mesh({1, 1, 1});
  const ConvexParts whole{box.vertices};
  const Decomposition solid = prove_decomposition(Surface(box.vertices, box.triangles, true), whole).decomposition;
  const Decomposition bare = prove_decomposition(Surface(box.vertices, box.triangles, false), whole).decomposition;
  EXPECT_LE(solid.outer[0], 1e-9);
  EXPECT_GE(bare.outer[0], 1);
  EXPECT_LE(bare.outer[0], 1.2);
  EXPECT_LE(bare.inner, 1e-9);
}

TEST(Decomposition, SaysWhichPartIsInvalid) {
  const Mesh box = box_mesh({1, 1, 1});
  const Surface exact_value(box.vertices, box.triangles, true);
  const auto rejection = [&](const ConvexParts& parts) -> std::string {
    try {
      prove_decomposition(exact_value, parts);
      return "";
    } catch (const std::invalid_argument& e) {
      return e.what();
    }
  };
  EXPECT_EQ(rejection({}), "there is no piece");
  EXPECT_NE(rejection({box.vertices, {}}).find("piece 1: "), std::string::npos);
  EXPECT_NE(rejection({{{std::nan(""), 0, 0}}}).find("piece 0: vertex 0"), std::string::npos);
  EXPECT_NE(rejection({box.vertices, {{kInf, 0, 0}}}).find("piece 1: vertex 0"), std::string::npos);
  // A distant point is a valid part, with a large error.
  const Decomposition far = prove_decomposition(exact_value, ConvexParts{{{10, 0, 0}}}).decomposition;
  EXPECT_GE(far.inner, 11);
  EXPECT_LE(far.inner, 13);
  EXPECT_GE(far.outer[0], 9);
  EXPECT_LE(far.outer[0], 9.1);
}
#endif

}  // namespace
}  // namespace clearance::exact
