#include "engine/hull/triangle_tree.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace clearance {

namespace {

constexpr std::uint32_t kNowhere = std::numeric_limits<std::uint32_t>::max();
constexpr std::uint32_t kLeaf = 4;  // triangles

Vec3d unit(const Vec3d& v) {
  const double length = norm(v);
  return length > 0 ? v * (1 / length) : v;
}

struct TriangleEdge {
  std::uint64_t key;  // its corners, the smaller one first
  std::uint32_t triangle, k;
  bool ascending;
};

// The edges of all triangles, in the order of their keys.
std::vector<TriangleEdge> edges_of(std::span<const Triangle> triangles) {
  std::vector<TriangleEdge> edges;
  edges.reserve(3 * triangles.size());
  for (std::uint32_t t = 0; t < triangles.size(); ++t)
    for (std::uint32_t k = 0; k < 3; ++k) {
      const std::uint32_t a = triangles[t][k], b = triangles[t][(k + 1) % 3];
      edges.push_back({std::uint64_t{std::min(a, b)} << 32 | std::max(a, b), t, k, a < b});
    }
  std::sort(edges.begin(), edges.end(), [](const TriangleEdge& a, const TriangleEdge& b) { return a.key < b.key; });
  return edges;
}

}  // namespace

TriangleTree::TriangleTree(std::span<const Vec3d> vertices, std::span<const Triangle> triangles)
    : vertices_(vertices), triangles_(triangles) {
  find_parts();
  make_normals();
  for (const Triangle& t : triangles_)
    centres_.push_back((vertices_[t[0]] + vertices_[t[1]] + vertices_[t[2]]) * (1.0 / 3));
  order_.resize(triangles_.size());
  std::iota(order_.begin(), order_.end(), 0);
  nodes_.reserve(2 * triangles_.size() / kLeaf + 2);
  build(0, static_cast<std::uint32_t>(order_.size()));
  centres_ = {};
}

// Finds the triangles at each edge, the connected components, and those that enclose a volume.
void TriangleTree::find_parts() {
  const std::vector<TriangleEdge> edges = edges_of(triangles_);
  std::vector<std::uint32_t> part(triangles_.size());  // a forest: each triangle's component is that of its root
  std::iota(part.begin(), part.end(), 0);
  const auto root = [&part](std::uint32_t t) {
    while (part[t] != t) t = part[t] = part[part[t]];
    return t;
  };
  std::vector<char> open(triangles_.size(), 0);
  across_.assign(triangles_.size(), {kNowhere, kNowhere, kNowhere});
  for (std::size_t i = 0, end = 0; i < edges.size(); i = end) {
    while (end < edges.size() && edges[end].key == edges[i].key) ++end;
    for (std::size_t j = i + 1; j < end; ++j) part[root(edges[j].triangle)] = root(edges[i].triangle);
    if (end - i == 2 && edges[i].ascending != edges[i + 1].ascending) {
      across_[edges[i].triangle][edges[i].k] = edges[i + 1].triangle;
      across_[edges[i + 1].triangle][edges[i + 1].k] = edges[i].triangle;
    } else {
      open[edges[i].triangle] = 1;
    }
  }
  std::vector<double> volume(triangles_.size(), 0);
  std::vector<char> is_open(triangles_.size(), 0);
  for (std::uint32_t t = 0; t < triangles_.size(); ++t) {
    const Vec3d &a = vertices_[triangles_[t][0]], &b = vertices_[triangles_[t][1]], &c = vertices_[triangles_[t][2]];
    volume[root(t)] += dot(a, cross(b, c)) / 6;
    is_open[root(t)] |= open[t];
  }
  in_solid_.resize(triangles_.size());
  for (std::uint32_t t = 0; t < triangles_.size(); ++t) {
    in_solid_[t] = !is_open[root(t)] && volume[root(t)] > 0;
    solid_ = solid_ && in_solid_[t];
    if (root(t) == t && in_solid_[t]) volume_ += volume[t];
  }
}

// Vertex normals: the faces' normals weighted with their angles there: J. A. Baerentzen and H. Aanaes, "Signed distance
// computation using the angle weighted pseudonormal" (2005).
void TriangleTree::make_normals() {
  vertex_normals_.assign(vertices_.size(), {0, 0, 0});
  for (const Triangle& t : triangles_) {
    const Vec3d corner[3] = {vertices_[t[0]], vertices_[t[1]], vertices_[t[2]]};
    const Vec3d n = unit(cross(corner[1] - corner[0], corner[2] - corner[0]));
    face_normals_.push_back(n);
    for (int k = 0; k < 3; ++k) {
      const Vec3d u = unit(corner[(k + 1) % 3] - corner[k]), v = unit(corner[(k + 2) % 3] - corner[k]);
      vertex_normals_[t[static_cast<std::size_t>(k)]] += n * std::atan2(norm(cross(u, v)), dot(u, v));
    }
  }
}

