#include "engine/evaluate/feature_pair.h"

#include <algorithm>
#include <cmath>

#include "engine/evaluate/feature_side.h"
#include "engine/narrow/gjk/gjk.h"

namespace clearance {

namespace {

constexpr double kEpsilon = 0x1p-52;
constexpr double kDependent = 1e-14;  // squared sine of an angle below which tangents count as dependent

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

std::optional<WitnessPoints> nearest_points(std::span<const Vec3d> a, std::span<const Vec3d> b, const Vec3d& toward) {
  GjkLimits<double> limits;
  limits.rel_tol = 0;
  const auto cso = [&](const Vec3d& v) {
    const std::uint32_t i = farthest_along(a, -v), j = farthest_along(b, v);
    const Vec3d w = a[i] - b[j];
    return CsoSupport<double>{{w, i, j}, dot(v, w)};
  };
  const Gjk<double> g = gjk(cso, -toward, Simplex<double>{}, limits);
  if (g.end == Gjk<double>::code(GjkEnd::kEncloses) || g.simplex.size < 1 || g.simplex.size > 3) return {};
  WitnessPoints points{{0, 0, 0}, {0, 0, 0}};
  double sum = 0;
  for (int i = 0; i < g.simplex.size; ++i) sum += g.simplex.weight[i];
  for (int i = 0; i < g.simplex.size; ++i) {
    const double share = g.simplex.weight[i] / sum;
    points.a = points.a + a[g.simplex.vertex[i].a] * share;
    points.b = points.b + b[g.simplex.vertex[i].b] * share;
  }
  return points;
}

FeaturePair::Side::Side(const ConvexPart& of, const PoseMatrix& placed, const Vec3d& origin)
    : part(of), pose(placed), shift(placed.t_w - origin), vertices(placed_vertices(of, placed, origin)) {}

void FeaturePair::take_points(const Vec3d& a, const Vec3d& b) {
  point_a_ = a;
  point_b_ = b;
  distance_ = norm(b - a);
  normal_ = (b - a) * (1 / distance_);
}

std::optional<FeaturePair> FeaturePair::find(const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b,
                                             const PoseMatrix& pose_b, const Vec3d& toward) {
  if (is_half_space(a) && is_half_space(b)) return {};
  Side of_a(a, pose_a, pose_a.t_w), of_b(b, pose_b, pose_a.t_w);
  return is_round(a) || is_round(b) ? find_round(of_a, of_b) : find_flat(of_a, of_b, toward);
}

std::optional<FeaturePair> FeaturePair::find_flat(const Side& a, const Side& b, const Vec3d& toward) {
  std::optional<WitnessPoints> points;
  if (is_half_space(a.part)) {
    const Vec3d p = b.vertices[farthest_along(b.vertices, -a.outward())];
    points = {a.foot(p), p};
  } else if (is_half_space(b.part)) {
    const Vec3d p = a.vertices[farthest_along(a.vertices, -b.outward())];
    points = {p, b.foot(p)};
  } else {
    points = nearest_points(a.vertices, b.vertices, toward);
  }
  if (!points) return {};
  FeaturePair pair;
  pair.take_points(points->a, points->b);
  const double reach = std::max(reach_of(a.vertices, points->a), reach_of(b.vertices, points->b));
  const double scale = reach + norm(points->a) + norm(points->b);
  if (!(pair.distance_ > 64 * kEpsilon * scale)) return {};
  // A vertex below a plane is no feature of separated cores.
  if (is_half_space(a.part) && dot(a.outward(), pair.normal_) < 0) return {};
  if (is_half_space(b.part) && dot(b.outward(), pair.normal_) > 0) return {};
  const double tolerance = 32 * kEpsilon * scale * (1 + reach / pair.distance_);
  pair.a_ = a.flat_feature(pair.normal_, points->a, tolerance);
  pair.b_ = b.flat_feature(-pair.normal_, points->b, tolerance);
  pair.factorise();
  pair.polish();
  pair.set_radius(a.vertices, b.vertices, tolerance);
  return pair;
}

double FeaturePair::bend(int i, int j) const {
  if ((i < b_.size) != (j < b_.size)) return 0;
  return i < b_.size ? b_.bend[i + j] : a_.bend[i + j - 2 * b_.size];
}

// The matrix of the slides is along(i) . along(j) / distance + bend(i, j), scaled by the distance here.
void FeaturePair::factorise() {
  for (int i = 0; i < slides(); ++i) {
    for (int j = 0; j <= i; ++j) {
      const double whole = dot(along(i), along(j)) + distance_ * bend(i, j);
      double sum = whole;
      for (int k = 0; k < j; ++k) sum -= factor_[i][k] * factor_[j][k];
      if (i != j)
        factor_[i][j] = factor_[j][j] > 0 ? sum / factor_[j][j] : 0;
      else
        factor_[i][i] = sum > kDependent * whole ? std::sqrt(sum) : 0;
    }
  }
}

// Moves the nearest points along the features to where their distance is least: exact for flat ones, a step of Newton's
// method for others. Returns the longest move.
double FeaturePair::polish() {
  double y[4]{}, most = 0;
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
    most = std::max(most, std::abs(y[i]));
  }
  take_points(point_a_, point_b_);
  return most;
}

void FeaturePair::set_radius(std::span<const Vec3d> a, std::span<const Vec3d> b, double tolerance) {
  const bool are_edges = a_.size == 1 && b_.size == 1;
  const double interior =
      std::min(a_.interior, b_.interior) * (are_edges ? norm(cross(a_.tangent[0], b_.tangent[0])) : 1);
  bool is_one = interior > tolerance;  // otherwise one of several features
  for (int k = 0; k < slides(); ++k) is_one = is_one && factor_[k][k] > 0;
  if (!is_one) return;
  std::vector<Vec3d> spanned;
  for (int k = 0; k < slides(); ++k) {
    Vec3d rest = along(k);
    for (const Vec3d& e : spanned) rest = rest - e * dot(e, rest);
    if (const double length = norm(rest); length * length > kDependent) spanned.push_back(rest * (1 / length));
  }
  smooth_radius_ = std::min({interior, cone_radius(a, normal_, point_a_, distance_, spanned, tolerance),
                             cone_radius(b, -normal_, point_b_, distance_, spanned, tolerance)});
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
