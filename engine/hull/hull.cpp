#include "engine/hull/hull.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <string>

#include "engine/base/dedupe.h"
#include "engine/base/digest.h"
#include "engine/base/fp_environment.h"
#include "engine/base/orientation.h"
#include "engine/hull/mesh_rows.h"
#include "engine/hull/qhull_guess.h"
#include "engine/pose/pose.h"

namespace clearance {

namespace {

constexpr std::uint32_t kNowhere = std::numeric_limits<std::uint32_t>::max();

// Size of the sample whose hull removes most inner points of a large set before Qhull.
constexpr std::size_t kSampleVertices = 20'000;

// A closed surface of triangles with an apex, from which its other triangles are visible: each with the apex makes a
// tetrahedron.
class Fan {
 public:
  Fan(std::span<const Vec3d> points, std::span<const Triangle> triangles,
      std::span<const std::array<std::uint32_t, 3>> across, std::uint32_t apex)
      : points_(points), triangles_(triangles), across_(across), apex_(apex) {
    while (start_ + 1 < triangles_.size() && touches_apex(start_)) ++start_;
  }

  /// A triangle to begin from.
  std::uint32_t start() const { return start_; }

  // Walks from triangle `*at` towards the one where the ray from the apex through p leaves the surface, and tries to
  // prove that p lies in its tetrahedron. `*at` becomes the walk's last triangle.
  bool holds(const Vec3d& p, std::uint32_t* at) const {
    const Vec3d& o = points_[apex_];
    std::uint32_t t = *at, before = kNowhere;
    // A walk through well-shaped triangles takes about the square root of their number; a longer one goes in circles.
    for (std::size_t step = 0, steps = 64 + 4 * static_cast<std::size_t>(std::sqrt(double(triangles_.size())));
         step < steps; ++step) {
      *at = t;
      const Triangle& c = triangles_[t];
      // From the apex, outside of the triangle's edge k: det[a - o, b - o, p - o] < 0 for an edge a, b. Rounding does
      // no harm to a walk.
      std::uint32_t next = kNowhere;
      for (int k = 0; k < 3 && next == kNowhere; ++k) {
        const int edge = static_cast<int>((k + step) % 3);  // another edge first each time, against circles
        const std::uint32_t a = c[edge], b = c[(edge + 1) % 3], other = across_[t][edge];
        if (other == kNowhere || other == before || touches_apex(other)) continue;
        const Vec3d u = points_[a] - o, v = points_[b] - o, w = p - o;
        if (dot(w, cross(u, v)) < 0) next = other;
      }
      if (next == kNowhere) return !touches_apex(t) && inside(c, p);
      before = t;
      t = next;
    }
    return false;
  }

 private:
  bool touches_apex(std::uint32_t t) const {
    const Triangle& c = triangles_[t];
    return c[0] == apex_ || c[1] == apex_ || c[2] == apex_;
  }
  // Whether p is proved to lie in the tetrahedron of the apex and a triangle, its boundary included.
  bool inside(const Triangle& t, const Vec3d& p) const {
    const Vec3d &o = points_[apex_], &a = points_[t[0]], &b = points_[t[1]], &c = points_[t[2]];
    const int whole = orientation(a, b, c, o);
    if (whole == 0) return false;  // flat: no test could decide on which side of it p lies
    // p on the same side of each face as the corner across from it.
    return orientation(a, b, c, p) * whole >= 0 && orientation(a, b, p, o) * whole >= 0 &&
           orientation(b, c, p, o) * whole >= 0 && orientation(c, a, p, o) * whole >= 0;
  }