std::uint32_t TriangleTree::build(std::uint32_t begin, std::uint32_t end) {
  const auto index = static_cast<std::uint32_t>(nodes_.size());
  Node node{vertices_[triangles_[order_[begin]][0]], vertices_[triangles_[order_[begin]][0]], begin, end, 0};
  for (std::uint32_t i = begin; i < end; ++i)
    for (const std::uint32_t v : triangles_[order_[i]])
      for (int k = 0; k < 3; ++k) {
        node.low[k] = std::min(node.low[k], vertices_[v][k]);
        node.high[k] = std::max(node.high[k], vertices_[v][k]);
      }
  nodes_.push_back(node);
  if (end - begin <= kLeaf) return index;
  const Vec3d size = node.high - node.low;
  const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
  const std::uint32_t middle = begin + (end - begin) / 2;
  std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                   [&](std::uint32_t a, std::uint32_t b) { return centres_[a][axis] < centres_[b][axis]; });
  build(begin, middle);
  nodes_[index].right = build(middle, end);
  return index;
}

double TriangleTree::squared_gap(const Node& node, const Vec3d& p) {
  double sum = 0;
  for (int k = 0; k < 3; ++k) {
    const double gap = std::max({node.low[k] - p[k], p[k] - node.high[k], 0.0});
    sum += gap * gap;
  }
  return sum;
}

// C. Ericson, "Real-Time Collision Detection" (2005), sect. 5.1.5: the feature of the triangle whose Voronoi region
// holds p.
void TriangleTree::update_nearest(std::uint32_t triangle, const Vec3d& p, Nearest* best) const {
  const Triangle& t = triangles_[triangle];
  const Vec3d &a = vertices_[t[0]], &b = vertices_[t[1]], &c = vertices_[t[2]];
  const Vec3d ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
  const double d1 = dot(ab, ap), d2 = dot(ac, ap), d3 = dot(ab, bp), d4 = dot(ac, bp), d5 = dot(ab, cp),
               d6 = dot(ac, cp);
  const double va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2;
  Vec3d q{0, 0, 0};
  int feature = 0;
  if (d1 <= 0 && d2 <= 0) {
    q = a, feature = 4;
  } else if (d3 >= 0 && d4 <= d3) {
    q = b, feature = 5;
  } else if (d6 >= 0 && d5 <= d6) {
    q = c, feature = 6;
  } else if (vc <= 0 && d1 >= 0 && d3 <= 0) {
    q = a + ab * (d1 / (d1 - d3)), feature = 1;
  } else if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    q = b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6))), feature = 2;
  } else if (vb <= 0 && d2 >= 0 && d6 <= 0) {
    q = a + ac * (d2 / (d2 - d6)), feature = 3;
  } else {
    const double scale = 1 / (va + vb + vc);
    q = a + ab * (vb * scale) + ac * (vc * scale);
  }
  if (const double squared = squared_norm(p - q); squared < best->squared) *best = {squared, triangle, q, feature};
}

Vec3d TriangleTree::side(const Nearest& nearest) const {
  const Vec3d& face = face_normals_[nearest.triangle];
  if (nearest.feature == 0) return face;
  if (nearest.feature >= 4)
    return vertex_normals_[triangles_[nearest.triangle][static_cast<std::size_t>(nearest.feature - 4)]];
  const std::uint32_t other = across_[nearest.triangle][static_cast<std::size_t>(nearest.feature - 1)];
  return other == kNowhere ? face : face + face_normals_[other];
}

double TriangleTree::signed_distance(const Vec3d& p, int* visits) const {
  Nearest best{std::numeric_limits<double>::infinity()};
  std::array<std::pair<std::uint32_t, double>, 64>
      stack;  // nodes and their distances; halves of halves: 33 levels at most
  std::size_t depth = 0;
  stack[depth++] = {0, squared_gap(nodes_[0], p)};
  while (depth > 0) {
    const auto [index, gap] = stack[--depth];
    if (gap >= best.squared) continue;
    if (--*visits < 0 && best.squared < std::numeric_limits<double>::infinity()) return std::sqrt(best.squared);
    const Node& node = nodes_[index];
    if (node.right == 0) {
      for (std::uint32_t i = node.begin; i < node.end; ++i) update_nearest(order_[i], p, &best);
      continue;
    }
    const double lower = squared_gap(nodes_[index + 1], p), upper = squared_gap(nodes_[node.right], p);
    const bool lower_first = lower <= upper;
    stack[depth++] = lower_first ? std::pair(node.right, upper) : std::pair(index + 1, lower);
    stack[depth++] = lower_first ? std::pair(index + 1, lower) : std::pair(node.right, upper);
  }
  const double distance = std::sqrt(best.squared);
  const bool inside = in_solid_[best.triangle] && dot(side(best), p - best.point) < 0;
  return inside ? -distance : distance;
}

}  // namespace clearance
