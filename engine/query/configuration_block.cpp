#include "engine/query/configuration_block.h"

#include <algorithm>
#include <cassert>

namespace clearance {

namespace {

constexpr std::uint64_t kMostConfigurations = 256;
constexpr std::uint64_t kMostPairs = 1u << 16;     // pair-configurations of a block: some 10 MB if all are near
constexpr std::uint64_t kMostWithoutBoxes = 1024;  // ... where each makes its own boxes
constexpr std::uint64_t kBlocksPerWorker = 4;      // at least, if there are several workers
constexpr std::uint64_t kBoxesPerUnit = 64;        // of work, side by side

}  // namespace

std::uint64_t ConfigurationBlock::most(const Scene& scene, const Plan& plan, bool by_tree, bool with_boxes,
                                       int workers) {
  // Each configuration would have a tree of its own, and walks through it find what is near soon enough.
  if (by_tree) return 1;
  const std::uint64_t most_pairs = with_boxes ? kMostPairs : kMostWithoutBoxes;
  const std::uint64_t count = plan.size.configurations, pairs = std::max<std::uint64_t>(plan.size.pairs, 1);
  const std::uint64_t shares = workers > 1 ? kBlocksPerWorker * static_cast<std::uint64_t>(workers) : 1;
  return std::clamp<std::uint64_t>(
      std::min({kMostConfigurations, most_pairs / pairs, Placement::most(scene, plan), count / shares}), 1,
      std::max<std::uint64_t>(count, 1));
}

ConfigurationBlock::ConfigurationBlock(const Scene& scene, const Plan& plan, const EvaluateOptions& options,
                                       const Reduction::Boxes& boxes, std::uint64_t most)
    : plan_(plan),
      compares_boxes_(!boxes.all.empty() && !boxes.near_pairs.by_tree()),
      boxes_(scene, plan),
      cull_(scene, boxes.all, boxes.columns),
      evaluator_(scene, options) {
  reductions_.reserve(most);
  for (std::uint64_t i = 0; i < most; ++i) reductions_.emplace_back(scene, plan, options, boxes, 1);
  if (compares_boxes_ && most >= BoxCull::kSideBySideFrom && BlockSearch::fits(scene, plan, options)) {
    most_searched_ = BlockSearch::kMostPiecePairs / std::max<std::uint64_t>(BlockSearch::piece_pairs(scene, plan), 1);
    if (most_searched_ > 0) search_.emplace(scene, plan, options);
  }
}

void ConfigurationBlock::begin(std::span<Placement> placed, std::uint64_t first) {
  assert(!placed.empty() && placed.size() <= reductions_.size());
  placed_ = placed;
  first_ = first;
  gaps_ = {};
  is_asked_ = false;
  for (std::size_t i = 0; i < placed.size(); ++i) reductions_[i].begin();
  searched_ = makes_boxes(placed.size()) ? 0 : placed.size();
  is_searching_ = false;
}

// What can be searched for many configurations together; the rest is left to their reductions.
bool ConfigurationBlock::search(WorkMeter& meter) {
  for (; searched_ < placed_.size(); is_searching_ = false) {
    const std::uint64_t count = std::min<std::uint64_t>(placed_.size() - searched_, most_searched_);
    if (!is_searching_) {
      const std::span<const Placement> part = std::span<const Placement>(placed_).subspan(searched_, count);
      boxes_.make(part);
      const auto pairs = plan_.pairs.slice(0, plan_.pairs.size(), room_);
      search_->begin(part, boxes_, cull_.gap_rows(pairs, boxes_));
      meter.count(pairs.size() * count / kBoxesPerUnit);
      is_searching_ = true;
    }
    if (!search_->advance(meter)) return false;
    for (std::uint64_t i = 0; i < count; ++i)
      if (search_->is_searched(i)) reductions_[searched_ + i].settle(search_->found(i));
    searched_ += count;
  }
  return true;
}

bool ConfigurationBlock::advance(WorkMeter& meter) {
  if (!search(meter)) return false;
  while (true) {
    if (!is_asked_) {
      if (!ask(meter)) return true;
      answers_.resize(std::max(answers_.size(), asked_.size()));
      evaluator_.begin(asked_, answers_);
      is_asked_ = true;
    }
    if (!evaluator_.advance(meter)) return false;
    is_asked_ = false;
    take();
    if (meter.is_over()) return false;
  }
}

// What all configurations want to know next, in asked_. False: nothing.
bool ConfigurationBlock::ask(WorkMeter& meter) {
  const auto is_done = [](const Reduction& r) { return r.stage() == Reduction::kDone; };
  if (std::all_of(reductions_.begin(), reductions_.begin() + static_cast<std::ptrdiff_t>(placed_.size()), is_done))
    return false;
  if (compares_boxes_ && gaps_.empty()) {
    for (Placement& here : placed_) here.make_boxes();
    gaps_ = cull_.gaps(plan_.pairs.slice(0, plan_.pairs.size(), room_), placed_);
    meter.count(gaps_.size() / kBoxesPerUnit);
  }
  asked_.clear();
  asked_end_.clear();
  for (std::size_t i = 0; i < placed_.size(); ++i) {
    while (reductions_[i].stage() != Reduction::kDone && !ask(i, meter)) reductions_[i].end_stage();
    asked_end_.push_back(asked_.size());
  }
  return !asked_.empty();
}

// What the current stage of a configuration wants to know next; false: the stage is over.
bool ConfigurationBlock::ask(std::size_t i, WorkMeter& meter) {
  Reduction& r = reductions_[i];
  if (r.stage() == Reduction::kSeeds || r.stage() == Reduction::kCandidates) return r.ask(placed_[i], asked_);
  const std::uint64_t pairs = plan_.pairs.size();
  if (compares_boxes_)
    r.scan(gaps_.subspan(i * pairs, pairs), placed_[i]);
  else
    for (std::uint64_t unit = 0; unit < r.units(); ++unit) r.run(unit, 0, placed_[i], meter);
  return false;
}

void ConfigurationBlock::take() {
  std::size_t begin = 0;
  for (std::size_t i = 0; i < placed_.size(); ++i) {
    if (asked_end_[i] > begin) reductions_[i].take(std::span(answers_).subspan(begin, asked_end_[i] - begin));
    begin = asked_end_[i];
  }
}

std::uint64_t ConfigurationBlock::end(std::span<std::vector<Row>> rows) {
  assert(rows.size() == placed_.size());
  std::uint64_t evaluated = 0;
  for (std::size_t i = 0; i < placed_.size(); ++i) {
    rows[i] = reductions_[i].rows(static_cast<std::uint32_t>(first_ + i), placed_[i]);
    evaluated += reductions_[i].evaluated();
  }
  placed_ = {};
  return evaluated;
}

}  // namespace clearance
