#include "engine/reduce/near_pairs.h"

#include <algorithm>
#include <cassert>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <string>

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

// Number of bodies below which a search of a tree takes longer than comparing all boxes (docs/results/broad.csv).
constexpr std::uint64_t kTreeFromBodies = 64;
// Pairs of boxes that can be compared in the time of one tree search.
constexpr std::uint64_t kPairsPerWalk = 32;

}  // namespace

NearBy near_by_name(std::string_view name) {
  if (name == "auto") return NearBy::kAuto;
  if (name == "brute") return NearBy::kBrute;
  if (name == "tree") return NearBy::kTree;
  throw std::invalid_argument("broad phase: expected auto, brute or tree, got '" + std::string(name) + "'");
}

bool tree_pays(std::uint64_t bodies, std::uint64_t pairs, std::uint64_t probes) {
  return bodies >= kTreeFromBodies && pairs >= kPairsPerWalk * probes;
}

std::unique_ptr<BoxTree> BoxTreeStore::take() {
  const std::lock_guard lock(mutex_);
  if (trees_.empty()) return std::make_unique<BoxTree>();
  std::unique_ptr<BoxTree> tree = std::move(trees_.back());
  trees_.pop_back();
  return tree;
}

void BoxTreeStore::put_back(std::unique_ptr<BoxTree> tree, std::uint64_t builds) {
  const std::lock_guard lock(mutex_);
  builds_ += builds;
  if (trees_.size() < kTrees) trees_.push_back(std::move(tree));
}

std::uint64_t BoxTreeStore::bytes() const {
  const std::lock_guard lock(mutex_);
  std::uint64_t sum = 0;
  for (const auto& tree : trees_) sum += tree->bytes();
  return sum;
}

std::uint64_t BoxTreeStore::builds() const {
  const std::lock_guard lock(mutex_);
  return builds_;
}

NearPairs::NearPairs(const engine::Scene& scene, const Plan& plan, std::span<const Aabb> boxes, BoxTreeStore& store,
                     NearBy by)
    : bodies_(static_cast<std::uint32_t>(scene.bodies().size())) {
  const bool everything = plan.query.reduce == Reduce::kWithin && plan.query.max_distance == kInf;
  if (by == NearBy::kBrute || boxes.empty() || everything || !find_probes(plan, by == NearBy::kTree)) return;
  store_ = store.shared_from_this();
  tree_ = store_->take();
  builds_before_ = tree_->builds();
  std::vector<std::uint32_t> ids(bodies_);
  std::iota(ids.begin(), ids.end(), 0u);
  if (plan.moved.empty() || plan.query.configuration_count == 0) {
    tree_->fit(ids, boxes);
  } else {  // moving bodies are not in this tree
    std::vector<Aabb> staying(boxes.begin(), boxes.end());
    for (const std::uint32_t b : plan.moved) staying[b] = {{kInf, kInf, kInf}, {-kInf, -kInf, -kInf}};
    tree_->fit(ids, staying);
  }
  // In the tree's order, a probe finds in the caches the data that the one before it read.
  std::vector<std::uint32_t> in_order;
  for (const std::uint32_t b : tree_->order())
    if (b != kNone && is_probe_[b]) in_order.push_back(b);
  probes_ = std::move(in_order);
}

NearPairs::~NearPairs() {
  if (!tree_) return;
  const std::uint64_t builds = tree_->builds() - builds_before_;
  store_->put_back(std::move(tree_), builds);
}

// Selects the body with more pairs as the probe of a pair. Returns false if no tree contains the pairs or pays.
bool NearPairs::find_probes(const Plan& plan, bool always) {
  is_probe_.assign(bodies_, 0);
  if (plan.pairs.is_whole_table() && plan.query.configuration_count == 0) {
    table_ = plan.pairs.table();
    is_probe_.assign(bodies_, 1);
    if (always || tree_pays(bodies_, plan.pairs.size(), bodies_)) return true;
    table_ = nullptr;
    return false;
  }
  // Each body of a list would be a probe for its own nearest.
  if (plan.pairs.is_whole_table() || plan.query.reduce == Reduce::kNearest) return false;
  list_ = plan.pairs.list();
  if (!always && bodies_ < kTreeFromBodies) return false;
  std::vector<std::uint32_t> pairs_of(bodies_, 0);
  for (std::size_t i = 0; i < list_.size(); ++i) {
    const auto [a, b] = list_[i];
    if (a >= b || b >= bodies_ || (i > 0 && !(list_[i - 1] < list_[i]))) return false;
    ++pairs_of[a], ++pairs_of[b];
  }
  row_begin_.assign(bodies_ + 1, 0);
  std::uint64_t probes = 0;
  for (const auto [a, b] : list_) {
    std::uint8_t& one = is_probe_[pairs_of[a] >= pairs_of[b] ? a : b];
    probes += !one;
    one = 1;
    ++row_begin_[a + 1];
  }
  std::partial_sum(row_begin_.begin(), row_begin_.end(), row_begin_.begin());
  return always || tree_pays(bodies_, list_.size(), probes);
}

