#include "engine/mesh/mesh_faces.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "engine/mesh/ear_cutter.h"

namespace clearance {

namespace {

constexpr double kFloatRounding = 0x1p-20;  // share of the largest coordinate: eight roundings of float32

struct Normal {
  Vec3d sum{0, 0, 0};   // M. E. Newell: twice the projected area along each axis
  Vec3d size{0, 0, 0};  // the same, summed over all triangles of a fan by magnitude
};

Normal normal_of(std::span<const Vec3d> face) {
  Normal normal;
  for (std::size_t k = 1; k + 1 < face.size(); ++k) {
    const Vec3d n = cross(face[k] - face[0], face[k + 1] - face[0]);
    normal.sum += n;
    for (int i = 0; i < 3; ++i) normal.size[i] += std::abs(n[i]);
  }
  return normal;
}

int largest(const Vec3d& v) {
  const Vec3d size{std::abs(v.x), std::abs(v.y), std::abs(v.z)};
  return size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
}

// Range of exact signs; smaller numbers count as 0.
FlatPoint flat(double u, double v) {
  const auto flushed = [](double x) { return std::abs(x) * kMaxFlatCoordinate < 1 ? 0 : x; };
  return {flushed(u), flushed(v)};
}

// Projection of the face along an axis, counterclockwise. Coordinates stay exact, so signs are the file's.
void see_along_axis(std::span<const Vec3d> face, int axis, bool is_mirrored, std::vector<FlatPoint>* out) {
  const int u = (axis + 1) % 3, v = (axis + 2) % 3;
  out->clear();
  for (const Vec3d& p : face) out->push_back(is_mirrored ? flat(p[v], p[u]) : flat(p[u], p[v]));
}

// Projection of the face along its rounded normal, for a face that overlaps itself along an axis.
std::vector<FlatPoint> along_normal(std::span<const Vec3d> face, const Vec3d& normal) {
  const Vec3d n = normal * (1 / norm(normal));
  Vec3d side{0, 0, 0};
  side[(largest(n) + 1) % 3] = 1;
  Vec3d u = side - n * dot(n, side);
  u = u * (1 / norm(u));
  const Vec3d v = cross(n, u);
  std::vector<FlatPoint> out;
  for (const Vec3d& p : face) out.push_back(flat(dot(u, p - face[0]), dot(v, p - face[0])));
  return out;
}

double largest_coordinate(std::span<const Vec3d> positions) {
  double most = 0;
  for (const Vec3d& p : positions)
    for (int k = 0; k < 3; ++k) most = std::max(most, std::abs(p[k]));
  return most;
}

struct Scratch {
  std::vector<Vec3d> face;
  std::vector<FlatPoint> seen;
};

// Cuts one face into triangles. Returns a bound on their distance from the face, or none if it crosses itself by more
// than the tolerance.
// \param corners indices of `positions`
std::optional<double> cut(std::span<const std::uint32_t> corners, std::span<const Vec3d> positions, double tolerance,
                          Scratch* scratch, std::vector<Triangle>* triangles) {
  auto& [face, seen] = *scratch;
  face.clear();
  for (const std::uint32_t c : corners) face.push_back(positions[c]);
  const Normal normal = normal_of(face);
  // A bow tie has no normal; the axis with the largest projected area replaces it.
  const bool has_normal = std::abs(normal.sum[largest(normal.sum)]) > 0x1p-20 * normal.size[largest(normal.size)];
  const int axis = largest(has_normal ? normal.sum : normal.size);
  see_along_axis(face, axis, normal.sum[axis] < 0, &seen);
  if (fan_is_right(seen)) {
    add_fan(triangles, corners);
    return 0;
  }
  std::vector<Triangle> ears;
  std::optional<double> off = cut_ears(seen, face, tolerance, &ears);
  if (!off && has_normal) off = cut_ears(along_normal(face, normal.sum), face, tolerance, &ears);
  if (!off) return {};
  for (const Triangle& t : ears) triangles->push_back({corners[t[0]], corners[t[1]], corners[t[2]]});
  return off;
}

}  // namespace

void FaceList::add(std::span<const std::uint32_t> corners, std::size_t place) {
  if (corners.size() == 3) triangles_.push_back({corners[0], corners[1], corners[2]});
  if (corners.size() <= 3) return;
  polygons_.push_back({triangles_.size(), place, static_cast<std::uint32_t>(corners.size())});
  corners_.insert(corners_.end(), corners.begin(), corners.end());
}

std::vector<Triangle> FaceList::take_triangles(std::span<const Vec3d> positions, double* rounding, const Fail& fail) {
  if (polygons_.empty()) return std::exchange(triangles_, {});
  const double most = largest_coordinate(positions);
  std::vector<Triangle> out;
  out.reserve(triangles_.size() + corners_.size() - 2 * polygons_.size());
  Scratch scratch;
  std::span<const std::uint32_t> left = corners_;
  auto next = triangles_.begin();
  for (const Polygon& polygon : polygons_) {
    const auto end = triangles_.begin() + static_cast<std::ptrdiff_t>(polygon.before);
    out.insert(out.end(), next, end);
    next = end;
    const std::span<const std::uint32_t> corners = left.first(polygon.count);
    left = left.subspan(polygon.count);
    if (!(most <= kMaxFlatCoordinate)) {  // the mesh is rejected for such positions
      add_fan(&out, corners);
      continue;
    }
    const std::optional<double> off = cut(corners, positions, kFloatRounding * most, &scratch, &out);
    if (off)
      *rounding = std::max(*rounding, *off);
    else
      fail(polygon.place, "a face of " + std::to_string(corners.size()) +
                              " corners crosses itself, or is too intricate; cut it into triangles");
  }
  out.insert(out.end(), next, triangles_.end());
  triangles_.clear();
  polygons_.clear();
  corners_.clear();
  return out;
}

}  // namespace clearance
