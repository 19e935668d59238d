#include "engine/evaluate/feature_pair.h"

#include <algorithm>
#include <cmath>

#include "engine/evaluate/feature_side.h"
#include "engine/narrow/attempt.h"

namespace clearance {

namespace {

constexpr double kSame = 1024;        // tolerances within which features count as equally near
constexpr double kDependent = 1e-14;  // squared sine of an angle below which tangents count as dependent

std::uint32_t farthest_along(std::span<const Vec3d> points, const Vec3d& n) {
  std::uint32_t best = 0;
  double most = dot(points[0], n);
  for (std::uint32_t i = 1; i < points.size(); ++i)
    if (const double at = dot(points[i], n); at > most) most = at, best = i;
  return best;
}

// The nearest points of a simplex; a(i) and b(i) are its points on the cores.
template <class A, class B>
std::optional<WitnessPoints> witness_of(const Gjk<double>& g, const A& a, const B& b) {
  if (g.end == Gjk<double>::code(GjkEnd::kEncloses) || g.simplex.size < 1 || g.simplex.size > 3) return {};
  WitnessPoints points{{0, 0, 0}, {0, 0, 0}};
  double sum = 0;
  for (int i = 0; i < g.simplex.size; ++i) sum += g.simplex.weight[i];
  for (int i = 0; i < g.simplex.size; ++i) {
    const double share = g.simplex.weight[i] / sum;
    points.a = points.a + a(g.simplex.vertex[i].a) * share;
    points.b = points.b + b(g.simplex.vertex[i].b) * share;
  }
  return points;
}

GjkLimits<double> to_the_end() {
  GjkLimits<double> limits;
  limits.rel_tol = 0;
  return limits;
}

}  // namespace

std::optional<WitnessPoints> nearest_points(std::span<const Vec3d> a, std::span<const Vec3d> b, const Vec3d& toward) {
  const auto cso = [&](const Vec3d& v) {
    const std::uint32_t i = farthest_along(a, -v), j = farthest_along(b, v);
    const Vec3d w = a[i] - b[j];
    return CsoSupport<double>{{w, i, j}, dot(v, w)};
  };
  const Gjk<double> g = gjk(cso, -toward, Simplex<double>{}, to_the_end());
  return witness_of(g, [&](std::uint32_t i) { return a[i]; }, [&](std::uint32_t i) { return b[i]; });
}

Vec3d FeaturePair::Side::farthest(const Vec3d& n) const {
  return pose.R_wb * part.vertices[farthest_along(part.vertices, pose.R_wb.transpose_times(n))] + shift;
}

Feature FeaturePair::Side::flat_feature(const Vec3d& n, const Vec3d& point, double tolerance,
                                        bool wants_interior) const {
  if (is_half_space(part)) return plane_feature(n);
  Feature f = feature_at(part.vertices, pose.R_wb.transpose_times(n), pose.R_wb.transpose_times(point - shift),
                         tolerance, wants_interior);
  for (Vec3d& tangent : f.tangent) tangent = pose.R_wb * tangent;
  return f;
}

double FeaturePair::Side::cone_radius(const Vec3d& n, const Vec3d& point, double distance,
                                      std::span<const Vec3d> spanned, double tolerance) const {
  if (part.primitive) return __builtin_inf();
  const Vec3d outward = pose.R_wb.transpose_times(n), from = pose.R_wb.transpose_times(point - shift);
  Vec3d axes[2];
  for (std::size_t k = 0; k < spanned.size(); ++k) axes[k] = pose.R_wb.transpose_times(spanned[k]);
  double gap_squared = 1, arm_squared = 0;  // of the vertex with the least quotient
  double least_gap = __builtin_inf();
  for (const Vec3d& v : part.vertices) {
    Vec3d arm = from - v;
    const double gap = dot(outward, arm);
    if (gap <= tolerance) continue;
    least_gap = std::min(least_gap, gap);
    for (std::size_t k = 0; k < spanned.size(); ++k) arm = arm - axes[k] * dot(arm, axes[k]);
    const double square = squared_norm(arm);
    if (gap * gap * arm_squared < gap_squared * square) gap_squared = gap * gap, arm_squared = square;
  }
  return std::min(distance * std::sqrt(gap_squared / arm_squared), least_gap / 2);
}

void FeaturePair::take_points(const Vec3d& a, const Vec3d& b) {
  point_a_ = a;
  point_b_ = b;
  distance_ = norm(b - a);
  normal_ = (b - a) * (1 / distance_);
}

std::optional<FeaturePair> FeaturePair::find(const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b,
                                             const PoseMatrix& pose_b, const WitnessPoints& start, const Vec3d& toward,
                                             bool wants_radius) {
  if (is_half_space(a) && is_half_space(b)) return {};
  const bool round = is_round(a) || is_round(b);
  Side of_a(a, pose_a, pose_a.t_w, round), of_b(b, pose_b, pose_a.t_w, round);
  return round ? find_round(of_a, of_b, start, toward) : find_flat(of_a, of_b, toward, wants_radius);
}

std::optional<WitnessPoints> FeaturePair::flat_points(const Side& a, const Side& b, const Vec3d& toward) {
  if (is_half_space(a.part)) {
    const Vec3d p = b.farthest(-a.outward());
    return WitnessPoints{a.foot(p), p};
  }
  if (is_half_space(b.part)) {
    const Vec3d p = a.farthest(-b.outward());
    return WitnessPoints{p, b.foot(p)};
  }
  const PlacedPair<double> pair(a.part, a.pose.R_wb, a.shift, b.part, b.pose.R_wb, b.shift);
  const Gjk<double> g =
      gjk(SupportedCso<double>(pair, nullptr), a.pose.R_wb.transpose_times(-toward), Simplex<double>{}, to_the_end());
  return witness_of(
      g, [&](std::uint32_t i) { return a.pose.R_wb * a.part.vertices[i] + a.shift; },
      [&](std::uint32_t i) { return b.pose.R_wb * b.part.vertices[i] + b.shift; });
}

std::optional<FeaturePair> FeaturePair::find_flat(const Side& a, const Side& b, const Vec3d& toward,
                                                  bool wants_radius) {
  const std::optional<WitnessPoints> points = flat_points(a, b, toward);
  if (!points) return {};
  FeaturePair pair;
  pair.take_points(points->a, points->b);
  const double reach =
      2 * std::max(is_half_space(a.part) ? 0 : a.part.spread, is_half_space(b.part) ? 0 : b.part.spread);
  const double scale = reach + norm(points->a) + norm(points->b) + norm(b.shift);
  if (!(pair.distance_ > 64 * kFeatureEpsilon * scale)) return {};
  // A vertex below a plane is no feature of separated cores.
  if (is_half_space(a.part) && dot(a.outward(), pair.normal_) < 0) return {};
  if (is_half_space(b.part) && dot(b.outward(), pair.normal_) > 0) return {};
  const double tolerance = 32 * kFeatureEpsilon * scale * (1 + reach / pair.distance_);
  pair.a_ = a.flat_feature(pair.normal_, points->a, tolerance, wants_radius);
  pair.b_ = b.flat_feature(-pair.normal_, points->b, tolerance, wants_radius);
  pair.factorise();
  pair.polish();
  if (wants_radius) pair.set_radius(a, b, tolerance);
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

void FeaturePair::set_radius(const Side& a, const Side& b, double tolerance) {
  const bool are_edges = a_.size == 1 && b_.size == 1;
  const double interior =
      std::min(a_.interior, b_.interior) * (are_edges ? norm(cross(a_.tangent[0], b_.tangent[0])) : 1);
  bool is_one = interior > tolerance;  // otherwise one of several features
  for (int k = 0; k < slides(); ++k) is_one = is_one && factor_[k][k] > 0;
  if (!is_one) return;
  Vec3d axes[2];
  std::size_t count = 0;
  for (int k = 0; k < slides(); ++k) {
    Vec3d rest = along(k);
    for (std::size_t i = 0; i < count; ++i) rest = rest - axes[i] * dot(axes[i], rest);
    if (const double length = norm(rest); count < 2 && length * length > kDependent)
      axes[count++] = rest * (1 / length);
  }
  const std::span<const Vec3d> spanned(axes, count);
  smooth_radius_ = std::min({interior, a.cone_radius(normal_, point_a_, distance_, spanned, tolerance),
                             b.cone_radius(-normal_, point_b_, distance_, spanned, tolerance)});
  if (smooth_radius_ <= kSame * tolerance) smooth_radius_ = 0;
}

Vec3d FeaturePair::lean(const Vec3d& lean_a, const Vec3d& lean_b, bool begin_with_a) const {
  Vec3d sum{0, 0, 0}, axes[2];
  int count = 0;
  for (int i = 0; i < slides() && count < 2; ++i) {
    const int k = begin_with_a ? (i + b_.size) % slides() : i;
    const Vec3d tangent = along(k), given = k < b_.size ? lean_b : lean_a;
    Vec3d rest = tangent - normal_ * dot(tangent, normal_);
    for (int n = 0; n < count; ++n) rest = rest - axes[n] * dot(axes[n], rest);
    const double square = squared_norm(rest);
    if (!(square > 1e-10)) continue;
    axes[count++] = rest * (1 / std::sqrt(square));
    sum = sum - rest * (dot(tangent, given + sum) / square);
  }
  return sum;
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
