#include "engine/hull/hull_excess.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <queue>
#include <vector>

#include "engine/base/dedupe.h"
#include "engine/hull/mesh_rows.h"
#include "engine/hull/support.h"
#include "engine/hull/triangle_tree.h"

namespace clearance {

namespace {

// All lengths are in units of the hull's spread about its centre, in which rounding is a few 1e-15.
constexpr double kRounding = 1e-12;
constexpr double kNegligible = 0.01;  // a bound up to this is not refined
constexpr double kTooMuch = 1.25;     // target ratio of the bound to a distance that was found
constexpr std::size_t kPlanes = 512;  // of the hull, to bound the cells

struct Solid {
  double volume = 0;
  Vec3d centre{0, 0, 0};  // of gravity
};

Solid solid_of(std::span<const Vec3d> vertices, std::span<const Triangle> triangles) {
  Solid solid;
  for (const Triangle& t : triangles) {
    const Vec3d &a = vertices[t[0]], &b = vertices[t[1]], &c = vertices[t[2]];
    const double volume = dot(a, cross(b, c)) / 6;
    solid.volume += volume;
    solid.centre += (a + b + c) * (volume / 4);
  }
  if (solid.volume > 0) solid.centre = solid.centre * (1 / solid.volume);
  return solid;
}

class Measure {
 public:
  Measure(std::span<const Vec3d> vertices, std::span<const Triangle> triangles, const ConvexPart& hull,
          std::span<const Triangle> hull_faces)
      : hull_(hull), hull_faces_(hull_faces) {
    const UniquePositions<double> unique = unique_positions<double>(vertices);
    positions_ = unique.positions;
    for (const Vec3d& v : positions_) points_.push_back(scaled(v));
    for (const Triangle& corners : triangles) {
      const Triangle t = {unique.index[corners[0]], unique.index[corners[1]], unique.index[corners[2]]};
      if (t[0] != t[1] && t[1] != t[2] && t[2] != t[0]) triangles_.push_back(t);
    }
    if (solid_of(points_, triangles_).volume < 0)  // inside out as a whole
      for (Triangle& t : triangles_) std::swap(t[1], t[2]);
  }

  HullExcess run() {
    if (triangles_.empty()) return {};
    const std::optional<double> bound = convex_bound();
    if (bound && *bound <= kNegligible) {
      const double grown = 1 / (1 - *bound), volume = solid_of(points_, triangles_).volume;
      return result(*bound, volume * grown * grown * grown, volume);  // about the centre, which then holds the hull
    }
    const TriangleTree tree(points_, triangles_);
    const double divided = divide(tree) + kRounding;
    return result(bound ? std::min(*bound, divided) : divided, hull_volume(),
                  tree.solid() ? tree.volume() : std::numeric_limits<double>::quiet_NaN());
  }

  std::optional<double> run_convex() const {
    const std::optional<double> bound = convex_bound();
    if (!bound || *bound == 0) return bound;
    return result(*bound + kRounding, 0, 0).distance;
  }

 private:
  struct Plane {
    Vec3d normal;
    double offset;
  };

  Vec3d scaled(const Vec3d& v) const { return (v - hull_.centre) * (1 / hull_.spread); }

  HullExcess result(double distance, double hull, double solid) const {
    const double cube = hull_.spread * hull_.spread * hull_.spread;
    return {distance * hull_.spread * (1 + kRounding), hull * cube, solid * cube};
  }

  // For a mesh whose triangles form a sphere, with planes that give a bound: 0 if it is proved convex.
  std::optional<double> convex_bound() const {
    const MeshRows rows(points_.size(), triangles_);
    if (triangles_.empty() || !rows.is_sphere()) return {};
    const std::optional<double> bound = bound_by_planes(solid_of(points_, triangles_).centre);
    return bound && *bound <= kRounding && rows.is_exactly_convex(positions_) ? std::optional(0.0) : bound;
  }

  // Reach of the hull along a direction of length 1.
  double reach(const Vec3d& n) const {
    return (support(hull_, n).value - dot(n, hull_.centre)) / hull_.spread + rounding_of_place();
  }
  // Rounding for a hull far from its frame's origin.
  double rounding_of_place() const { return 16 * 0x1p-53 * (1 + hull_.rho / hull_.spread); }

  // The points below all planes of the faces lie inside a closed mesh. The hull lies below these planes moved outward
  // by the height of vertices over them, and so within the former, grown about a point there: by B + h where it was B
  // from the plane. Nothing if the point is above a plane.
  std::optional<double> bound_by_planes(const Vec3d& centre) const {
    double worst = 0;
    for (const Triangle& t : triangles_) {
      const Vec3d& a = points_[t[0]];
      const Vec3d ab = points_[t[1]] - a, ac = points_[t[2]] - a, n = cross(ab, ac);
      const double length = norm(n), edge2 = std::max(squared_norm(ab), squared_norm(ac));
      if (!(length > 1e-200)) return {};
      const Vec3d u = n * (1 / length);
      const double tilt = 0x1p-48 * (1 + edge2 / length);  // of the plane of a thin triangle
      const double below = dot(u, a - centre), above = std::max(0.0, reach(u) - dot(u, a)) + tilt;
      if (!(below > 0)) return {};
      worst = std::max(worst, above / (below + above));
    }
    double farthest = 0;
    for (const Vec3d& p : points_) farthest = std::max(farthest, norm(p - centre));
    return farthest * worst;
  }

