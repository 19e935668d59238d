// How `error` bounds every rounding, with u = 2^-24, D = reach + |at| >= |c - at|, H = |half|, and 1.01 for terms of
// order u^2. A signed distance changes by at most the way that the point moves, and by at most that of the surface.
//   at: u |at|. Difference c - at: u D. Axes: sqrt(3) u D. Their products and sums: 3 sqrt(3) u D.
//   half: u H. Difference from half: u (D + H). Root of squares: 2.5 u D. radius: u radius. Last difference:
//   u (D + H + radius). Squares below the least float: 2^-70.
// A cylinder has two roots of 2 u D each, aligned obstacles no axes. Float64, the pose's rounding included: 2^-45 of
// all lengths. Planes: docs/trust/bounds_covers.md, "Obstacles".
#include "engine/cover/obstacle.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "engine/base/fp_environment.h"

namespace clearance {

namespace {

constexpr double kFarthestPoint = 1e4, kFarthestObstacle = 1e6;  // metres
constexpr double kFloatUnit = 0x1p-24 * 1.01, kUnderflow = 0x1p-70;
constexpr float kBelowAll = 1e7f;  // no point is so far below a plane
constexpr float kHighest = std::numeric_limits<float>::infinity();
/// Axes nearer to a quarter turn than this are taken for one, and the difference is charged.
constexpr double kQuarterTurn = 0x1p-30;

float above(double x) {
  const float f = static_cast<float>(x);
  return static_cast<double>(f) < x ? std::nextafter(f, kHighest) : f;
}
float below(double x) {
  return -above(-x);
}
Vec3d to_float(const Vec3d& v) {
  return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}
std::array<float, 3> floats(const Vec3d& v) {
  return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}

bool is_finite(const Mat3d& m) {
  double sum = 0;
  for (const Vec3d& row : m.row) sum += row.x + row.y + row.z;
  return std::isfinite(sum);
}

/// A signed quarter turn.
struct QuarterTurn {
  std::array<int, 3> column;  ///< of each row's entry that is not 0
  double off;                 ///< of axes from it, in the Frobenius norm of the rows concerned
};
/// The one nearest to axes, from row `first` on.
QuarterTurn nearest_quarter_turn(const Mat3d& axes, int first) {
  QuarterTurn turn{{0, 1, 2}, 0};
  for (int k = first; k < 3; ++k) {
    const Vec3d& row = axes.row[k];
    int& column = turn.column[static_cast<std::size_t>(k)];
    for (int c = 0; c < 3; ++c)
      if (std::abs(row[c]) > std::abs(row[column])) column = c;
    Vec3d rest = row;
    rest[column] = std::abs(row[column]) - 1;
    turn.off += squared_norm(rest);
  }
  turn.off = std::sqrt(turn.off) * (1 + 0x1p-48);
  return turn;
}

/// Aligns an obstacle whose axes are a quarter turn from those of the common frame. Returns the error of that.
double align(Obstacle& o, const Mat3d& axes, double distance) {
  using Kind = Obstacle::Kind;
  o.is_aligned = o.kind == Kind::kSegment && o.half[2] == 0;
  if (o.is_aligned || o.kind == Kind::kHalfSpace || o.kind == Kind::kCloud) return 0;
  const QuarterTurn turn = nearest_quarter_turn(axes, o.kind == Kind::kBox ? 0 : 2);  // others are round about z
  if (!(turn.off < kQuarterTurn) || (o.kind == Kind::kCylinder && turn.column[2] != 2)) return 0;
  o.is_aligned = true;
  if (o.kind == Kind::kSegment && turn.column[2] != 2) {
    std::swap(o.half[2], o.half[static_cast<std::size_t>(turn.column[2])]);
    o.kind = Kind::kBox;
  } else if (o.kind == Kind::kBox) {
    const std::array<float, 3> half = o.half;
    for (std::size_t k = 0; k < 3; ++k) o.half[static_cast<std::size_t>(turn.column[k])] = half[k];
  }
  return turn.off * distance;
}

/// Places the planes; returns the error of their gaps.
double place_planes(Obstacle& o, const ObstacleShape& shape, const Mat3d& rotation, const Vec3d& centre, double reach,
                    double rounding) {
  const Vec3d at{o.at[0], o.at[1], o.at[2]};
  const double far = reach + norm(centre);
  double inner_radius = std::numeric_limits<double>::infinity();
  for (const ObstacleShape::Plane& plane : shape.planes) {
    // Shorter by 4 u, and so not longer than 1 after rounding.
    const Vec3d exact = rotation * plane.normal, n = to_float(exact * (1 - 0x1p-22));
    const double turned = norm(n - exact) * shape.spread * (1 + 0x1p-40) + rounding, middle = dot(n, centre);
    const double outer = middle + plane.outer + turned, inner = middle + plane.inner - turned;
    // The roundings of n . c - inner: three products, three sums.
    const double proved = inner - kFloatUnit * (4 * reach + std::abs(inner));
    o.normal_x.push_back(static_cast<float>(n.x));
    o.normal_y.push_back(static_cast<float>(n.y));
    o.normal_z.push_back(static_cast<float>(n.z));
    o.outer.push_back(above(outer));
    o.inner.push_back(below(proved));
    inner_radius = std::min(inner_radius, static_cast<double>(o.inner.back()) - dot(n, at) - rounding);
  }
  o.inner_radius = std::max(0.0f, below(inner_radius));
  o.outer_radius = above(shape.spread + norm(at - centre) + rounding);
  if (!(o.inner_radius > 0)) std::fill(o.inner.begin(), o.inner.end(), -kBelowAll);
  return kFloatUnit * (9 * far + 3 * shape.spread + 2 * shape.radius);
}

/// Places all other kinds; returns the error of their gaps.
double place_exact(Obstacle& o, const ObstacleShape& shape, const Mat3d& axes, double at, double reach) {
  const double far = reach + at, turned = align(o, axes, far);
  for (int k = 0; k < 9; ++k)
    o.axes[static_cast<std::size_t>(k)] =
        static_cast<float>((o.is_aligned ? Mat3d::identity() : axes).row[k / 3][k % 3]);
  const bool is_cloud = o.kind == Obstacle::Kind::kCloud;
  const double units = (o.is_aligned ? 5.5 : 12.5) + (o.kind == Obstacle::Kind::kCylinder ? 1.5 : is_cloud ? 1 : 0);
  const double of_points = is_cloud ? 8 * shape.reach : 0;
  return turned + kFloatUnit * (units * far + at + of_points + 3 * norm(shape.half) + 2 * shape.radius);
}

}  // namespace

std::optional<Obstacle> make_obstacle(const ObstacleShape& shape, const Mat3d& rotation, const Vec3d& translation,
                                      double reach) {
  const FpEnvironment environment;
  if (!is_finite(rotation) || !(norm(translation) <= kFarthestObstacle) || !(reach >= 0 && reach <= kFarthestPoint))
    return {};
  Vec3d at = rotation * shape.centre + translation;
  Mat3d axes;  // the shape's axes in the common frame
  for (int k = 0; k < 3; ++k) axes.row[k] = rotation * shape.axes.row[k];
  if (shape.kind == Obstacle::Kind::kHalfSpace) at = axes.row[2] * dot(axes.row[2], translation);  // nearest the origin
  Obstacle o;
  o.kind = shape.kind;
  o.at = floats(at);
  o.half = floats(shape.half);
  o.radius = static_cast<float>(shape.radius);
  o.cloud = shape.cloud;
  const double rounding = 0x1p-45 * (reach + norm(at) + norm(translation) + shape.reach + shape.radius) + kUnderflow;
  const double error = o.kind == Obstacle::Kind::kPlanes ? place_planes(o, shape, rotation, at, reach, rounding)
                                                         : place_exact(o, shape, axes, norm(at), reach);
  o.error = above(rounding + error);
  return o;
}

std::optional<Obstacle> make_obstacle(const ConvexPart& part, const Mat3d& rotation, const Vec3d& translation,
                                      double reach) {
  const std::optional<ObstacleShape> shape = obstacle_shape(part);
  return shape ? make_obstacle(*shape, rotation, translation, reach) : std::nullopt;
}

}  // namespace clearance
