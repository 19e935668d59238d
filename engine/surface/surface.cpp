#include "engine/surface/surface.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "engine/base/dedupe.h"
#include "engine/base/digest.h"
#include "engine/surface/box_halving.h"

namespace clearance {

namespace {

std::string position(const Vec3d& v) {
  char text[96];
  std::snprintf(text, sizeof text, "(%.9g, %.9g, %.9g)", v.x, v.y, v.z);
  return text;
}

// The float nearest to x that is not above it; not below it.
float float_below(double x) {
  const auto f = static_cast<float>(x);
  return f <= x ? f : std::nextafter(f, -std::numeric_limits<float>::infinity());
}
float float_above(double x) {
  return -float_below(-x);
}

// A list of triangles, for halve(): cut at the middle one along the longest side of their middles.
class TriangleList {
 public:
  TriangleList(std::span<const Vec3d> vertices, std::span<const Triangle> triangles, const Vec3d& centre)
      : vertices_(vertices), triangles_(triangles), centre_(centre) {
    for (const Triangle& t : triangles)
      middles_.push_back((vertices[t[0]] - centre) + (vertices[t[1]] - centre) + (vertices[t[2]] - centre));
    order.resize(triangles.size());
    std::iota(order.begin(), order.end(), 0);
  }
  std::vector<std::uint32_t> order;  // of the triangles

  Extremes box(std::uint32_t begin, std::uint32_t end) const {
    Extremes box;
    for (std::uint32_t i = begin; i < end; ++i)
      for (const std::uint32_t corner : triangles_[order[i]]) box.take(vertices_[corner] - centre_);
    return box;
  }
  std::uint32_t split(std::uint32_t begin, std::uint32_t end) {
    const std::uint32_t middle = begin + (end - begin) / 2;
    Extremes middles;
    for (std::uint32_t i = begin; i < end; ++i) middles.take(middles_[order[i]]);
    const int axis = middles.longest();
    const auto at = [&](std::uint32_t i) { return order.begin() + static_cast<std::ptrdiff_t>(i); };
    std::nth_element(at(begin), at(middle), at(end), [&](std::uint32_t a, std::uint32_t b) {
      return middles_[a][axis] != middles_[b][axis] ? middles_[a][axis] < middles_[b][axis] : a < b;
    });
    return middle;
  }
  // What was measured from the centre was rounded: half a unit of float64, far less than one of float32.
  static void close(const Extremes& box, std::array<float, 3>& low, std::array<float, 3>& high) {
    constexpr float kInf = std::numeric_limits<float>::infinity();
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = std::nextafter(float_below(box.low[static_cast<int>(k)]), -kInf);
      high[k] = std::nextafter(float_above(box.high[static_cast<int>(k)]), kInf);
    }
  }

 private:
  std::span<const Vec3d> vertices_;
  std::span<const Triangle> triangles_;
  Vec3d centre_;
  std::vector<Vec3d> middles_;  // times three, from the centre
};

}  // namespace

std::string open_edge(std::span<const Vec3d> vertices, std::span<const Triangle> triangles) {
  const std::vector<std::uint32_t> place = unique_positions(vertices).index;
  struct Edge {
    std::uint64_t key;  // its corners, the smaller one first
    std::uint32_t triangle, k;
    int way;
  };
  std::vector<Edge> edges;
  edges.reserve(3 * triangles.size());
  for (std::uint32_t t = 0; t < triangles.size(); ++t)
    for (std::uint32_t k = 0; k < 3; ++k) {
      const std::uint32_t a = place[triangles[t][k]], b = place[triangles[t][(k + 1) % 3]];
      if (a != b) edges.push_back({std::uint64_t{std::min(a, b)} << 32 | std::max(a, b), t, k, a < b ? 1 : -1});
    }
  std::sort(edges.begin(), edges.end(),
            [](const Edge& a, const Edge& b) { return std::pair(a.key, a.triangle) < std::pair(b.key, b.triangle); });
  for (std::size_t i = 0, end = 0; i < edges.size(); i = end) {
    int sum = 0;
    while (end < edges.size() && edges[end].key == edges[i].key) sum += edges[end++].way;
    if (sum == 0) continue;
    const Triangle& t = triangles[edges[i].triangle];
    const std::size_t there = end - i;
    return "the edge from " + position(vertices[t[edges[i].k]]) + " to " + position(vertices[t[(edges[i].k + 1) % 3]]) +
           " of triangle " + std::to_string(edges[i].triangle) +
           (there == 1 ? " belongs to no other triangle: the mesh is open there"
                       : " is run along by " + std::to_string(there) +
                             " triangles, not as often one way as the other: they are not oriented alike");
  }
  return {};
}