  std::span<const Vec3d> points_;
  std::span<const Triangle> triangles_;
  std::span<const std::array<std::uint32_t, 3>> across_;
  std::uint32_t apex_;
  std::uint32_t start_ = 0;
};

// For each triangle's edge (corner k to k + 1) the triangle on its other side, or kNowhere.
std::vector<std::array<std::uint32_t, 3>> triangles_across(std::span<const Triangle> triangles) {
  struct Edge {
    std::uint32_t from, to, triangle, k;
  };
  std::vector<Edge> edges;
  edges.reserve(3 * triangles.size());
  for (std::uint32_t t = 0; t < triangles.size(); ++t)
    for (std::uint32_t k = 0; k < 3; ++k) edges.push_back({triangles[t][k], triangles[t][(k + 1) % 3], t, k});
  const auto key = [](const Edge& e) { return std::uint64_t{std::min(e.from, e.to)} << 32 | std::max(e.from, e.to); };
  std::sort(edges.begin(), edges.end(), [&](const Edge& a, const Edge& b) { return key(a) < key(b); });
  std::vector<std::array<std::uint32_t, 3>> across(triangles.size(), {kNowhere, kNowhere, kNowhere});
  for (std::size_t i = 0; i + 1 < edges.size(); ++i)
    if (key(edges[i]) == key(edges[i + 1])) {
      across[edges[i].triangle][edges[i].k] = edges[i + 1].triangle;
      across[edges[i + 1].triangle][edges[i + 1].k] = edges[i].triangle;
    }
  return across;
}

// Marks (with true) the points that are proved to lie inside the hull of the corners of `triangles`; corners are not
// marked.
// \param thorough tries again after a failed proof
std::vector<char> proved_inside(std::span<const Vec3d> points, std::span<const Triangle> triangles, bool thorough) {
  std::vector<char> is_corner(points.size(), 0), inside(points.size(), 0);
  for (const Triangle& t : triangles)
    for (const std::uint32_t i : t) is_corner[i] = 1;
  // A point on a face that holds the apex is in flat tetrahedra only. Another apex, far away, proves it.
  std::vector<std::uint32_t> apexes;
  for (int k = 0; k < 3; ++k) {
    std::uint32_t low = triangles[0][0], high = low;
    for (const Triangle& t : triangles)
      for (const std::uint32_t i : t) {
        if (points[i][k] < points[low][k]) low = i;
        if (points[i][k] > points[high][k]) high = i;
      }
    for (const std::uint32_t i : {low, high})
      if (std::find(apexes.begin(), apexes.end(), i) == apexes.end()) apexes.push_back(i);
  }
  if (!thorough) apexes.resize(1);
  const auto across = triangles_across(triangles);
  std::vector<Fan> fans;
  for (const std::uint32_t apex : apexes) fans.emplace_back(points, triangles, across, apex);
  const auto count = static_cast<std::int64_t>(points.size());
#pragma omp parallel if (count > 2000)
  {
    const FpEnvironment environment;
    std::vector<std::uint32_t> at;  // of each fan; neighbours in the list are neighbours in space, as a rule
    for (const Fan& fan : fans) at.push_back(fan.start());
#pragma omp for schedule(dynamic, 512)
    for (std::int64_t i = 0; i < count; ++i) {
      if (is_corner[i]) continue;
      for (std::size_t f = 0; f < fans.size() && !inside[i]; ++f) inside[i] = fans[f].holds(points[i], &at[f]);
    }
  }
  return inside;
}

// Keeps the unmarked points in order, and renumbers the corners of triangles accordingly.
template <class T>
std::vector<T> unmarked(const std::vector<T>& all, const std::vector<char>& marked,
                        std::vector<std::uint32_t>* new_index) {
  std::vector<T> out;
  new_index->assign(all.size(), kNowhere);
  for (std::size_t i = 0; i < all.size(); ++i)
    if (!marked[i]) {
      (*new_index)[i] = static_cast<std::uint32_t>(out.size());
      out.push_back(all[i]);
    }
  return out;
}

void rename(std::vector<Triangle>* triangles, const std::vector<std::uint32_t>& new_index) {
  for (Triangle& t : *triangles)
    for (std::uint32_t& i : t) i = new_index[i];
}

// Hull of the kept points by Qhull, without the points that are proved to be inner.
Hull hull_by_qhull(std::vector<Vec3d> points) {
  Hull hull;
  hull.triangles = qhull_triangles(points);
  if (hull.triangles.size() < 4) {  // flat: every point is kept
    hull.triangles.clear();
    hull.vertices = std::move(points);
    return hull;
  }
  std::vector<std::uint32_t> new_index;
  hull.vertices = unmarked(points, proved_inside(points, hull.triangles, true), &new_index);
  rename(&hull.triangles, new_index);
  return hull;
}

// Drops most inner points of a large set, proved inside the hull of a sample.
std::vector<Vec3d> without_inner_points(std::vector<Vec3d> points) {
  std::vector<Vec3d> sample;
  const std::size_t stride = (points.size() + kSampleVertices - 1) / kSampleVertices;
  std::vector<std::uint32_t> original;
  for (std::size_t i = 0; i < points.size(); i += stride) {
    sample.push_back(points[i]);
    original.push_back(static_cast<std::uint32_t>(i));
  }
  std::vector<Triangle> triangles = qhull_triangles(sample);
  if (triangles.size() < 4) return points;
  rename(&triangles, original);
  std::vector<std::uint32_t> new_index;
  return unmarked(points, proved_inside(points, triangles, false), &new_index);
}

}  // namespace

void check_vertices(std::span<const Vec3d> vertices) {
  if (vertices.empty()) throw std::invalid_argument("a part needs at least one vertex");
  for (std::size_t i = 0; i < vertices.size(); ++i)
    for (int k = 0; k < 3; ++k)
      if (!(std::abs(vertices[i][k]) <= kMaxCoordinate))
        throw std::invalid_argument("vertex " + std::to_string(i) + " has the coordinate " +
                                    std::to_string(vertices[i][k]) + "; expected a finite number up to 1e60 m");
}

Hull reduce_to_hull(std::span<const Vec3d> vertices, std::span<const Triangle> triangles, bool distinct) {
  UniquePositions<double> unique;
  if (distinct)
    unique.positions.assign(vertices.begin(), vertices.end());
  else
    unique = unique_positions<double>(vertices);
  std::vector<Vec3d> points = std::move(unique.positions);
  Hull hull;
  // Coordinates unsuited to exact tests: nothing can be proved, so nothing is dropped.
  if (!std::all_of(points.begin(), points.end(), orientation_applies)) {
    hull.vertices = std::move(points);
    return hull;
  }
  if (points.size() <= kHullCheckVertices) return hull_by_qhull(std::move(points));

  std::vector<Triangle> faces(triangles.begin(), triangles.end());
  if (!distinct) rename(&faces, unique.index);
  unique = {};
  std::erase_if(faces, [](const Triangle& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; });
  if (MeshRows(points.size(), faces).is_convex(points)) {
    hull.triangles = std::move(faces);
    hull.vertices = std::move(points);
    return hull;
  }
  if (points.size() > kSampleVertices) points = without_inner_points(std::move(points));
  if (points.size() <= kHullMaxVertices) return hull_by_qhull(std::move(points));
  hull.vertices = std::move(points);
  return hull;
}

ConvexPartPtr make_hull_part(std::span<const Vec3d> vertices, std::span<const Triangle> triangles, double radius,
                             std::uint64_t loaded_vertices, bool distinct, std::vector<Triangle>* faces) {
  const FpEnvironment environment;
  check_vertices(vertices);
  Digest digest;
  digest.add(vertices);
  digest.add(radius);
  Hull hull = reduce_to_hull(vertices, triangles, distinct);
  if (faces) *faces = std::move(hull.triangles);
  return make_convex_part(std::move(hull.vertices), radius, std::max<std::uint64_t>(loaded_vertices, vertices.size()),
                          digest.value());
}

}  // namespace clearance
