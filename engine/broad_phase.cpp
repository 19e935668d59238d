#include "broad_phase.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace clearance {

namespace {

// Where the tree begins to win: measured by bench_broad_phase (docs/performance.md).
constexpr std::size_t kTreeFromBodies = 200;

class BruteForce final : public BroadPhase {
 public:
  std::string_view name() const override { return "brute"; }

  void candidates(std::span<const Aabb> boxes, double margin, std::vector<BodyPair>& out) const override {
    const auto n = static_cast<std::uint32_t>(boxes.size());
    for (std::uint32_t a = 0; a < n; ++a)
      for (std::uint32_t b = a + 1; b < n; ++b)
        if (certify_box_gap(boxes[a], boxes[b]) <= margin) out.push_back({a, b});
  }
};

class Tree final : public BroadPhase {
 public:
  std::string_view name() const override { return "tree"; }

  void candidates(std::span<const Aabb> boxes, double margin, std::vector<BodyPair>& out) const override {
    Build build{boxes, {}, {}};
    for (std::uint32_t i = 0; i < boxes.size(); ++i)
      if (certify_box_gap(boxes[i], boxes[i]) <= margin) build.order.push_back(i);  // false for an empty box
    if (build.order.size() < 2) return;
    build.nodes.reserve(2 * build.order.size());
    build.nodes.emplace_back();
    build.split(0, 0, static_cast<std::uint32_t>(build.order.size()));
    const std::size_t first = out.size();
    std::vector<std::uint32_t> stack;
    for (const std::uint32_t a : build.order) {
      stack.assign(1, 0);
      while (!stack.empty()) {
        const Node& node = build.nodes[stack.back()];
        stack.pop_back();
        // Only partners b > a count, so whole subtrees of smaller ids fall away.
        if (node.greatest <= a || !(certify_box_gap(boxes[a], node.box) <= margin)) continue;
        if (node.child == 0) {
          for (std::uint32_t k = node.begin; k < node.end; ++k) {
            const std::uint32_t b = build.order[k];
            if (b > a && certify_box_gap(boxes[a], boxes[b]) <= margin) out.push_back({a, b});
          }
        } else {
          stack.push_back(node.child);
          stack.push_back(node.child + 1);
        }
      }
    }
    std::sort(out.begin() + static_cast<std::ptrdiff_t>(first), out.end());
  }

 private:
  struct Node {
    Aabb box;
    std::uint32_t child = 0;  // 0: a leaf; else the first of two
    std::uint32_t begin = 0, end = 0;
    std::uint32_t greatest = 0;  // largest body id below
  };

  struct Build {
    std::span<const Aabb> boxes;
    std::vector<std::uint32_t> order;
    std::vector<Node> nodes;

    void split(std::uint32_t index, std::uint32_t begin, std::uint32_t end) {
      Node node;
      node.box = boxes[order[begin]];
      node.begin = begin;
      node.end = end;
      Vec3d low = centre(order[begin]), high = low;
      for (std::uint32_t k = begin; k < end; ++k) {
        const Aabb& box = boxes[order[k]];
        const Vec3d c = centre(order[k]);
        for (int i = 0; i < 3; ++i) {
          node.box.low[i] = std::min(node.box.low[i], box.low[i]);
          node.box.high[i] = std::max(node.box.high[i], box.high[i]);
          low[i] = std::min(low[i], c[i]);
          high[i] = std::max(high[i], c[i]);
        }
        node.greatest = std::max(node.greatest, order[k]);
      }
      if (end - begin > kLeaf) {
        const Vec3d size = high - low;
        const int axis = size.x >= size.y && size.x >= size.z ? 0 : (size.y >= size.z ? 1 : 2);
        const std::uint32_t middle = begin + (end - begin) / 2;
        std::nth_element(order.begin() + begin, order.begin() + middle, order.begin() + end,
                         [&](std::uint32_t p, std::uint32_t q) { return centre(p)[axis] < centre(q)[axis]; });
        node.child = static_cast<std::uint32_t>(nodes.size());
        nodes.resize(nodes.size() + 2);
        split(node.child, begin, middle);
        split(node.child + 1, middle, end);
      }
      nodes[index] = node;
    }

    Vec3d centre(std::uint32_t body) const { return 0.5 * boxes[body].low + 0.5 * boxes[body].high; }
    static constexpr std::uint32_t kLeaf = 4;
  };
};

}  // namespace

std::unique_ptr<BroadPhase> make_brute_force_broad_phase() { return std::make_unique<BruteForce>(); }
std::unique_ptr<BroadPhase> make_tree_broad_phase() { return std::make_unique<Tree>(); }

const BroadPhase& broad_phase_for(std::size_t bodies) {
  static const BruteForce brute;
  static const Tree tree;
  if (bodies < kTreeFromBodies) return brute;
  return tree;
}

}  // namespace clearance
