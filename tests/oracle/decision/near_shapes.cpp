#include "tests/oracle/decision/near_shapes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "engine/hull/shapes.h"
#include "tests/engine/crowded_arm.h"

namespace clearance::exact {
namespace {

double beyond(double along, double half) {
  return std::max(std::abs(along) - half, 0.0);
}
double from_box(const Vec3d& p, const Vec3d& half) {
  return norm(Vec3d{beyond(p.x, half.x), beyond(p.y, half.y), beyond(p.z, half.z)});
}
double from_segment(const Vec3d& p, const Vec3d& a, const Vec3d& b) {
  const Vec3d along = b - a;
  return norm(p - a - along * std::clamp(dot(p - a, along) / dot(along, along), 0.0, 1.0));
}
double from_triangle(const Vec3d& p, const std::array<Vec3d, 3>& v) {
  const Vec3d n = cross(v[1] - v[0], v[2] - v[0]);
  double least = HUGE_VAL;
  bool is_over = true;
  for (std::size_t i = 0; i < 3; ++i) {
    const Vec3d &a = v[i], &b = v[(i + 1) % 3];
    is_over &= dot(cross(b - a, p - a), n) >= 0;
    least = std::min(least, from_segment(p, a, b));
  }
  return is_over ? std::abs(dot(p - v[0], n)) / norm(n) : least;
}

// A cone about the origin is a triangle in the plane of its axis and the point.
double from_cone(const Vec3d& p, double radius, double length) {
  const double half = length / 2, out = std::hypot(p.x, p.y);
  if (std::abs(p.z) <= half && out * length <= radius * (half - p.z)) return 0;
  const Vec3d at{out, 0, p.z}, rim{radius, 0, -half};
  return std::min(from_segment(at, {0, 0, -half}, rim), from_segment(at, rim, {0, 0, half}));
}

// The nearest point is x[k] = e[k]^2 p[k] / (t + e[k]^2), with the t that puts it onto the ellipsoid.
double from_ellipsoid(const Vec3d& p, const Vec3d& e) {
  const auto nearest = [&](double t) {
    Vec3d x;
    for (int k = 0; k < 3; ++k) x[k] = e[k] * e[k] * p[k] / (t + e[k] * e[k]);
    return x;
  };
  const auto is_out = [&](const Vec3d& x) {
    return dot(Vec3d{x.x / e.x, x.y / e.y, x.z / e.z}, Vec3d{x.x / e.x, x.y / e.y, x.z / e.z}) > 1;
  };
  if (!is_out(p)) return 0;
  double low = 0, high = norm(p) * std::max({e.x, e.y, e.z});
  for (int n = 0; n < 100; ++n) {
    const double middle = (low + high) / 2;
    (is_out(nearest(middle)) ? low : high) = middle;
  }
  return norm(p - nearest(high));
}

// A cube of edge 2 about the origin, sheared.
constexpr Vec3d kEdges[3] = {{0.08, 0, 0.01}, {0.03, 0.05, 0}, {-0.02, 0.02, 0.09}};

std::vector<Vec3d> corners_of_hull() {
  std::vector<Vec3d> corners;
  for (int c = 0; c < 8; ++c)
    corners.push_back(kEdges[0] * (c & 1 ? 1.0 : -1.0) + kEdges[1] * (c & 2 ? 1.0 : -1.0) +
                      kEdges[2] * (c & 4 ? 1.0 : -1.0));
  return corners;
}
double from_hull(const Vec3d& p) {
  static const std::vector<Vec3d> v = corners_of_hull();
  double least = HUGE_VAL;
  bool is_in = true;
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3d n = cross(kEdges[(k + 1) % 3], kEdges[(k + 2) % 3]);
    is_in &= std::abs(dot(p, n)) <= std::abs(dot(kEdges[k], n));
    const std::size_t to[2] = {std::size_t{1} << (k + 1) % 3, std::size_t{1} << (k + 2) % 3};
    for (const std::size_t at : {std::size_t{0}, std::size_t{1} << k})
      for (const std::size_t side : to)
        least = std::min(least, from_triangle(p, {v[at], v[at | side], v[at | to[0] | to[1]]}));
  }
  return is_in ? 0 : least;
}

constexpr double kVoxel = 0.03125, kPointRadius = 0.015625;
const std::vector<CloudPoint> kCloud = {
    {0, 0, 0}, {0.0625f, 0.03125f, 0}, {0, 0.0625f, 0.09375f}, {-0.0625f, 0, 0.125f}};

template <class Distance>
double from_cloud(const Vec3d& p, const Distance& distance) {
  double least = HUGE_VAL;
  for (const CloudPoint& c : kCloud) least = std::min(least, distance(p - Vec3d{c[0], c[1], c[2]}));
  return least;
}

const Vec3d kSheet[4] = {{0, 0, 0}, {0.25, 0, 0}, {0, 0.125, 0}, {0.25, 0.125, 0.0625}};

double from_sheet(const Vec3d& p) {
  return std::min(from_triangle(p, {kSheet[0], kSheet[1], kSheet[2]}),
                  from_triangle(p, {kSheet[1], kSheet[3], kSheet[2]}));
}
void add_sheet(engine::Scene& scene) {
  const Triangle triangles[] = {{0, 1, 2}, {1, 3, 2}};
  scene.add_mesh("s", kSheet, triangles, MeshAs::kSurface, {});
}

double from_step(const Vec3d& p) {
  return std::min(from_box(p, {0.15, 0.15, 0.05}), from_box(p - Vec3d{0.1, 0, 0.15}, {0.05, 0.15, 0.15}));
}
void add_step(engine::Scene& scene) {
  const Shape step = test::step_mesh();
  scene.add_mesh("s", step.vertices, step.triangles, MeshAs::kSolid, {});
}

using Scene = engine::Scene;
constexpr struct {
  const char* name;
  void (*add)(Scene& scene);
  double (*distance)(const Vec3d& p);
} kKinds[] = {
    {"sphere", [](Scene& s) { s.add_sphere("s", 0.0625, {}); }, [](const Vec3d& p) { return norm(p) - 0.0625; }},
    {"capsule", [](Scene& s) { s.add_capsule("s", 0.03125, 0.25, {}); },
     [](const Vec3d& p) { return from_box(p, {0, 0, 0.125}) - 0.03125; }},
    {"box", [](Scene& s) { s.add_box("s", {0.25, 0.125, 0.0625}, {}); },
     [](const Vec3d& p) { return from_box(p, {0.125, 0.0625, 0.03125}); }},
    {"cylinder", [](Scene& s) { s.add_cylinder("s", 0.0625, 0.25, {}); },
     [](const Vec3d& p) { return std::hypot(beyond(std::hypot(p.x, p.y), 0.0625), beyond(p.z, 0.125)); }},
    {"half-space", [](Scene& s) { s.add_half_space("s", {.pose = Pose{}}); }, [](const Vec3d& p) { return p.z; }},
    {"hull", [](Scene& s) { s.add_hull("s", corners_of_hull(), {}); }, from_hull},
    {"cone", [](Scene& s) { s.add_cone("s", 0.0625, 0.25, {}); },
     [](const Vec3d& p) { return from_cone(p, 0.0625, 0.25); }},
    {"ellipsoid", [](Scene& s) { s.add_ellipsoid("s", {0.03125, 0.0625, 0.125}, {}); },
     [](const Vec3d& p) { return from_ellipsoid(p, {0.03125, 0.0625, 0.125}); }},
    {"solid", add_step, from_step},
    {"surface", add_sheet, from_sheet},
    {"points", [](Scene& s) { s.add_points("s", kCloud, 0, {.radius = kPointRadius}); },
     [](const Vec3d& p) { return from_cloud(p, [](const Vec3d& d) { return norm(d) - kPointRadius; }); }},
    {"voxels", [](Scene& s) { s.add_points("s", kCloud, kVoxel, {}); },
     [](const Vec3d& p) {
       return from_cloud(p, [](const Vec3d& d) { return from_box(d, Vec3d{1, 1, 1} * (kVoxel / 2)); });
     }},
};

}  // namespace

std::span<const NearShape> near_shapes() {
  static const std::vector<NearShape> shapes = [] {
    std::vector<NearShape> made;
    for (const auto& kind : kKinds) {
      Scene scene;
      kind.add(scene);
      made.push_back({kind.name, scene.bodies()[0], kind.distance});
    }
    return made;
  }();
  return shapes;
}

}  // namespace clearance::exact
