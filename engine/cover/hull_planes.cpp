#include "engine/cover/hull_planes.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/base/clones.h"

namespace clearance {

namespace {

/// The vertices that are extreme along directions from the centre of a cube to its corners, edges and faces.
std::vector<std::size_t> extremes(std::span<const Vec3d> vertices) {
  std::vector<std::size_t> found;
  for (int i = 0; i < 27; ++i) {
    const Vec3d n{i % 3 - 1.0, i / 3 % 3 - 1.0, i / 9 - 1.0};
    std::size_t far = 0;
    for (std::size_t k = 1; k < vertices.size(); ++k)
      if (dot(n, vertices[k]) > dot(n, vertices[far])) far = k;
    if (std::find(found.begin(), found.end(), far) == found.end()) found.push_back(far);
  }
  return found;
}

/// Adds the vertices that are farthest above the planes, at most one for each of them and `most` in all.
void add_farthest(std::vector<std::size_t>& taken, std::span<const Vec3d> vertices, const HullPlanes& planes,
                  std::size_t most) {
  struct Farthest {
    double above = 0;
    std::size_t vertex = 0;
  };
  std::vector<Farthest> of_plane(planes.count());
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const std::size_t plane = planes.highest(vertices[i]);
    if (const double above = planes.above(plane, vertices[i]); above > of_plane[plane].above)
      of_plane[plane] = {above, i};
  }
  std::stable_sort(of_plane.begin(), of_plane.end(),
                   [](const Farthest& a, const Farthest& b) { return a.above > b.above; });
  for (const Farthest& f : of_plane)
    if (taken.size() < most && f.above > 0 && std::find(taken.begin(), taken.end(), f.vertex) == taken.end())
      taken.push_back(f.vertex);
}

/// How far `p` is below each plane, the least.
CLEARANCE_CLONES double least_depth(const double* __restrict x, const double* __restrict y, const double* __restrict z,
                                    const double* __restrict height, std::size_t count, const Vec3d& p) {
  constexpr std::size_t kLanes = 16;
  const double px = p.x, py = p.y, pz = p.z;
  double least[kLanes];
  std::fill_n(least, kLanes, std::numeric_limits<double>::infinity());
  std::size_t i = 0;
  for (; i + kLanes <= count; i += kLanes)
    for (std::size_t k = 0; k < kLanes; ++k) {
      const double depth = height[i + k] - (x[i + k] * px + y[i + k] * py + z[i + k] * pz);
      least[k] = depth < least[k] ? depth : least[k];
    }
  for (; i < count; ++i) least[0] = std::min(least[0], height[i] - (x[i] * px + y[i] * py + z[i] * pz));
  return *std::min_element(least, least + kLanes);
}

}  // namespace

/// For any n, the fan's tetrahedra hold the points x of their cone with n . x <= the least n . v of the face's corners
/// v, if n puts the fan's centre below that height.
HullPlanes::HullPlanes(const Fan& fan) : centre_(fan.points.back()) {
  for (const auto& face : fan.parts) {
    const Vec3d &a = fan.points[face[0]], &b = fan.points[face[1]], &c = fan.points[face[2]];
    Vec3d n = cross(b - a, c - a);
    const double size = norm(n);
    n = n * ((1 - 0x1p-48) / size);  // shorter than 1
    const double low = std::min({dot(n, a), dot(n, b), dot(n, c)}) - kCoverRounding * (norm(a) + norm(b) + norm(c));
    if (!(size > kCoverTiny && dot(n, centre_) + kCoverRounding * norm(centre_) < low)) {
      *this = {};
      return;
    }
    x_.push_back(n.x);
    y_.push_back(n.y);
    z_.push_back(n.z);
    height_.push_back(low);
  }
}

double HullPlanes::depth(const Vec3d& c) const {
  const double depth = least_depth(x_.data(), y_.data(), z_.data(), height_.data(), height_.size(), c);
  return (depth - 2 * kCoverRounding * norm(c)) * (1 - 0x1p-48);
}

std::size_t HullPlanes::highest(const Vec3d& p) const {
  std::size_t best = 0;
  double most = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < height_.size(); ++i)
    if (const double a = above(i, p); a > most) most = a, best = i;
  return best;
}

double HullPlanes::distance(const Vec3d& p, std::size_t plane) const {
  // A point just below the plane, or one on the way to the centre, if it is proved to be in the hull.
  constexpr double kBelow = 0x1p-24;
  const Vec3d foot = p - normal(plane) * (std::max(above(plane, p), 0.0) + kBelow * norm(p - centre_));
  if (depth(foot) >= 0) return norm(p - foot) * kCoverUp + kCoverTiny;
  double t = 1;
  for (std::size_t i = 0; i < count(); ++i)
    if (const double a = above(i, p); a > 0) t = std::min(t, above(i, centre_) / (above(i, centre_) - a));
  const Vec3d on_ray = centre_ + (p - centre_) * (t * (1 - kBelow));
  return norm(p - (depth(on_ray) >= 0 ? on_ray : centre_)) * kCoverUp + kCoverTiny;
}

std::optional<FewVertices> few_vertices(std::span<const Vec3d> vertices, std::size_t most) {
  std::vector<std::size_t> taken = extremes(vertices);
  FewVertices result;
  for (;;) {
    std::vector<Vec3d> few;
    for (const std::size_t i : taken) few.push_back(vertices[i]);
    std::optional<Fan> fan = fan_of(few);
    if (!fan) return {};
    result.planes = HullPlanes(*fan);
    result.fan = std::move(*fan);
    if (result.planes.empty()) return {};
    const std::size_t before = taken.size();
    add_farthest(taken, vertices, result.planes, std::min(most, 2 * before));
    if (taken.size() == before) break;
  }
  for (std::size_t i = 0; i < vertices.size(); ++i)
    if (std::find(taken.begin(), taken.end(), i) == taken.end())
      result.excess = std::max(result.excess, result.planes.distance(vertices[i], result.planes.highest(vertices[i])));
  return result;
}

}  // namespace clearance
