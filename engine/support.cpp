#include "support.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace clearance {

namespace {

constexpr double kUnitRoundoff = 0x1p-53;
constexpr std::uint32_t kLeafVertices = 16;
constexpr std::uint32_t kTaskVertices = 1 << 15;  // subtrees larger than this are built by another thread

// Largest n . v over a node's box, rounded up: 3 products and sums of magnitudes below |n| (|c| + |h|) per term.
double box_bound(const SupportTree::Node& node, const Vec3d& n, const Vec3d& abs_n) {
  const double centre = dot(n, node.centre), extent = dot(abs_n, node.half);
  const double magnitude = abs_n.x * std::abs(node.centre.x) + abs_n.y * std::abs(node.centre.y) +
                           abs_n.z * std::abs(node.centre.z) + extent;
  return centre + extent + 8 * kUnitRoundoff * magnitude;
}

// Calls leaf(begin, end) for every leaf that may hold a vertex with n . v >= threshold(), nearer child first.
template <class Threshold, class Leaf>
void visit(const SupportTree& tree, const Vec3d& n, Threshold threshold, Leaf leaf) {
  const Vec3d abs_n{std::abs(n.x), std::abs(n.y), std::abs(n.z)};
  struct Entry {
    std::uint32_t node;
    double bound;
  };
  Entry stack[128];
  int depth = 0;
  stack[depth++] = {0, box_bound(tree.nodes[0], n, abs_n)};
  while (depth > 0) {
    const Entry entry = stack[--depth];
    if (entry.bound < threshold()) continue;
    const SupportTree::Node& node = tree.nodes[entry.node];
    if (node.child == 0) {
      leaf(node.begin, node.begin + node.count);
      continue;
    }
    Entry near{node.child, box_bound(tree.nodes[node.child], n, abs_n)};
    Entry far{node.child + 1, box_bound(tree.nodes[node.child + 1], n, abs_n)};
    if (near.bound < far.bound) std::swap(near, far);
    stack[depth++] = far;
    stack[depth++] = near;
  }
}

// The same text compiled for several instruction sets, chosen when the program starts. No set fuses or reorders anything
// (-ffp-contract=off, one lane one sum), so all give the same bits. Sanitizers run before such a choice can.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define CLEARANCE_CLONES __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define CLEARANCE_CLONES
#endif

// Eight lanes keep their own best, so that the loop has no chain of dependent comparisons and the compiler vectorises it.
CLEARANCE_CLONES SupportPoint<double> scan(const Piece& piece, const Vec3d& n) {
  constexpr int kLanes = 8;
  const std::size_t count = piece.x.size();
  const double *x = piece.x.data(), *y = piece.y.data(), *z = piece.z.data();
  SupportPoint<double> best{0, dot(n, Vec3d{x[0], y[0], z[0]})};
  std::size_t i = 0;
  if (count >= 2 * kLanes) {
    double lane_best[kLanes], lane_index[kLanes];
    for (int k = 0; k < kLanes; ++k) {
      lane_best[k] = n.x * x[k] + n.y * y[k] + n.z * z[k];
      lane_index[k] = k;
    }
    for (i = kLanes; i + kLanes <= count; i += kLanes)
      for (int k = 0; k < kLanes; ++k) {
        const double s = n.x * x[i + k] + n.y * y[i + k] + n.z * z[i + k];
        const bool better = s > lane_best[k];
        lane_best[k] = better ? s : lane_best[k];
        lane_index[k] = better ? static_cast<double>(i + k) : lane_index[k];
      }
    best = {static_cast<std::uint32_t>(lane_index[0]), lane_best[0]};
    for (int k = 1; k < kLanes; ++k) {
      const auto index = static_cast<std::uint32_t>(lane_index[k]);
      if (lane_best[k] > best.value || (lane_best[k] == best.value && index < best.index)) best = {index, lane_best[k]};
    }
  }
  for (; i < count; ++i) {
    const double s = n.x * x[i] + n.y * y[i] + n.z * z[i];
    if (s > best.value) best = {static_cast<std::uint32_t>(i), s};
  }
  return best;
}

struct TreeBuilder {
  const std::vector<Vec3d>& vertices;
  SupportTree& tree;

  // Splits order[begin, end) under the node at `index`; its descendants take the nodes from `next` on.
  // A median split makes the number of nodes below a range depend on its size alone, so subtrees build side by side.
  static std::uint32_t descendants(std::uint32_t count) {
    if (count <= kLeafVertices) return 0;
    const std::uint32_t left = count / 2;
    return 2 + descendants(left) + descendants(count - left);
  }