  double hull_volume() const {
    std::vector<Vec3d> corners;
    corners.reserve(hull_.vertices.size());
    for (const Vec3d& v : hull_.vertices) corners.push_back(scaled(v));
    return solid_of(corners, hull_faces_).volume;
  }

  // Half-spaces that hold the hull: along the axes, the largest faces of the hull and of the mesh, which may be flat.
  std::vector<Plane> planes() const {
    std::vector<std::pair<double, Vec3d>> normals;
    const auto collect = [&normals](const auto& corner, std::span<const Triangle> faces, std::size_t most, bool both) {
      const std::size_t first = normals.size();
      for (const Triangle& t : faces) {
        const Vec3d n = cross(corner(t[1]) - corner(t[0]), corner(t[2]) - corner(t[0]));
        if (norm(n) > 1e-12) normals.push_back({norm(n), n * (1 / norm(n))});
      }
      std::sort(normals.begin() + static_cast<std::ptrdiff_t>(first), normals.end(),
                [](const auto& a, const auto& b) { return a.first > b.first; });
      normals.resize(std::min(normals.size(), first + most));
      for (std::size_t i = normals.size(); both && i-- > first;) normals.push_back({0, -normals[i].second});
    };
    collect([this](std::uint32_t i) { return scaled(hull_.vertices[i]); }, hull_faces_, kPlanes, false);
    collect([this](std::uint32_t i) { return points_[i]; }, triangles_, hull_faces_.empty() ? 32 : 0, true);
    for (int k = 0; k < 3; ++k)
      for (const double sign : {1.0, -1.0}) {
        Vec3d n{0, 0, 0};
        n[k] = sign;
        normals.push_back({0, n});
      }
    std::vector<Plane> out;
    for (const auto& [area, n] : normals) out.push_back({n, reach(n) + kRounding});
    return out;
  }

  // Whether a cell lies beyond one of the walls, and whether its centre is within all.
  static std::pair<bool, bool> place(const std::vector<Plane>& walls, const Vec3d& centre, double half) {
    bool within = true;
    for (const Plane& w : walls) {
      const double above = dot(w.normal, centre) - w.offset;
      if (above > half * (std::abs(w.normal.x) + std::abs(w.normal.y) + std::abs(w.normal.z))) return {true, false};
      within = within && above <= 0;
    }
    return {false, within};
  }

  // No point of a cell is farther from the mesh than the cell's centre and half of its diagonal. The cell with the
  // largest such sum is divided, until little is gained.
  double divide(const TriangleTree& tree) const {
    const std::vector<Plane> walls = planes();
    struct Cell {
      double bound;
      double distance;  // of its centre, or a larger one
      Vec3d centre;
      double half;
      bool operator<(const Cell& other) const { return bound < other.bound; }
    };
    int left = kHullExcessVisits;
    const auto distance_at = [&](const Vec3d& p) {
      const int allowed = std::max(256, left / 16);
      int visits = allowed;
      const double distance = tree.signed_distance(p, &visits);
      left -= allowed - std::max(visits, 0);
      return distance;
    };
    std::priority_queue<Cell> cells;
    const double first = distance_at({0, 0, 0});
    cells.push({first + std::sqrt(3.0), first, {0, 0, 0}, 1});
    double met = 0;
    while (!cells.empty() && left > 0) {
      const Cell cell = cells.top();
      if (cell.bound <= std::max(kTooMuch * met, met + kNegligible)) break;
      cells.pop();
      const double half = cell.half / 2, diagonal = std::sqrt(3.0) * half;
      for (int corner = 0; corner < 8; ++corner) {
        const Vec3d c =
            cell.centre + Vec3d{corner & 1 ? half : -half, corner & 2 ? half : -half, corner & 4 ? half : -half};
        const auto [outside, within] = place(walls, c, half);
        if (outside) continue;
        const double distance = std::min(distance_at(c), cell.distance + diagonal);
        if (within) met = std::max(met, distance);
        const double bound = std::min(cell.bound, distance + diagonal);
        if (bound > 0) cells.push({bound, distance, c, half});
      }
    }
    return cells.empty() ? 0 : cells.top().bound;
  }

  const ConvexPart& hull_;
  std::span<const Triangle> hull_faces_;
  std::vector<Vec3d> positions_, points_;  // of the mesh, distinct: as they are, and in units of the hull
  std::vector<Triangle> triangles_;
};

}  // namespace

HullExcess hull_excess(std::span<const Vec3d> vertices, std::span<const Triangle> triangles, const ConvexPart& hull,
                       std::span<const Triangle> hull_faces) {
  if (triangles.empty() || !(hull.spread > 0)) return {};
  return Measure(vertices, triangles, hull, hull_faces).run();
}

std::optional<double> convex_excess(std::span<const Vec3d> vertices, std::span<const Triangle> triangles,
                                    const ConvexPart& hull) {
  if (!(hull.spread > 0)) return 0;
  return Measure(vertices, triangles, hull, {}).run_convex();
}

}  // namespace clearance
