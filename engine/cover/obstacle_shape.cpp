#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "engine/base/fp_environment.h"
#include "engine/cover/fan.h"
#include "engine/cover/obstacle.h"
#include "engine/hull/primitive.h"
#include "engine/hull/support.h"

namespace clearance {

namespace {

constexpr double kFarthestCore = 1e6;         // metres: squares in float32 neither overflow nor lose meaning
constexpr std::size_t kMostHullCorners = 34;  // a hull of 34 vertices has at most 64 triangles
// More than every rounding of a sum of three products, relative to the sum of their magnitudes.
constexpr double kSumRounding = 0x1p-49;
constexpr double kLonger = 1 + 0x1p-48, kShorterNormal = 1 - 0x1p-48;

/// Upper bound on the length of a vector.
double length_above(const Vec3d& v) {
  return norm(v) * kLonger + std::numeric_limits<double>::min();
}

/// Upper bound on the reach of a core along a direction.
using Reach = std::function<double(const Vec3d& n)>;

/// At most 34 of the points, each as far as possible from those before it. Of very many points, only some are tried.
std::vector<Vec3d> spread_points(const std::vector<Vec3d>& all, const Vec3d& centre) {
  if (all.size() <= kMostHullCorners) return all;
  constexpr std::size_t kMostTried = 2048;
  const std::size_t step = (all.size() + kMostTried - 1) / kMostTried;
  std::vector<Vec3d> points;
  for (std::size_t i = 0; i < all.size(); i += step) points.push_back(all[i]);
  std::vector<double> away;
  for (const Vec3d& p : points) away.push_back(squared_norm(p - centre));
  std::vector<Vec3d> chosen;
  while (chosen.size() < kMostHullCorners) {
    const Vec3d next = points[static_cast<std::size_t>(std::max_element(away.begin(), away.end()) - away.begin())];
    for (std::size_t i = 0; i < points.size(); ++i) {
      const double distance = squared_norm(points[i] - next);
      away[i] = chosen.empty() ? distance : std::min(away[i], distance);
    }
    chosen.push_back(next);
  }
  return chosen;
}

/// Planes of the hull of some points of the core, moved outwards until they hold the core. The fan's tetrahedra are
/// points x with n . x <= the least n . v of the face's corners v, for any n that puts the centre below that height.
/// \param off bound on the distance of the points from the core
bool take_planes(ObstacleShape& shape, const std::vector<Vec3d>& points, double off, const Reach& reach) {
  const std::optional<Fan> fan = fan_of(points);
  if (!fan) return false;
  shape.centre = fan->points.back();
  const double rounding = kSumRounding * (3 * shape.reach + length_above(shape.centre)) + off;
  for (const auto& face : fan->parts) {
    const Vec3d &a = fan->points[face[0]], &b = fan->points[face[1]], &c = fan->points[face[2]];
    const Vec3d across = cross(b - a, c - a);
    const double size = norm(across);
    if (!(size > 0)) return false;
    const Vec3d n = across * (kShorterNormal / size);
    const double middle = dot(n, shape.centre), inner = std::min({dot(n, a), dot(n, b), dot(n, c)}) - middle - rounding;
    shape.planes.push_back({n, reach(n) - middle + rounding, inner});
  }
  return true;
}

/// The planes of a box about a hull without volume, along its own axes.
void take_box(ObstacleShape& shape, const std::vector<Vec3d>& vertices, const Reach& reach) {
  const auto farthest_from = [&](const auto& measure) {
    return *std::max_element(vertices.begin(), vertices.end(),
                             [&](const Vec3d& p, const Vec3d& q) { return measure(p) < measure(q); });
  };
  const Vec3d origin = vertices.front();
  const Vec3d along = farthest_from([&](const Vec3d& p) { return squared_norm(p - origin); }) - origin;
  const Vec3d other = farthest_from([&](const Vec3d& p) { return squared_norm(cross(along, p - origin)); }) - origin;
  const Vec3d up = cross(along, other);
  shape.centre = {0, 0, 0};
  for (const Vec3d& v : vertices) shape.centre += v * (1.0 / static_cast<double>(vertices.size()));
  const double rounding = kSumRounding * 4 * shape.reach;
  const Mat3d axes = Mat3d::identity(), own{{along, cross(up, along), up}};
  for (int k = 0; k < 3; ++k) {
    const double size = norm(own.row[k]);
    for (const double sign : {kShorterNormal, -kShorterNormal}) {
      const Vec3d n = size > 1e-30 ? own.row[k] * (sign / size) : axes.row[k] * sign;
      // No point is proved to be in the core but the centre.
      shape.planes.push_back({n, reach(n) - dot(n, shape.centre) + rounding, -1.0});
    }
  }
}

void take_hull(ObstacleShape& shape, const ConvexPart& part) {
  const Reach reach = [&](const Vec3d& n) { return support(part, n).value; };
  if (take_planes(shape, spread_points(part.vertices, part.centre), 0, reach)) return;
  shape.planes.clear();
  take_box(shape, part.vertices, reach);
}

/// Planes of the hull of points of a cone's or ellipsoid's surface.
bool take_round(ObstacleShape& shape, const Primitive& core) {
  std::vector<Vec3d> points;
  for (int ring = 0; ring <= 4; ++ring) {
    const double up = M_PI / 4 * ring;
    for (int step = 0; step < (ring % 4 == 0 ? 1 : 10); ++step) {
      const double turn = M_PI / 5 * step;
      const Vec3d n{std::sin(up) * std::cos(turn), std::sin(up) * std::sin(turn), std::cos(up)};
      // As a direction of the unit sphere that the core's size scales, so that the points are spread over it.
      points.push_back(farthest(core, Vec3d{n.x / core.size.x, n.y / core.size.y, n.z / core.size.z}).point);
    }
  }
  return take_planes(shape, points, 0x1p-49 * shape.reach, [&](const Vec3d& n) { return farthest(core, n).value; });
}

/// Takes vertices that are exactly the corners of a box along the axes, or of a rectangle or segment.
bool take_aligned(ObstacleShape& shape, const std::vector<Vec3d>& vertices) {
  Vec3d low = vertices.front(), high = low;
  for (const Vec3d& v : vertices)
    for (int k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], v[k]);
      high[k] = std::max(high[k], v[k]);
    }
  unsigned thick = 0, found = 0;  // bits of axes, and of corners
  for (int k = 0; k < 3; ++k) thick |= low[k] < high[k] ? 1u << k : 0;
  for (const Vec3d& v : vertices) {
    unsigned corner = 0;
    for (int k = 0; k < 3; ++k) {
      if (v[k] != low[k] && v[k] != high[k]) return false;
      if (v[k] != low[k]) corner |= 1u << k;
    }
    found |= 1u << corner;
  }
  for (unsigned corner = 0; corner < 8; ++corner)
    if ((corner & ~thick) == 0 && !(found >> corner & 1)) return false;
  shape.kind = Obstacle::Kind::kBox;
  shape.centre = low * 0.5 + high * 0.5;
  shape.half = high * 0.5 - low * 0.5;
  return true;
}

