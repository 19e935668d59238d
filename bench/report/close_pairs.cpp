#include "bench/report/close_pairs.h"

#include <omp.h>

#include <algorithm>
#include <stdexcept>

#include "engine/hull/box.h"

namespace clearance::baselines {

namespace {

// The report does not define its cost; surface area is common for such trees.
double cost(const Aabb& box) {
  const Vec3d e = box.high - box.low;
  return 2 * (e.x * e.y + e.y * e.z + e.z * e.x);
}

bool near(const Aabb& a, const Aabb& b, double margin) {
  for (int k = 0; k < 3; ++k)  // the report's test, of a box grown by the margin
    if (!(a.low[k] <= b.high[k] + margin && b.low[k] <= a.high[k] + margin)) return false;
  return certify_box_gap(a, b) <= margin;  // corners
}

bool is_empty(const Aabb& box) {
  return !(box.low.x <= box.high.x);
}

}  // namespace

struct AabbTree::Node {
  Aabb box;
  std::uint32_t id = 0;               // of a leaf
  std::unique_ptr<Node> left, right;  // both or none
};

AabbTree::AabbTree(Insert insert) : insert_(insert) {}

AabbTree::~AabbTree() {
  std::vector<std::unique_ptr<Node>> waiting;  // explicit stack: the tree may be a list of thousands
  if (root_) waiting.push_back(std::move(root_));
  while (!waiting.empty()) {
    const std::unique_ptr<Node> node = std::move(waiting.back());
    waiting.pop_back();
    if (node->left) waiting.push_back(std::move(node->left)), waiting.push_back(std::move(node->right));
  }
}

void AabbTree::insert(std::uint32_t id, const Aabb& box) {
  auto leaf = std::make_unique<Node>();
  leaf->box = box;
  leaf->id = id;
  root_ = root_ ? insert(std::move(root_), std::move(leaf)) : std::move(leaf);
}

bool AabbTree::goes_left(const Node& node, const Aabb& box, bool& branch) {
  branch = false;
  if (insert_ == Insert::kLeft) return true;
  counts_.costs += 3;
  const double grown = cost(joined(node.box, box)) - cost(node.box);
  double left = cost(joined(node.left->box, box)) - cost(node.left->box);
  double right = cost(joined(node.right->box, box)) - cost(node.right->box);
  double here = grown;
  if (insert_ == Insert::kNewParent) {  // descending would enlarge this node as well; a leaf gets a new parent in turn
    here = grown + cost(node.box);
    left += grown + (node.left->left ? 0 : cost(node.left->box));
    right += grown + (node.right->left ? 0 : cost(node.right->box));
  }
  branch = here < left && here < right;
  return left < right;
}

std::unique_ptr<AabbTree::Node> AabbTree::insert(std::unique_ptr<Node> node, std::unique_ptr<Node> leaf) {
  ++counts_.visited_by_inserts;
  const Aabb box = joined(node->box, leaf->box);
  bool branch = !node->left;
  const bool left = branch || goes_left(*node, leaf->box, branch);
  if (branch) {
    auto parent = std::make_unique<Node>();
    parent->left = std::move(node);
    parent->right = std::move(leaf);
    parent->box = box;
    return parent;
  }
  std::unique_ptr<Node>& child = left ? node->left : node->right;
  child = insert(std::move(child), std::move(leaf));
  node->box = box;
  return node;
}

void AabbTree::query(const Aabb& box, double margin, std::vector<std::uint32_t>& found) const {
  if (root_) query(*root_, box, margin, found);
}

void AabbTree::query(const Node& node, const Aabb& box, double margin, std::vector<std::uint32_t>& found) {
  if (!near(node.box, box, margin)) return;
  if (!node.left) {
    found.push_back(node.id);
    return;
  }
  query(*node.left, box, margin, found);
  query(*node.right, box, margin, found);
}

TreeCounts AabbTree::counts() const {
  TreeCounts counts = counts_;
  std::vector<std::pair<const Node*, std::uint64_t>> waiting;
  if (root_) waiting.push_back({root_.get(), 1});
  while (!waiting.empty()) {
    const auto [node, depth] = waiting.back();
    waiting.pop_back();
    counts.depth = std::max(counts.depth, depth);
    if (node->left) waiting.push_back({node->left.get(), depth + 1}), waiting.push_back({node->right.get(), depth + 1});
  }
  return counts;
}

namespace {

/// Common part of all methods: finds each box's partners separately, in one thread or several, and joins the results.
class ClosePairs : public BroadPhase {
 public:
  ClosePairs(std::string_view name, int threads) : name_(name), threads_(threads) {}
  std::string_view name() const override { return name_; }

