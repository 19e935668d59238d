// Input of every contender: shapes, bodies, poses and pairs, in one file that all of them read without a library.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

namespace peers {

using Point = std::array<double, 3>;

/// The convex hull of the vertices (metres, shape's frame), grown by a radius.
struct Shape {
  std::vector<Point> vertices;
  std::vector<std::array<std::uint32_t, 3>> triangles;  ///< outward faces of the hull; empty if it is flat
  double radius = 0;
};

enum class Kind : std::uint32_t {
  kDistance,  ///< distances of independent configurations
  kMotion,    ///< distances along a coherent motion
  kDepth,     ///< signed distances, with penetration depths
  kWithin,    ///< list of the pairs within max_distance
  kLeast,     ///< only the least distance of each configuration
};

struct Problem {
  Kind kind = Kind::kDistance;
  double max_distance = std::numeric_limits<double>::infinity();  ///< metres; farther pairs need no distance
  std::vector<Shape> shapes;
  std::vector<std::vector<std::uint32_t>> bodies;  ///< the shapes whose union is a body
  std::uint64_t configurations = 1;
  std::vector<std::array<double, 7>> poses;  ///< (K, B): x, y, z [m], qw, qx, qy, qz of any norm
  std::vector<std::array<std::uint32_t, 2>> pairs;
  std::vector<double>
      exact_value;            ///< exact signed distance in metres: (K, P), or (K,) for kLeast; NaN if not computed
  std::vector<double> scale;  ///< likewise: S = |D| + rho_a + rho_b + r_a + r_b, in metres, a scale for errors

  std::uint64_t answers() const { return configurations * (kind == Kind::kLeast ? 1 : pairs.size()); }
};

namespace detail {
template <class T>
void get(std::istream& in, T* values, std::uint64_t count) {
  in.read(reinterpret_cast<char*>(values), static_cast<std::streamsize>(count * sizeof(T)));
}
template <class T>
void put(std::ostream& out, const T* values, std::uint64_t count) {
  out.write(reinterpret_cast<const char*>(values), static_cast<std::streamsize>(count * sizeof(T)));
}
template <class T>
void get(std::istream& in, std::vector<T>& values) {
  std::uint64_t count = 0;
  get(in, &count, 1);
  values.resize(in ? count : 0);
  get(in, values.data(), values.size());
}
template <class T>
void put(std::ostream& out, const std::vector<T>& values) {
  const std::uint64_t count = values.size();
  put(out, &count, 1);
  put(out, values.data(), count);
}
constexpr char kMagic[8] = {'C', 'L', 'P', 'E', 'E', 'R', '0', '2'};
}  // namespace detail

/// Little-endian, in this order: magic, kind, max_distance, exact distances, scale, shapes (radius, vertices, triangles), bodies,
/// configurations, poses, pairs; each list is preceded by its length. Throws std::runtime_error, also for another
/// layout.
inline Problem read_problem(const std::string& path) {
  using detail::get;
  std::ifstream in(path, std::ios::binary);
  char magic[8] = {};
  get(in, magic, 8);
  if (std::memcmp(magic, detail::kMagic, 8) != 0) throw std::runtime_error(path + " is not a file of problems");
  Problem p;
  std::uint64_t count = 0;
  get(in, &p.kind, 1);
  get(in, &p.max_distance, 1);
  get(in, p.exact_value), get(in, p.scale);
  get(in, &count, 1);
  p.shapes.resize(count);
  for (Shape& s : p.shapes) get(in, &s.radius, 1), get(in, s.vertices), get(in, s.triangles);
  get(in, &count, 1);
  p.bodies.resize(count);
  for (auto& body : p.bodies) get(in, body);
  get(in, &p.configurations, 1);
  get(in, p.poses), get(in, p.pairs);
  if (!in || p.poses.size() != p.configurations * p.bodies.size() || p.exact_value.size() != p.answers())
    throw std::runtime_error(path + " is cut short");
  return p;
}

inline void write_problem(const Problem& p, const std::string& path) {
  using detail::put;
  std::ofstream out(path, std::ios::binary);
  put(out, detail::kMagic, 8);
  put(out, &p.kind, 1);
  put(out, &p.max_distance, 1);
  put(out, p.exact_value), put(out, p.scale);
  std::uint64_t count = p.shapes.size();
  put(out, &count, 1);
  for (const Shape& s : p.shapes) put(out, &s.radius, 1), put(out, s.vertices), put(out, s.triangles);
  count = p.bodies.size();
  put(out, &count, 1);
  for (const auto& body : p.bodies) put(out, body);
  put(out, &p.configurations, 1);
  put(out, p.poses), put(out, p.pairs);
  if (!out.flush()) throw std::runtime_error("cannot write " + path);
}

/// The rotation M(q) / |q|^2 of a pose in row-major order, rounded from long double; computed before timing starts.
inline void rotation(const std::array<double, 7>& pose, double R[9]) {
  const long double w = pose[3], x = pose[4], y = pose[5], z = pose[6], n = w * w + x * x + y * y + z * z;
  const long double M[9] = {
      w * w + x * x - y * y - z * z, 2 * (x * y - w * z),           2 * (x * z + w * y),
      2 * (x * y + w * z),           w * w - x * x + y * y - z * z, 2 * (y * z - w * x),
      2 * (x * z - w * y),           2 * (y * z + w * x),           w * w - x * x - y * y + z * z};
  for (int i = 0; i < 9; ++i) R[i] = static_cast<double>(M[i] / n);
}

}  // namespace peers