/// The segment between two points.
void take_segment(ObstacleShape& shape, const Vec3d& a, const Vec3d& b) {
  shape.kind = Obstacle::Kind::kSegment;
  shape.centre = a * 0.5 + b * 0.5;
  const Vec3d along = b - a;
  const double length = norm(along);
  if (!(length > 1e-30)) return;  // less than what every error is charged
  shape.half.z = 0.5 * length;
  const Vec3d z = along * (1 / length);
  const int least =
      std::abs(z.x) < std::abs(z.y) ? (std::abs(z.x) < std::abs(z.z) ? 0 : 2) : (std::abs(z.y) < std::abs(z.z) ? 1 : 2);
  Vec3d axis{0, 0, 0};
  axis[least] = 1;
  const Vec3d across = cross(axis, z), x = across * (1 / norm(across));
  shape.axes = {{x, cross(z, x), z}};
}

void take_cloud(ObstacleShape& shape, const SurfacePtr& cloud) {
  const double half = 0.5 * double{cloud->edge()};
  shape.kind = Obstacle::Kind::kCloud;
  shape.half = {half, half, half};
  shape.cloud = cloud;
}

bool take_primitive(ObstacleShape& shape, const Primitive& core) {
  switch (core.kind) {
    case Primitive::Kind::kHalfSpace:
      shape.kind = Obstacle::Kind::kHalfSpace;
      return true;
    case Primitive::Kind::kCylinder:
      shape.kind = Obstacle::Kind::kCylinder;
      shape.half = core.size;
      return true;
    default:
      return take_round(shape, core);
  }
}

}  // namespace

std::optional<ObstacleShape> obstacle_shape(const ConvexPart& part) {
  const FpEnvironment environment;
  if ((part.surface && !part.surface->is_cloud()) || !(part.rho + part.radius <= kFarthestCore)) return {};
  ObstacleShape shape;
  shape.kind = Obstacle::Kind::kPlanes;
  shape.radius = part.radius;
  shape.reach = is_half_space(part) ? 0 : part.rho;
  if (part.surface) {
    take_cloud(shape, part.surface);
  } else if (part.primitive) {
    if (!take_primitive(shape, *part.primitive)) return {};
  } else if (part.vertices.size() <= 2) {
    take_segment(shape, part.vertices.front(), part.vertices.back());
  } else if (!take_aligned(shape, part.vertices)) {
    take_hull(shape, part);
  }
  for (const Vec3d& v : part.vertices) shape.spread = std::max(shape.spread, length_above(v - shape.centre));
  if (part.primitive) shape.spread = shape.reach + length_above(shape.centre);
  return shape;
}

}  // namespace clearance