std::uint64_t NearPairs::position(std::uint32_t a, std::uint32_t b) const {
  if (a > b) std::swap(a, b);
  if (table_) return table_->enabled(a, b) ? table_->position({a, b}) : kNowhere;
  const auto begin = list_.begin() + static_cast<std::ptrdiff_t>(row_begin_[a]);
  const auto end = list_.begin() + static_cast<std::ptrdiff_t>(row_begin_[a + 1]);
  const auto found = std::lower_bound(begin, end, BodyPair{a, b});
  return found != end && found->b == b ? static_cast<std::uint64_t>(found - list_.begin()) : kNowhere;
}

std::uint64_t NearPairs::first_position(std::uint32_t body) const {
  assert(table_ && body < bodies_);
  for (std::uint32_t b = 0; b < bodies_; ++b)
    if (b != body && table_->enabled(body, b)) return position(body, b);
  return kNowhere;
}

void TreeSearch::place(const BodyPoses& placement) {
  const bool there = placement_ && stood_at_ == placement.number(), first = !placement_;
  placement_ = &placement;
  stood_at_ = placement.number();
  if (there) return;
  if (first) {
    for (std::uint32_t b = 0; b < scene_.bodies().size(); ++b)
      if (placement[b].status != Status::kOk && !placement.moves(b)) unplaced_.push_back(b);
    staying_unplaced_ = unplaced_.size();
  }
  if (!placement.moves_any()) return;
  unplaced_.resize(staying_unplaced_);
  for (const std::uint32_t b : plan_.moved)
    if (placement[b].status != Status::kOk) unplaced_.push_back(b);
  if (slots_.empty()) {
    slots_.resize(plan_.moved.size());
    std::iota(slots_.begin(), slots_.end(), 0u);
  }
  boxes_.clear();
  for (const std::uint32_t b : plan_.moved) boxes_.push_back(placement.box(b));
  moving_.fit(slots_, boxes_);
}

// Offers (gap, position) of a body's pairs in the query.
template <class Offer>
void TreeSearch::evaluate(std::uint32_t body, double bound, Offer&& offer) const {
  assert(placement_ && near_pairs_.by_tree());
  if ((*placement_)[body].status != Status::kOk) return;
  const Aabb box = placement_->box(body);
  const auto of_query = [&](double gap, std::uint32_t other) {
    if (const std::uint64_t position = near_pairs_.position(body, other); position != NearPairs::kNowhere)
      bound = offer(gap, position, other);
    return bound;
  };
  near_pairs_.tree().nearest(box, bound, of_query);
  moving_.nearest(box, bound, [&](double gap, std::uint32_t slot) { return of_query(gap, plan_.moved[slot]); });
}

TreeSearch::Seed TreeSearch::nearest(std::uint32_t body, Seed best) const {
  evaluate(body, best.gap, [&](double gap, std::uint64_t position, std::uint32_t) {
    best = std::min(best, Seed{gap, position});
    return best.gap;
  });
  return best;
}

void TreeSearch::around(std::uint32_t body, double margin, bool all, std::vector<std::uint64_t>& positions) const {
  evaluate(body, margin, [&](double, std::uint64_t position, std::uint32_t other) {
    if (all || other > body || !near_pairs_.is_probe(other)) positions.push_back(position);
    return margin;
  });
}

void TreeSearch::pairs(std::uint32_t first, std::uint32_t last, double margin, std::vector<std::uint64_t>& positions) {
  found_pairs_.clear();
  near_pairs_.tree().pairs_within(first, last, margin, found_pairs_);
  for (const auto [a, b] : found_pairs_)
    if (const std::uint64_t position = near_pairs_.position(a, b); position != NearPairs::kNowhere)
      positions.push_back(position);
}

}  // namespace clearance
