#include "engine/cover/fan.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "engine/base/orientation.h"
#include "engine/hull/hull.h"

namespace clearance {

namespace {

constexpr double kUp = 1 + 0x1p-44;

// Whether each edge of the faces is used once each way. Then across[3 t + k] is the face over the edge from corner k.
bool is_closed(std::span<const Triangle> faces, std::vector<std::uint32_t>& across) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> sides;
  for (std::uint32_t t = 0; t < faces.size(); ++t)
    for (std::uint32_t k = 0; k < 3; ++k)
      if (!sides.try_emplace({faces[t][k], faces[t][(k + 1) % 3]}, t).second) return false;
  across.clear();
  for (const Triangle& t : faces)
    for (std::uint32_t k = 0; k < 3; ++k) {
      const auto other = sides.find({t[(k + 1) % 3], t[k]});
      if (other == sides.end()) return false;
      across.push_back(other->second);
    }
  return true;
}

}  // namespace

std::optional<Fan> fan_of(std::span<const Vec3d> vertices) {
  if (vertices.size() < 4) return {};
  std::vector<Triangle> faces;
  const ConvexPartPtr hull = make_hull_part(vertices, {}, 0, 0, false, &faces);
  const std::vector<Vec3d>& corners = hull->vertices;
  std::vector<std::uint32_t> across;
  if (faces.size() < 4 || !is_closed(faces, across)) return {};
  Vec3d middle{0, 0, 0};
  for (const Vec3d& v : corners) middle += v * (1.0 / static_cast<double>(corners.size()));
  if (!orientation_applies(middle) || !std::all_of(corners.begin(), corners.end(), orientation_applies)) return {};
  double far = 0;
  for (const Vec3d& v : corners) far = std::max(far, norm(v - middle) * kUp);
  const double rounding = 0x1p-48 * (hull->rho + far);  // of a difference of products with a direction of length 1
  std::vector<Vec3d> normals;
  for (const Triangle& t : faces) {
    if (orientation(corners[t[0]], corners[t[1]], corners[t[2]], middle) != -1) return {};
    const Vec3d n = cross(corners[t[1]] - corners[t[0]], corners[t[2]] - corners[t[0]]);
    const double length = norm(n);
    normals.push_back(length > 0 ? n * (1 / length) : Vec3d{0, 0, 0});
  }
  // Bound, from n, on how far a ray from the centre can continue in the hull beyond a face. Any n is valid.
  const auto beyond = [&](const Triangle& t, const Vec3d& n) {
    double most = 0, least = std::numeric_limits<double>::infinity();
    for (const std::uint32_t c : t) least = std::min(least, dot(n, corners[c] - middle));
    for (const Vec3d& v : corners) most = std::max(most, dot(n, v - middle));
    least -= rounding;
    return least > 0 ? far * ((most - least + rounding) / least) * kUp : std::numeric_limits<double>::infinity();
  };
  Fan fan;
  fan.points = corners;
  fan.points.push_back(middle);
  for (std::size_t t = 0; t < faces.size(); ++t) {
    double off = beyond(faces[t], normals[t]);
    for (std::size_t k = 0; k < 3; ++k) off = std::min(off, beyond(faces[t], normals[across[3 * t + k]]));
    if (!(off < 0x1p-30 * far)) return {};
    fan.off = std::max(fan.off, off);
    fan.parts.push_back({faces[t][0], faces[t][1], faces[t][2], static_cast<std::uint32_t>(corners.size())});
  }
  return fan;
}

Fan box_around(const ConvexPart& part) {
  Fan fan;
  for (int corner = 0; corner < 8; ++corner) {
    Vec3d v = part.centre;
    for (int k = 0; k < 3; ++k) {
      const double half = part.half[k] + 0x1p-50 * std::abs(v[k]);  // plus the rounding of the sum
      v[k] += corner >> k & 1 ? half : -half;
    }
    fan.points.push_back(v);
  }
  // Six about the diagonal from corner 0 to corner 7, one for each order of the axes.
  for (std::uint32_t first = 0; first < 3; ++first)
    for (std::uint32_t second = 0; second < 3; ++second)
      if (first != second) fan.parts.push_back({0, 1u << first, 1u << first | 1u << second, 7});
  return fan;
}

}  // namespace clearance
