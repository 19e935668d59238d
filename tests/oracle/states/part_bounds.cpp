#include "tests/oracle/states/part_bounds.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "engine/hull/shapes.h"

namespace clearance::exact {

PartBounds hull_bounds(std::vector<Vec3d> vertices, double radius) {
  return {vertices, vertices, radius, 0};
}

PartBounds box_bounds(const Vec3d& size) {
  return hull_bounds(make_box(size).vertices);
}

PartBounds capsule_bounds(double radius, double length) {
  return hull_bounds({{0, 0, -length / 2}, {0, 0, length / 2}}, radius);
}

PartBounds cylinder_bounds(double radius, double length) {
  PartBounds bounds;
  for (int k = 0; k < kCylinderSides; ++k) {
    const double angle = 2 * std::numbers::pi * k / kCylinderSides;
    for (const double end : {-0.5, 0.5}) {
      const double in = radius * (1 - 1e-14), out = in / std::cos(std::numbers::pi / kCylinderSides) * (1 + 1e-13);
      bounds.outer.push_back({out * std::cos(angle), out * std::sin(angle), end * length});
      bounds.inner.push_back({in * std::cos(angle), in * std::sin(angle), end * length});
    }
  }
  return bounds;
}

PartBounds moved(PartBounds bounds, const Vec3d& by) {
  for (auto* vertices : {&bounds.outer, &bounds.inner})
    for (Vec3d& v : *vertices) v += by;
  return bounds;
}

namespace {

double reach(const PartBounds& bounds) {
  double most = 0;
  for (const Vec3d& v : bounds.outer) most = std::max(most, norm(v) + bounds.radius);
  return most;
}

}  // namespace

PartBounds grown(PartBounds bounds, double padding, const Uncertainty& uncertainty) {
  bounds.radius += padding;
  bounds.turn = uncertainty.angle * reach(bounds);
  bounds.radius += uncertainty.position;
  return bounds;
}

std::vector<Vec3d> random_points(Random& random, int count, const Vec3d& half) {
  std::vector<Vec3d> points;
  for (int i = 0; i < count; ++i) {
    Vec3d d = random.direction();
    for (int k = 0; k < 3; ++k) d[k] = std::round(d[k] * half[k] * 1024) / 1024;
    points.push_back(d);
  }
  return points;
}

}  // namespace clearance::exact
