#include "engine/evaluate/feature_pair.h"

#include <algorithm>
#include <cmath>

#include "engine/hull/primitive.h"
#include "engine/narrow/gjk/gjk.h"

namespace clearance {

namespace {

constexpr double kEpsilon = 0x1p-52;
constexpr double kParallel = 1e-9;  // sine of an angle below which edges count as parallel

std::uint32_t farthest_along(std::span<const Vec3d> points, const Vec3d& n) {
  std::uint32_t best = 0;
  double most = dot(points[0], n);
  for (std::uint32_t i = 1; i < points.size(); ++i)
    if (const double at = dot(points[i], n); at > most) most = at, best = i;
  return best;
}

double reach_of(std::span<const Vec3d> points, const Vec3d& from) {
  double most = 0;
  for (const Vec3d& p : points) most = std::max(most, squared_norm(p - from));
  return std::sqrt(most);
}

struct Points {
  Vec3d a, b;
};

// Nearest points of two hulls in float64. Nothing if they overlap.
std::optional<Points> nearest_points(std::span<const Vec3d> a, std::span<const Vec3d> b, const Vec3d& toward) {
  GjkLimits<double> limits;
  limits.rel_tol = 0;
  const auto cso = [&](const Vec3d& v) {
    const std::uint32_t i = farthest_along(a, -v), j = farthest_along(b, v);
    const Vec3d w = a[i] - b[j];
    return CsoSupport<double>{{w, i, j}, dot(v, w)};
  };
  const Gjk<double> g = gjk(cso, -toward, Simplex<double>{}, limits);
  if (g.end == Gjk<double>::code(GjkEnd::kEncloses) || g.simplex.size < 1 || g.simplex.size > 3) return {};
  Points points{{0, 0, 0}, {0, 0, 0}};
  double sum = 0;
  for (int i = 0; i < g.simplex.size; ++i) sum += g.simplex.weight[i];
  for (int i = 0; i < g.simplex.size; ++i) {
    const double share = g.simplex.weight[i] / sum;
    points.a = points.a + a[g.simplex.vertex[i].a] * share;
    points.b = points.b + b[g.simplex.vertex[i].b] * share;
  }
  return points;
}

// Nearest points of a half-space and a hull: the hull's deepest vertex and its foot.
Points points_on_plane(const PoseMatrix& plane, const Vec3d& origin, std::span<const Vec3d> hull, Vec3d& outward) {
  outward = plane.R_wb * Vec3d{0, 0, 1};
  const Vec3d p = hull[farthest_along(hull, -outward)];
  return {p - outward * dot(outward, p - (plane.t_w - origin)), p};
}

// Distance over which vertices stay behind the plane, while it turns about the features.
double cone_radius(std::span<const Vec3d> vertices, const Vec3d& outward, const Vec3d& point, double distance,
                   std::span<const Vec3d> spanned, double tolerance) {
  double least = __builtin_inf();
  for (const Vec3d& v : vertices) {
    Vec3d arm = point - v;
    const double gap = dot(outward, arm);
    if (gap <= tolerance) continue;
    for (const Vec3d& e : spanned) arm = arm - e * dot(arm, e);
    least = std::min(least, distance * gap / norm(arm));
  }
  return least;
}

}  // namespace

std::optional<FeaturePair> FeaturePair::find(const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b,
                                             const PoseMatrix& pose_b, const Vec3d& toward) {
  if (is_round(a) || is_round(b) || (is_half_space(a) && is_half_space(b))) return {};
  const Vec3d origin = pose_a.t_w;
  const std::vector<Vec3d> of_a = placed_vertices(a, pose_a, origin), of_b = placed_vertices(b, pose_b, origin);
  FeaturePair pair;
  std::optional<Points> points;
  Vec3d outward{0, 0, 0};  // of the plane
  if (is_half_space(a)) {
    points = points_on_plane(pose_a, origin, of_b, outward);
  } else if (is_half_space(b)) {
    points = points_on_plane(pose_b, origin, of_a, outward);
    std::swap(points->a, points->b);
  } else {
    points = nearest_points(of_a, of_b, toward);
  }
  if (!points) return {};
  pair.point_a_ = points->a;
  pair.point_b_ = points->b;
  const double reach = std::max(reach_of(of_a, points->a), reach_of(of_b, points->b));
  const double scale = reach + norm(points->a) + norm(points->b);
  pair.distance_ = norm(points->b - points->a);
  if (!(pair.distance_ > 64 * kEpsilon * scale)) return {};
  pair.normal_ = (points->b - points->a) * (1 / pair.distance_);
  const double tolerance = 32 * kEpsilon * scale * (1 + reach / pair.distance_);
  // Below the plane the distance is that of the vertex from the plane, counted negative: no feature of separated cores.
  if (is_half_space(a) && dot(outward, pair.normal_) < 0) return {};
  if (is_half_space(b) && dot(outward, pair.normal_) > 0) return {};
  pair.a_ = is_half_space(a) ? plane_feature(pair.normal_) : feature_at(of_a, pair.normal_, points->a, tolerance);
  pair.b_ = is_half_space(b) ? plane_feature(pair.normal_) : feature_at(of_b, -pair.normal_, points->b, tolerance);
  pair.factorise();
  pair.polish();
  pair.set_radius(of_a, of_b, tolerance);
  return pair;
}

// The matrix of the slides is along(i) . along(j) / distance, scaled by the distance here.
void FeaturePair::factorise() {
  for (int i = 0; i < slides(); ++i) {
    for (int j = 0; j <= i; ++j) {
      double sum = dot(along(i), along(j));
      for (int k = 0; k < j; ++k) sum -= factor_[i][k] * factor_[j][k];
      if (i != j)
        factor_[i][j] = factor_[j][j] > 0 ? sum / factor_[j][j] : 0;
      else
        factor_[i][i] = sum > kParallel * kParallel ? std::sqrt(sum) : 0;
    }
  }
}

// Replaces the nearest points by those of the features' spans, to the last digits.
void FeaturePair::polish() {
  double y[4]{};
  const Vec3d gap = point_b_ - point_a_;
  for (int i = 0; i < slides(); ++i) {
    double sum = -dot(along(i), gap);
    for (int k = 0; k < i; ++k) sum -= factor_[i][k] * y[k];
    y[i] = factor_[i][i] > 0 ? sum / factor_[i][i] : 0;
  }
  for (int i = slides(); i-- > 0;) {
    double sum = y[i];
    for (int k = i + 1; k < slides(); ++k) sum -= factor_[k][i] * y[k];
    y[i] = factor_[i][i] > 0 ? sum / factor_[i][i] : 0;
    if (i < b_.size)
      point_b_ = point_b_ + b_.tangent[i] * y[i];
    else
      point_a_ = point_a_ + a_.tangent[i - b_.size] * y[i];
  }
  distance_ = norm(point_b_ - point_a_);
  normal_ = (point_b_ - point_a_) * (1 / distance_);
}

void FeaturePair::set_radius(std::span<const Vec3d> a, std::span<const Vec3d> b, double tolerance) {
  double sine = 1;
  Vec3d spanned[2];
  if (a_.size == 1 && b_.size == 1) sine = norm(cross(a_.tangent[0], b_.tangent[0]));
  const double interior = sine * std::min(a_.interior, b_.interior);
  if (slides() > 2 || sine < kParallel || !(interior > tolerance)) return;  // one of several features
  for (int k = 0; k < slides(); ++k) spanned[k] = along(k);
  if (slides() == 2) {
    spanned[1] = spanned[1] - spanned[0] * dot(spanned[0], spanned[1]);
    spanned[1] = spanned[1] * (1 / norm(spanned[1]));
  }
  const std::span<const Vec3d> axes(spanned, static_cast<std::size_t>(slides()));
  smooth_radius_ = std::min({interior, cone_radius(a, normal_, point_a_, distance_, axes, tolerance),
                             cone_radius(b, -normal_, point_b_, distance_, axes, tolerance)});
}

FeaturePair::Term FeaturePair::term(const FeatureMotion& motion) const {
  Term term{(motion.shift - normal_ * dot(normal_, motion.shift)) * (1 / std::sqrt(distance_)), {}};
  const double root = std::sqrt(distance_);
  for (int i = 0; i < slides(); ++i) {
    const Vec3d& spin = i < b_.size ? motion.spin_b : motion.spin_a;
    double sum = dot(along(i), motion.shift) / root + root * dot(normal_, cross(spin, along(i)));
    for (int k = 0; k < i; ++k) sum -= factor_[i][k] * term.slide[k];
    term.slide[i] = factor_[i][i] > 0 ? sum / factor_[i][i] : 0;
  }
  return term;
}

}  // namespace clearance