 protected:
  /// \param partners_of (body, list to which it appends partners with larger ids, ascending); called by several threads
  template <class PartnersOf>
  void for_all(std::size_t bodies, const PartnersOf& partners_of, std::vector<BodyPair>& out) const {
    std::vector<std::vector<BodyPair>> rows(threads_ > 1 ? bodies : 0);
    if (threads_ == 1) {
      for (std::uint32_t a = 0; a < bodies; ++a) partners_of(a, out);
      return;
    }
#pragma omp parallel for schedule(dynamic, 8) num_threads(threads_)
    for (std::size_t a = 0; a < bodies; ++a) partners_of(static_cast<std::uint32_t>(a), rows[a]);
    for (const std::vector<BodyPair>& row : rows) out.insert(out.end(), row.begin(), row.end());
  }

  std::string name_;
  int threads_;
};

class AllPairs final : public ClosePairs {
 public:
  using ClosePairs::ClosePairs;
  void candidates(std::span<const Aabb> boxes, double margin, std::vector<BodyPair>& out) const override {
    for_all(
        boxes.size(),
        [&](std::uint32_t a, std::vector<BodyPair>& pairs) {
          for (std::uint32_t b = a + 1; b < boxes.size(); ++b)
            if (near(boxes[a], boxes[b], margin) && !is_empty(boxes[a]) && !is_empty(boxes[b])) pairs.push_back({a, b});
        },
        out);
  }
};

class Tree final : public ClosePairs {
 public:
  Tree(std::string_view name, AabbTree::Insert insert, int threads) : ClosePairs(name, threads), insert_(insert) {}
  void candidates(std::span<const Aabb> boxes, double margin, std::vector<BodyPair>& out) const override {
    AabbTree tree(insert_);
    for (std::uint32_t i = 0; i < boxes.size(); ++i)
      if (!is_empty(boxes[i])) tree.insert(i, boxes[i]);
    for_all(
        boxes.size(),
        [&](std::uint32_t a, std::vector<BodyPair>& pairs) {
          if (is_empty(boxes[a])) return;
          thread_local std::vector<std::uint32_t> found;
          found.clear();
          tree.query(boxes[a], margin, found);
          std::sort(found.begin(), found.end());
          for (const std::uint32_t b : found)
            if (b > a) pairs.push_back({a, b});
        },
        out);
  }

 private:
  AabbTree::Insert insert_;
};

}  // namespace

const std::vector<std::string>& close_pairs_names() {
  static const std::vector<std::string> names{"aabb_naive", "aabb_naive_omp", "aabb_tree", "aabb_tree_noheuristic",
                                              "aabb_tree_omp"};
  return names;
}

std::unique_ptr<BroadPhase> make_close_pairs(std::string_view name, int threads) {
  if (threads == 0) threads = omp_get_max_threads();
  using Insert = AabbTree::Insert;
  if (name == "aabb_naive") return std::make_unique<AllPairs>(name, 1);
  if (name == "aabb_naive_omp") return std::make_unique<AllPairs>(name, threads);
  if (name == "aabb_tree") return std::make_unique<Tree>(name, Insert::kCost, 1);
  if (name == "aabb_tree_noheuristic") return std::make_unique<Tree>(name, Insert::kLeft, 1);
  if (name == "aabb_tree_omp") return std::make_unique<Tree>(name, Insert::kCost, threads);
  std::string known;
  for (const std::string& n : close_pairs_names()) known += (known.empty() ? "" : ", ") + n;
  throw std::invalid_argument("there is no baseline \"" + std::string(name) + "\" for close pairs; there are " + known);
}

}  // namespace clearance::baselines