  void build(std::uint32_t index, std::uint32_t next, std::uint32_t begin, std::uint32_t end) {
    SupportTree::Node& node = tree.nodes[index];
    Vec3d low = vertices[tree.order[begin]], high = low;
    for (std::uint32_t i = begin; i < end; ++i)
      for (int k = 0; k < 3; ++k) {
        low[k] = std::min(low[k], vertices[tree.order[i]][k]);
        high[k] = std::max(high[k], vertices[tree.order[i]][k]);
      }
    node.centre = 0.5 * low + 0.5 * high;
    for (int k = 0; k < 3; ++k)
      node.half[k] = std::max(high[k] - node.centre[k], node.centre[k] - low[k]) * (1 + 4 * kUnitRoundoff);
    const std::uint32_t count = end - begin;
    if (count <= kLeafVertices) {
      node.begin = begin;
      node.count = count;
      return;
    }
    const Vec3d size = high - low;
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : (size.y >= size.z ? 1 : 2);
    const std::uint32_t middle = begin + count / 2;
    std::nth_element(tree.order.begin() + begin, tree.order.begin() + middle, tree.order.begin() + end,
                     [&](std::uint32_t a, std::uint32_t b) {
                       return vertices[a][axis] < vertices[b][axis] || (vertices[a][axis] == vertices[b][axis] && a < b);
                     });
    node.child = next;
    const std::uint32_t left = next + 2, right = left + descendants(middle - begin);
#pragma omp task if (count > kTaskVertices)
    build(next, left, begin, middle);
    build(next + 1, right, middle, end);
#pragma omp taskwait
  }
};

double upper_length(const Vec3d& n) { return norm(n) * (1 + 4 * kUnitRoundoff); }

}  // namespace

SupportTree make_support_tree(const std::vector<Vec3d>& vertices) {
  SupportTree tree;
  const auto count = static_cast<std::uint32_t>(vertices.size());
  tree.order.resize(count);
  std::iota(tree.order.begin(), tree.order.end(), 0u);
  tree.nodes.resize(1 + TreeBuilder::descendants(count));
  TreeBuilder builder{vertices, tree};
#pragma omp parallel if (count > kTaskVertices)
#pragma omp single
  builder.build(0, 1, 0, count);
  tree.points.resize(count);
  for (std::uint32_t i = 0; i < count; ++i) tree.points[i] = vertices[tree.order[i]];
  return tree;
}

SupportPoint<double> support(const Piece& piece, const Vec3d& n, std::uint32_t hint) {
  if (!piece.tree) return scan(piece, n);
  const SupportTree& tree = *piece.tree;
  SupportPoint<double> best{hint, dot(n, piece.vertices[hint])};
  if (!piece.adjacency.empty()) best = climb(piece, n, hint);
  visit(
      tree, n, [&] { return best.value; },
      [&](std::uint32_t begin, std::uint32_t end) {
        for (std::uint32_t i = begin; i < end; ++i) {
          const double s = dot(n, tree.points[i]);
          if (s > best.value || (s == best.value && tree.order[i] < best.index)) best = {tree.order[i], s};
        }
      });
  return best;
}

// Only vertices whose double value is within rounding of the best double value can be the exact maximum:
// |computed - exact| <= 4 u |n| rho for each (n itself is rounded to double first), so twice that separates two of them.
SupportPoint<DoubleDouble> support(const Piece& piece, const Vec3<DoubleDouble>& n, std::uint32_t hint) {
  const Vec3d n_hi{n.x.hi, n.y.hi, n.z.hi};
  const SupportPoint<double> guess = support(piece, n_hi, hint);
  const double threshold = guess.value - 10 * kUnitRoundoff * upper_length(n_hi) * piece.rho;
  SupportPoint<DoubleDouble> best{guess.index, dot(n, cast<DoubleDouble>(piece.vertices[guess.index]))};
  const auto consider = [&](std::uint32_t index, const Vec3d& v) {
    if (dot(n_hi, v) < threshold) return;
    const DoubleDouble s = dot(n, cast<DoubleDouble>(v));
    if (s > best.value || (s == best.value && index < best.index)) best = {index, s};
  };
  if (piece.tree) {
    const SupportTree& tree = *piece.tree;
    visit(
        tree, n_hi, [&] { return threshold; },
        [&](std::uint32_t begin, std::uint32_t end) {
          for (std::uint32_t i = begin; i < end; ++i) consider(tree.order[i], tree.points[i]);
        });
  } else {
    for (std::uint32_t i = 0; i < piece.vertices.size(); ++i) consider(i, piece.vertices[i]);
  }
  return best;
}

SupportPoint<double> climb(const Piece& piece, const Vec3d& n, std::uint32_t hint) {
  SupportPoint<double> best{hint, dot(n, piece.vertices[hint])};
  for (bool moved = true; moved;) {
    moved = false;
    const std::uint32_t from = best.index;
    for (std::uint32_t k = piece.adjacency_begin[from]; k < piece.adjacency_begin[from + 1]; ++k) {
      const std::uint32_t neighbour = piece.adjacency[k];
      const double s = dot(n, piece.vertices[neighbour]);
      if (s > best.value) {
        best = {neighbour, s};
        moved = true;
      }
    }
  }
  return best;
}

}  // namespace clearance