Surface::Surface(std::vector<Vec3d> vertices, std::vector<Triangle> triangles, bool is_solid)
    : vertices_(std::move(vertices)),
      triangles_(std::move(triangles)),
      kind_(is_solid ? Kind::kSolid : Kind::kSurface) {
  if (triangles_.empty()) throw std::invalid_argument("a surface needs at least one triangle");
  if (triangles_.size() > kMostElements) throw std::invalid_argument("a surface has at most 2^30 triangles");
  for (std::size_t t = 0; t < triangles_.size(); ++t)
    for (const std::uint32_t corner : triangles_[t])
      if (corner >= vertices_.size())
        throw std::invalid_argument("triangle " + std::to_string(t) + " names the vertex " + std::to_string(corner) +
                                    ", and there are " + std::to_string(vertices_.size()));
  if (is_solid)
    if (const std::string why = open_edge(vertices_, triangles_); !why.empty())
      throw std::invalid_argument("the mesh encloses no volume: " + why);
  Digest digest;
  digest.add(vertices_);
  for (const Triangle& t : triangles_)
    for (const std::uint32_t corner : t) digest.add(std::uint64_t{corner});
  digest.add(std::uint64_t{is_solid});
  digest_ = digest.value();
  find_parts();
  build_tree();
}

void Surface::find_parts() {
  const std::vector<std::uint32_t> place = unique_positions(std::span<const Vec3d>(vertices_)).index;
  std::vector<std::uint32_t> part(vertices_.size());  // a forest: each vertex's part is that of its root
  std::iota(part.begin(), part.end(), 0);
  const auto root = [&part](std::uint32_t v) {
    while (part[v] != v) v = part[v] = part[part[v]];
    return v;
  };
  for (const Triangle& t : triangles_)
    for (int k = 1; k < 3; ++k) part[root(place[t[static_cast<std::size_t>(k)]])] = root(place[t[0]]);
  std::vector<char> is_seen(vertices_.size(), 0);
  for (const Triangle& t : triangles_)
    if (char& seen = is_seen[root(place[t[0]])]; !std::exchange(seen, 1)) parts_.push_back(t[0]);
}

void Surface::build_tree() {
  Extremes box;
  for (const Triangle& t : triangles_)
    for (const std::uint32_t corner : t) box.take(vertices_[corner]);
  centre_ = box.middle();
  TriangleList list(vertices_, triangles_, centre_);
  nodes_ = halve(list, size());
  places_ = std::move(list.order);
  std::vector<Triangle> ordered;
  ordered.reserve(triangles_.size());
  for (const std::uint32_t t : places_) ordered.push_back(triangles_[t]);
  triangles_ = std::move(ordered);
}

ElementCorners Surface::element(std::uint32_t i) const {
  if (!is_cloud()) {
    const auto [u, v, w] = corners(i);
    return {{u, v, w}, 3};
  }
  ElementCorners out{{point(i)}, 1};
  if (edge_ == 0) return out;
  const Vec3d centre = out.corner[0];
  const double half = 0.5 * double{edge_};
  for (out.count = 0; out.count < 8; ++out.count) {
    const auto way = [&](unsigned bit) { return out.count & bit ? half : -half; };
    out.corner[out.count] = centre + Vec3d{way(1), way(2), way(4)};  // within rounding()
  }
  return out;
}

std::uint64_t Surface::resident_bytes() const {
  const auto held = [](const auto& v) { return v.capacity() * sizeof(v[0]); };
  return sizeof(Surface) + held(vertices_) + held(triangles_) + held(places_) + held(parts_) + held(points_) +
         held(nodes_);
}

}  // namespace clearance
