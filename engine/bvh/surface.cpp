#include "engine/bvh/surface.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "engine/base/dedupe.h"
#include "engine/base/digest.h"
#include "engine/bvh/box_halving.h"

namespace clearance {

namespace {

std::string position(const Vec3d& v) {
  char text[96];
  std::snprintf(text, sizeof text, "(%.9g, %.9g, %.9g)", v.x, v.y, v.z);
  return text;
}

// The largest float that is not above x.
float float_below(double x) {
  const auto f = static_cast<float>(x);
  return f <= x ? f : std::nextafter(f, -std::numeric_limits<float>::infinity());
}
// A float below x, also if x was rounded by half a unit of float64.
float float_under(double x) {
  return std::nextafter(float_below(x), -std::numeric_limits<float>::infinity());
}

// A list of triangles, for halve(), cut at the median of their centroids along the longest side.
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
  // Coordinates relative to the centre were rounded by half a unit of float64, far less than one of float32.
  static void close(const Extremes& box, std::array<float, 3>& low, std::array<float, 3>& high) {
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = float_under(box.low[static_cast<int>(k)]);
      high[k] = -float_under(-box.high[static_cast<int>(k)]);
    }
  }

 private:
  std::span<const Vec3d> vertices_;
  std::span<const Triangle> triangles_;
  Vec3d centre_;
  std::vector<Vec3d> middles_;  // times three, from the centre
};

// Mean facing of triangles: the sum of n n^T over their areas.
class Facing {
 public:
  void take(const std::array<Vec3d, 3>& t) {
    const Vec3d n = cross(t[1] - t[0], t[2] - t[0]);
    const double area = norm(n);
    if (!(area > 0)) return;
    const Vec3d m = n * (1 / area);
    for (int k = 0; k < 3; ++k) sum_[k] = sum_[k] + n * m[k];
  }
  void take(const Facing& other) {
    for (int k = 0; k < 3; ++k) sum_[k] = sum_[k] + other.sum_[k];
  }
  /// The direction that most of the area faces, of length 1 up to rounding, or 0 if there is none.
  Vec3d most() const {
    std::array<Vec3d, 3> power = sum_;
    for (int i = 0; i < 4; ++i) {  // to the sixteenth power: the largest of three outgrows the others
      const double trace = power[0].x + power[1].y + power[2].z;
      if (!(trace > 0 && trace < std::numeric_limits<double>::infinity())) return {0, 0, 0};
      for (Vec3d& row : power) row = row * (1 / trace);
      const std::array<Vec3d, 3> p = power;
      for (std::size_t k = 0; k < 3; ++k) power[k] = p[0] * p[k].x + p[1] * p[k].y + p[2] * p[k].z;
    }
    const Vec3d& row = *std::max_element(
        power.begin(), power.end(), [](const Vec3d& p, const Vec3d& q) { return squared_norm(p) < squared_norm(q); });
    const double length = norm(row);
    return length > 0 ? row * (1 / length) : Vec3d{0, 0, 0};
  }

 private:
  std::array<Vec3d, 3> sum_{};  // symmetric
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
                       : " is shared by " + std::to_string(there) + " triangles with inconsistent orientations");
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
  std::vector<std::uint32_t> part(vertices_.size());  // a forest: each vertex's component is that of its root
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
  find_slabs();
}

// The planes of a node are normal to the direction that most of its area faces, either way.
void Surface::find_slabs() {
  slabs_.resize(nodes_.size());
  std::vector<Facing> facing(nodes_.size());
  std::vector<std::uint32_t> first(nodes_.size()), end(nodes_.size());
  const Vec3d low = {nodes_[0].low[0], nodes_[0].low[1], nodes_[0].low[2]},
              high = {nodes_[0].high[0], nodes_[0].high[1], nodes_[0].high[2]};
  const double wrong = 0x1p-49 * norm(high - low);   // bound on the error of the values below
  for (std::size_t at = nodes_.size(); at-- > 0;) {  // children come after their parent
    const Node& node = nodes_[at];
    first[at] = node.is_leaf() ? node.begin() : first[at + 1];
    end[at] = node.is_leaf() ? node.end() : end[node.right];
    if (node.is_leaf())
      for (std::uint32_t t = first[at]; t < end[at]; ++t) facing[at].take(corners(t));
    else
      facing[at].take(facing[at + 1]), facing[at].take(facing[node.right]);
    const Vec3d n = facing[at].most();
    Slab& slab = slabs_[at];
    for (int k = 0; k < 3; ++k)
      slab.units[static_cast<std::size_t>(k)] = static_cast<std::int16_t>(std::lround(n[k] / Slab::kUnit));
    const Vec3d normal = slab.normal();
    double least = std::numeric_limits<double>::infinity(), most = -least;
    for (std::uint32_t t = first[at]; t < end[at]; ++t)
      for (const std::uint32_t corner : triangles_[t]) {
        const double along = dot(normal, vertices_[corner] - centre_);
        least = std::min(least, along);
        most = std::max(most, along);
      }
    slab.low = float_under(least - wrong);
    slab.high = -float_under(-(most + wrong));
  }
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
         held(nodes_) + held(slabs_);
}

}  // namespace clearance
