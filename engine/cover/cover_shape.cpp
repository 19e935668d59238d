#include "engine/cover/cover_shape.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/base/fp_environment.h"
#include "engine/cover/fan.h"
#include "engine/cover/mesh/mesh_cells.h"
#include "engine/cover/mesh/mesh_depth.h"
#include "engine/cover/round_core.h"
#include "engine/hull/primitive.h"

namespace clearance {

namespace {

constexpr double kRounding = kCoverRounding, kUp = kCoverUp;

/// Vertices of all parts together, above which large hulls are replaced by hulls of fewer vertices.
constexpr std::size_t kMostVertices = 1500, kMostOfPart = 400, kLeastOfPart = 32;
/// Hulls of more vertices are not divided into a fan, which takes quadratic time.
constexpr std::size_t kMostOfFan = 2000;
/// Cells of all meshes together, and of one at least.
constexpr std::size_t kMostCells = 600, kLeastCells = 100;
/// A cell's hull is replaced by one of fewer vertices that it exceeds by at most this share of the mesh's size, if
/// enough.
constexpr double kExcessOfCell = 0x1p-10;
constexpr std::size_t kLeastOfCell = 12;
/// Vertices of a hull without volume, to which distances are computed.
constexpr std::size_t kMostOfFlat = 48;
/// Metres. No covers of larger bodies: squares of float32 would overflow. No thin hulls around smaller ones.
constexpr double kMaxReach = 1e9, kLeastSize = 1e-40;
/// Bodies of more parts, meshes of more triangles and clouds of more points have no cover, which would take long.
constexpr std::size_t kMostParts = 300;
constexpr std::uint32_t kMostTriangles = 1u << 21, kMostPoints = 1u << 17;

double length(const Vec3d& v) {
  return norm(v) * kUp + kCoverTiny;
}

/// Upper bound on the distance of `c` from a point of the segment, the nearest one as computed.
double to_segment(const std::array<Vec3d, 2>& ends, const Vec3d& c) {
  const Vec3d along = ends[1] - ends[0];
  const double squared = dot(along, along);
  const double t = squared > 0 ? std::clamp(dot(c - ends[0], along) / squared, 0.0, 1.0) : 0.0;
  // The point of the segment at t, within the rounding of its own coordinates.
  const Vec3d p = ends[0] * (1 - t) + ends[1] * t;
  return length(c - p) + kRounding * (norm(ends[0]) + norm(ends[1]));
}

/// Upper bound on the distance of `c` from a hull, by a few steps towards the nearest point.
double to_hull(std::span<const Vec3d> vertices, const Vec3d& c) {
  if (vertices.size() <= 2) return to_segment({vertices.front(), vertices.back()}, c);
  constexpr int kSteps = 12;
  Vec3d p = vertices[0];
  double reach = 0;
  for (const Vec3d& v : vertices) {
    if (squared_norm(v - c) < squared_norm(p - c)) p = v;
    reach = std::max(reach, squared_norm(v));
  }
  for (int step = 0; step < kSteps; ++step) {
    const Vec3d to_c = c - p;
    Vec3d far = p;
    for (const Vec3d& v : vertices)
      if (dot(v - far, to_c) > 0) far = v;
    const double along = dot(far - p, to_c);
    if (!(along > 0)) break;
    // A point of the segment, within the rounding of its coordinates, which grows with each step.
    const double t = std::min(1.0, along / squared_norm(far - p));
    p = p * (1 - t) + far * t;
  }
  return length(c - p) + kSteps * kRounding * std::sqrt(reach) * kUp + kCoverTiny;
}

/// Some of the vertices, far from each other.
std::vector<Vec3d> spread(std::span<const Vec3d> vertices, std::size_t most) {
  std::vector<Vec3d> taken{vertices[0]};
  std::vector<double> nearest(vertices.size(), std::numeric_limits<double>::infinity());
  while (taken.size() < std::min(most, vertices.size())) {
    for (std::size_t i = 0; i < vertices.size(); ++i)
      nearest[i] = std::min(nearest[i], squared_norm(vertices[i] - taken.back()));
    taken.push_back(vertices[std::max_element(nearest.begin(), nearest.end()) - nearest.begin()]);
  }
  return taken;
}

/// The fan of a hull without volume, or nearly so: of a thin hull around it, in which each vertex lies between two.
std::optional<Fan> fan_around(std::span<const Vec3d> vertices) {
  const Vec3d& a = vertices[0];
  Vec3d b = a, normal{0, 0, 0};
  for (const Vec3d& v : vertices)
    if (squared_norm(v - a) > squared_norm(b - a)) b = v;
  for (const Vec3d& v : vertices)
    if (const Vec3d n = cross(b - a, v - a); squared_norm(n) > squared_norm(normal)) normal = n;
  const double size = norm(b - a), thin = 0x1p-10 * size;
  if (!(size > kLeastSize)) return {};
  const Vec3d along = b - a;
  // Without a plane, any direction across the longest edge.
  const int least = std::abs(along.x) < std::abs(along.y) ? (std::abs(along.x) < std::abs(along.z) ? 0 : 2)
                                                          : (std::abs(along.y) < std::abs(along.z) ? 1 : 2);
  if (!(norm(normal) > 0x1p-30 * size * size)) {
    Vec3d axis{0, 0, 0};
    axis[least] = 1;
    normal = cross(along, axis);
  }
  const Vec3d up = normal * (thin / norm(normal)), other = cross(normal, along);
  const Vec3d side = other * (thin / norm(other));
  std::vector<Vec3d> thick;
  for (const Vec3d& v : vertices) thick.push_back(v + up), thick.push_back(v - up);
  if (std::optional<Fan> fan = fan_of(thick)) return fan;
  for (const Vec3d& v : vertices) thick.push_back(v + side), thick.push_back(v - side);
  return fan_of(thick);
}

/// The point itself, the segment or the triangle of up to three vertices.
Fan fan_of_few(std::span<const Vec3d> vertices) {
  const auto last = static_cast<std::uint32_t>(vertices.size() - 1);
  return {{vertices.begin(), vertices.end()}, {{0, std::min(1u, last), last, last}}, 0};
}

/// A fan, and how far the hull exceeds it.
struct GrownFan {
  Fan fan;
  double excess;  // metres
};

/// The fan of a hull of few vertices that exceeds it by at most `most`, if that can be proved, or else of all.
std::optional<GrownFan> fan_of_cell(std::span<const Vec3d> points, double most) {
  for (std::size_t count = kLeastOfCell; count <= kMostOfPart; count *= 2) {
    std::optional<FewVertices> few = few_vertices(points, count);
    if (!few) break;
    if (few->excess <= most) return GrownFan{std::move(few->fan), few->excess};
    if (count >= points.size()) break;
  }
  if (points.size() > kMostOfFan) return {};
  if (std::optional<Fan> fan = fan_of(points); fan && fan->off <= most) return GrownFan{std::move(*fan), 0};
  double reach = 0;
  for (const Vec3d& p : points) reach = std::max(reach, length(p));
  if (std::optional<Fan> fan = fan_around(points)) return GrownFan{std::move(*fan), 8 * kRounding * reach};
  return {};
}

/// The box around a cell's points.
GrownFan box_of_cell(std::span<const Vec3d> points) {
  Vec3d low = points[0], high = low;
  for (const Vec3d& p : points)
    for (int k = 0; k < 3; ++k) low[k] = std::min(low[k], p[k]), high[k] = std::max(high[k], p[k]);
  ConvexPart box;
  box.centre = (low + high) * 0.5, box.half = (high - low) * 0.5;
  return {box_around(box), 8 * kRounding * (norm(low) + norm(high))};
}

bool has_no_cover(const ConvexPartPtr& part) {
  const Surface* const surface = part->surface.get();
  const bool is_too_large = surface && surface->size() > (surface->is_cloud() ? kMostPoints : kMostTriangles);
  return is_half_space(*part) || is_too_large || !(part->rho + part->radius <= kMaxReach);
}

}  // namespace

std::optional<CoverShape> CoverShape::of(std::span<const ConvexPartPtr> parts) {
  const FpEnvironment environment;
  if (parts.empty() || parts.size() > kMostParts || std::any_of(parts.begin(), parts.end(), has_no_cover)) return {};
  CoverShape shape;
  for (const ConvexPartPtr& part : parts)
    if (part->surface && part->surface->is_cloud())
      shape.add_cloud(*part);
    else if (part->surface)
      shape.add_mesh(*part, std::max(kMostCells / parts.size(), kLeastCells));
    else
      shape.add(*part, std::clamp(kMostVertices / parts.size(), kLeastOfPart, kMostOfPart));
  return shape;
}

void CoverShape::add(const ConvexPart& part, std::size_t most_vertices) {
  reach_ = std::max(reach_, (part.rho + part.radius) * kUp);
  Part added{part.primitive, nullptr, part.vertices, {}, part.radius};
  std::optional<Fan> fan;
  double growth = part.radius;
  if (part.primitive) {
    fan = fan_of(polytope_around(*part.primitive));
  } else if (part.vertices.size() <= 3) {
    fan = fan_of_few(part.vertices);
  } else {
    if (part.vertices.size() > most_vertices)
      if (std::optional<FewVertices> few = few_vertices(part.vertices, most_vertices)) {
        growth = (growth + few->excess) * kUp;
        added.vertices.assign(few->fan.points.begin(), few->fan.points.end() - 1);
        added.planes = std::move(few->planes);
        fan = std::move(few->fan);
      }
    if (!fan && part.vertices.size() <= kMostOfFan && (fan = fan_of(part.vertices))) added.planes = HullPlanes(*fan);
    if (!fan && part.vertices.size() <= kMostOfFan && (fan = fan_around(part.vertices)))
      growth = (growth + 4 * kRounding * part.rho) * kUp;  // of a vertex from the middle of the two
  }
  if (!fan) fan = box_around(part);
  if (added.planes.empty()) added.vertices = spread(added.vertices, kMostOfFlat);
  has_inside_ = has_inside_ || part.radius > 0 || part.primitive || !added.planes.empty();
  parts_.push_back(std::move(added));
  add(*fan, growth);
}

void CoverShape::add_mesh(const ConvexPart& part, std::size_t most_cells) {
  reach_ = std::max(reach_, (part.rho + part.radius) * kUp);
  const MeshCells cells = mesh_cells(*part.surface, most_cells);
  for (const std::vector<Vec3d>& points : cells.points) {
    std::optional<GrownFan> cell;
    if (points.size() <= 3)
      cell = {fan_of_few(points), 0};
    else if (!(cell = fan_of_cell(points, kExcessOfCell * part.spread)))
      cell = box_of_cell(points);
    add(cell->fan, (part.radius + cells.growth + cell->excess) * kUp);
  }
  has_inside_ = has_inside_ || part.radius > 0 || part.surface->is_solid();
  parts_.push_back({nullptr, part.surface, {}, {}, part.radius});
}

void CoverShape::add_cloud(const ConvexPart& part) {
  const Surface& cloud = *part.surface;
  const double growth = (part.radius + std::sqrt(0.75) * cloud.edge() + cloud.rounding()) * kUp;
  for (std::uint32_t i = 0; i < cloud.size(); ++i) {
    const Vec3d p = cloud.point(i);
    simplices_.push_back({{p, p, p, p}, growth});
    reach_ = std::max(reach_, (length(p) + growth) * kUp);
  }
  has_inside_ = has_inside_ || part.radius > 0 || cloud.edge() > 0;
  parts_.push_back({nullptr, part.surface, {}, {}, part.radius});
}

void CoverShape::add(const Fan& fan, double growth) {
  for (const auto& tetrahedron : fan.parts) {
    CoverSimplex simplex{{}, (growth + fan.off) * kUp};
    for (int k = 0; k < 4; ++k) simplex.corner[k] = fan.points[tetrahedron[k]];
    simplices_.push_back(simplex);
    for (const Vec3d& corner : simplex.corner) reach_ = std::max(reach_, (length(corner) + simplex.growth) * kUp);
  }
}

double CoverShape::Part::inside(const Vec3d& c, double enough, std::uint32_t& near) const {
  if (surface && surface->is_cloud()) return depth_in_cloud(*surface, c, near) + radius;
  if (surface) return depth_in_mesh(*surface, c, enough - radius, near) + radius;
  if (core) {
    const double depth = in_core(*core, c);
    return (depth > 0 ? depth : -length(c)) + radius;  // the origin is a point of the core
  }
  if (!planes.empty()) {
    if (const double depth = planes.depth(c); depth > 0) return depth + radius;
    double nearest = std::numeric_limits<double>::infinity();
    for (const Vec3d& v : vertices) nearest = std::min(nearest, squared_norm(c - v));
    return radius - std::sqrt(nearest) * kUp - kCoverTiny;
  }
  return radius - to_hull(vertices, c);
}

double CoverShape::inside(const Vec3d& c, double enough, std::uint32_t& near) const {
  double most = -std::numeric_limits<double>::infinity();
  for (const Part& part : parts_) most = std::max(most, part.inside(c, std::max(enough, most), near));
  return most - 0x1p-50 * std::abs(most);  // the rounding of sums with the radius
}

}  // namespace clearance
