#include "tests/oracle/exact/exact_distance.h"

#include <algorithm>
#include <limits>
#include <optional>
#include <stdexcept>
#include <type_traits>

#include "tests/oracle/exact/exact_depth.h"
#include "tests/oracle/exact/exact_difference.h"

namespace clearance::exact {

namespace {

/// The same difference in doubles, for a first guess.
class RoughDifference {
 public:
  using Scalar = double;

  RoughDifference(std::span<const Vec3d> a, std::span<const Vec3d> b) : a_(a), b_(b) {}
  Vertex<double> at(VertexPair i) const { return {i, b_[i.b] - a_[i.a]}; }
  Vertex<double> lowest(const Vec3d& d) const {
    VertexPair best;
    double high = -std::numeric_limits<double>::infinity(), low = -high;
    for (std::uint32_t i = 0; i < a_.size(); ++i)
      if (const double h = dot(d, a_[i]); h > high) high = h, best.a = i;
    for (std::uint32_t i = 0; i < b_.size(); ++i)
      if (const double h = dot(d, b_[i]); h < low) low = h, best.b = i;
    return at(best);
  }

 private:
  std::span<const Vec3d> a_, b_;
};

/// The nearest point of the hull of a few points to the origin: in the open hull of an independent subset.
template <class T>
struct Feature {
  std::vector<Vertex<T>> vertices;
  std::vector<T> weights;      // > 0, of the nearest point; their sum is not 1
  Vec3<T> direction{0, 0, 0};  // parallel to the nearest point, not of its length
  T height = 0;                // direction . c of each vertex c; 0 if the origin is in the hull
};

/// The point of the affine hull of one to three points that is nearest to the origin; nothing if the points are
/// dependent or the point is not in their open hull.
template <class T>
std::optional<Feature<T>> nearest_of_subset(std::vector<Vertex<T>> s) {
  Feature<T> f;
  if (s.size() == 1) {
    f.weights = {T(1)};
    f.direction = s[0].c;
  } else if (s.size() == 2) {
    const Vec3<T>&p = s[0].c, &q = s[1].c;
    const Vec3<T> e = q - p;
    const T pe = dot(p, e), qe = dot(q, e);
    if (!(pe < 0 && qe > 0)) return std::nullopt;
    f.weights = {qe, T(-pe)};
    f.direction = T(qe - pe) * p - pe * e;
  } else {
    const Vec3<T>&p = s[0].c, &q = s[1].c, &r = s[2].c;
    Vec3<T> n = cross(q - p, r - p);
    f.weights = {dot(n, cross(q, r)), dot(n, cross(r, p)), dot(n, cross(p, q))};
    for (const T& w : f.weights)
      if (!(w > 0)) return std::nullopt;  // also if n = 0
    f.direction = dot(n, p) < 0 ? -n : n;
  }
  f.height = dot(f.direction, s[0].c);
  f.vertices = std::move(s);
  return f;
}

/// The nearest point of the hull of one to four points. In exact arithmetic it always finds one: by Caratheodory's
/// theorem the nearest point lies in the open hull of some independent subset, and there the other points are not
/// lower. Four points without such a proper subset are independent and contain the origin. In doubles it may find none.
template <class T>
std::optional<Feature<T>> nearest_of(const std::vector<Vertex<T>>& s) {
  const unsigned all = (1u << s.size()) - 1;
  for (unsigned mask = 1; mask <= all && mask < 15; ++mask) {
    std::vector<Vertex<T>> subset;
    for (std::size_t i = 0; i < s.size(); ++i)
      if (mask >> i & 1) subset.push_back(s[i]);
    const auto f = nearest_of_subset(std::move(subset));
    if (!f) continue;
    bool nearest = true;
    for (std::size_t i = 0; i < s.size() && nearest; ++i)
      if (!(mask >> i & 1) && dot(f->direction, s[i].c) < f->height) nearest = false;
    if (nearest) return f;
  }
  if (s.size() < 4) return std::nullopt;
  Feature<T> inside;
  inside.vertices = s;
  return inside;
}

/// Gilbert's descent (Gilbert, Johnson, Keerthi 1988): the nearest point of a simplex, then the vertex of C lowest
/// towards the origin, until no vertex is lower than the simplex. In exact arithmetic |nearest point| falls strictly
/// with every step, so that no simplex returns and the loop ends. With doubles it only proposes, and ends without clear
/// progress.
template <class Shape>
Feature<typename Shape::Scalar> descend(const Shape& C, std::vector<VertexPair> start, int limit, double progress,
                                        int* steps) {
  using T = typename Shape::Scalar;
  std::vector<Vertex<T>> simplex;
  for (const VertexPair& i : start) simplex.push_back(C.at(i));
  Feature<T> f;
  for (int step = 0; step < limit; ++step) {
    if (steps) ++*steps;
    auto next = nearest_of(simplex);
    if (!next) return f;  // doubles only
    f = std::move(*next);
    if (f.height == 0) return f;
    Vertex<T> c = C.lowest(f.direction);
    const T h = dot(f.direction, c.c);
    if constexpr (std::is_same_v<T, double>) {
      if (!(h < (1 - progress) * f.height)) return f;
    } else {
      if (h >= f.height) return f;
    }
    simplex = f.vertices;
    simplex.push_back(std::move(c));
  }
  if constexpr (std::is_same_v<T, double>) return f;
  throw std::logic_error("exact_distance: the descent did not end");
}

}  // namespace

std::vector<Vec3d> roughly_placed(std::span<const Vec3d> vertices, const Pose& X, const Vec3d& t) {
  const Mat3d R = rotation_of(X);
  std::vector<Vec3d> out;
  for (const Vec3d& v : vertices) out.push_back(R * v + t);
  return out;
}

Vec3d rough_direction(std::span<const Vec3d> a, std::span<const Vec3d> b) {
  return descend(RoughDifference(a, b), {{0, 0}}, 60, 1e-13, nullptr).direction;
}

Result exact_distance(const ConvexPartView& a, const Pose& X_wa, const ConvexPartView& b, const Pose& X_wb,
                      bool depth) {
  const Difference C(a, X_wa, b, X_wb);
  const std::vector<Vec3d> rough_a = roughly_placed(a.vertices, X_wa, {0, 0, 0}),
                           rough_b = roughly_placed(b.vertices, X_wb, X_wb.translation - X_wa.translation);
  std::vector<VertexPair> start;
  for (const auto& v : descend(RoughDifference(rough_a, rough_b), {{0, 0}}, 60, 1e-13, nullptr).vertices)
    start.push_back(v.index);
  if (start.empty()) start = {{0, 0}};

  Result result;
  Feature<mpz_class> f = descend(C, start, 1000000, 0, &result.iterations);
  if (f.height != 0) {
    result.direction = f.direction;
    result.distance = C.value(1, f.height, f.direction);
    result.weights = std::move(f.weights);
    for (const auto& v : f.vertices) result.simplex.push_back(v.index);
    return result;
  }
  result.cores_overlap = true;
  result.distance = C.value(0, 0, {1, 0, 0});
  if (depth) solve_depth(C, std::move(f.vertices), result);
  return result;
}

Value exact_gap_along(const ConvexPartView& a, const Pose& X_wa, const ConvexPartView& b, const Pose& X_wb,
                      const Vec3z& n) {
  if (squared_norm(n) == 0) throw std::invalid_argument("exact_gap_along: the direction is zero");
  const Difference C(a, X_wa, b, X_wb);
  const mpz_class gap = dot(n, C.lowest(n).c);
  return C.value(sgn(gap), gap, n);
}

Value exact_support_gap(const ConvexPartView& a, const Pose& X_wa, const ConvexPartView& b, const Pose& X_wb,
                        const Vec3d& n) {
  LeastExponent e;
  e.include(n);
  return exact_gap_along(a, X_wa, b, X_wb, integer(n, e.get()));
}

}  // namespace clearance::exact
