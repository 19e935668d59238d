#include "engine/evaluate/feature.h"

#include <algorithm>
#include <cmath>

namespace clearance {

namespace {

struct Point2 {
  double x, y;
};

double side_of(const Point2& o, const Point2& p, const Point2& q) {
  return (p.x - o.x) * (q.y - o.y) - (p.y - o.y) * (q.x - o.x);
}

// Distance of the origin from the boundary of the convex hull of points, negative outside.
double interior_of(std::vector<Point2> points) {
  std::sort(points.begin(), points.end(),
            [](const Point2& p, const Point2& q) { return p.x < q.x || (p.x == q.x && p.y < q.y); });
  double least = __builtin_inf();
  for (int side = 0; side < 2; ++side) {  // the lower, then the upper chain
    std::vector<Point2> chain;
    for (const Point2& p : points) {
      while (chain.size() > 1 && side_of(chain[chain.size() - 2], chain.back(), p) <= 0) chain.pop_back();
      chain.push_back(p);
    }
    for (std::size_t i = 1; i < chain.size(); ++i) {
      const double length = std::hypot(chain[i].x - chain[i - 1].x, chain[i].y - chain[i - 1].y);
      if (length > 0) least = std::min(least, side_of(chain[i - 1], chain[i], {0, 0}) / length);
    }
    std::reverse(points.begin(), points.end());
  }
  return least;
}

// The part of v normal to a unit vector.
Vec3d flattened(const Vec3d& v, const Vec3d& unit) {
  return v - unit * dot(v, unit);
}

}  // namespace

std::vector<Vec3d> placed_vertices(const ConvexPart& part, const PoseMatrix& pose, const Vec3d& origin) {
  std::vector<Vec3d> placed;
  if (part.primitive) return placed;
  placed.reserve(part.vertices.size());
  const Vec3d shift = pose.t_w - origin;
  for (const Vec3d& v : part.vertices) placed.push_back(pose.R_wb * v + shift);
  return placed;
}

Feature plane_feature(const Vec3d& normal) {
  Feature plane;
  const bool is_x = std::abs(normal.x) < 0.6;
  const Vec3d first = flattened(is_x ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0}, normal);
  plane.size = 2;
  plane.tangent[0] = first * (1 / norm(first));
  plane.tangent[1] = cross(normal, plane.tangent[0]);
  return plane;
}

Feature feature_at(std::span<const Vec3d> vertices, const Vec3d& outward, const Vec3d& point, double tolerance,
                   bool wants_interior) {
  constexpr std::size_t kFew = 8;
  Feature feature;
  std::vector<Vec3d> arms;  // from the witness point to the vertices on the plane
  arms.reserve(kFew);
  double longest = 0, widest = 0;
  Vec3d first{0, 0, 0}, farthest{0, 0, 0};
  for (const Vec3d& v : vertices) {
    const Vec3d arm = v - point;
    if (dot(outward, arm) < -tolerance) continue;
    arms.push_back(flattened(arm, outward));
  }
  for (const Vec3d& arm : arms)
    if (const double length = norm(arm - arms[0]); length > longest) longest = length, first = arm - arms[0];
  if (longest <= tolerance) return feature;
  feature.tangent[0] = first * (1 / longest);
  for (const Vec3d& arm : arms)
    if (const Vec3d rest = flattened(arm - arms[0], feature.tangent[0]); norm(rest) > widest)
      widest = norm(rest), farthest = rest;
  if (widest <= tolerance) {
    feature.size = 1;
    double low = 0, high = 0;
    for (const Vec3d& arm : arms) {
      const double at = dot(feature.tangent[0], arm);
      low = std::min(low, at), high = std::max(high, at);
    }
    feature.interior = std::min(-low, high);
    return feature;
  }
  feature.size = 2;
  feature.tangent[1] = farthest * (1 / widest);
  if (!wants_interior) return feature;
  std::vector<Point2> flat;
  for (const Vec3d& arm : arms) flat.push_back({dot(feature.tangent[0], arm), dot(feature.tangent[1], arm)});
  feature.interior = interior_of(std::move(flat));
  return feature;
}

}  // namespace clearance
