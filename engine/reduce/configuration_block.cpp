#include "engine/reduce/configuration_block.h"

#include <algorithm>
#include <cassert>
#include <numeric>

namespace clearance {

namespace {

constexpr std::uint64_t kMostConfigurations = 256;
constexpr std::uint64_t kMostPairs = 1u << 16;     // pair-configurations of a block: some 10 MB if all are near
constexpr std::uint64_t kMostWithoutBoxes = 1024;  // the same if each makes its own boxes
constexpr std::uint64_t kBlocksPerWorker = 4;      // at least, if there are several workers
constexpr std::uint64_t kBoxesPerUnit = 64;        // of work, side by side

}  // namespace

std::uint64_t ConfigurationBlock::most(const engine::Scene& scene, const Plan& plan, bool by_tree, bool with_boxes,
                                       int workers) {
  // Each configuration would need a tree of its own, and a search in it finds near pairs soon enough.
  if (by_tree) return 1;
  const std::uint64_t most_pairs = with_boxes ? kMostPairs : kMostWithoutBoxes;
  const std::uint64_t count = plan.size.configurations, pairs = std::max<std::uint64_t>(plan.size.pairs, 1);
  const std::uint64_t shares = workers > 1 ? kBlocksPerWorker * static_cast<std::uint64_t>(workers) : 1;
  return std::clamp<std::uint64_t>(
      std::min({kMostConfigurations, most_pairs / pairs, BodyPoses::most(scene, plan), count / shares}), 1,
      std::max<std::uint64_t>(count, 1));
}

ConfigurationBlock::ConfigurationBlock(const engine::Scene& scene, const Plan& plan, const EvaluateOptions& options,
                                       const Reduction::Boxes& boxes, std::uint64_t most)
    : plan_(plan),
      compares_boxes_(!boxes.all.empty() && !boxes.near_pairs.by_tree()),
      cull_(scene, boxes.all, boxes.columns),
      evaluator_(scene, options) {
  reductions_.reserve(most);
  for (std::uint64_t i = 0; i < most; ++i) reductions_.emplace_back(scene, plan, options, boxes, 1);
}

void ConfigurationBlock::begin(std::span<const BodyPoses> placed, std::uint64_t first) {
  std::vector<std::uint64_t> configurations(placed.size());
  std::iota(configurations.begin(), configurations.end(), first);
  begin(placed, configurations, {});
}

void ConfigurationBlock::begin(std::span<const BodyPoses> placed, std::span<const std::uint64_t> configurations,
                               std::span<const std::span<const std::uint64_t>> open) {
  assert(!placed.empty() && placed.size() <= reductions_.size());
  placed_ = placed;
  configurations_.assign(configurations.begin(), configurations.end());
  open_.assign(open.begin(), open.end());
  gaps_ = {};
  is_evaluating_ = false;
  for (std::size_t i = 0; i < placed.size(); ++i) reductions_[i].begin();
}

bool ConfigurationBlock::advance(WorkMeter& meter) {
  while (true) {
    if (!is_evaluating_) {
      if (!collect_pairs(meter)) return true;
      answers_.resize(std::max(answers_.size(), to_evaluate_.size()));
      evaluator_.begin(to_evaluate_, answers_);
      is_evaluating_ = true;
    }
    if (!evaluator_.advance(meter)) return false;
    is_evaluating_ = false;
    take();
    if (meter.is_over()) return false;
  }
}

// Collects the next pairs of all configurations in to_evaluate_. Returns false if there are none.
bool ConfigurationBlock::collect_pairs(WorkMeter& meter) {
  if (compares_boxes_ && gaps_.empty() && open_.empty()) {
    gaps_ = cull_.gaps(plan_.pairs.slice(0, plan_.pairs.size(), pairs_), placed_);
    meter.count(gaps_.size() / kBoxesPerUnit);
  }
  to_evaluate_.clear();
  evaluated_end_.clear();
  for (std::size_t i = 0; i < placed_.size(); ++i) {
    while (reductions_[i].stage() != Reduction::kDone && !collect_pairs(i, meter)) reductions_[i].end_stage();
    evaluated_end_.push_back(to_evaluate_.size());
  }
  return !to_evaluate_.empty();
}

// Collects the next pairs of a configuration's stage. Returns false if the stage is over.
bool ConfigurationBlock::collect_pairs(std::size_t i, WorkMeter& meter) {
  Reduction& r = reductions_[i];
  if (r.stage() == Reduction::kSeeds || r.stage() == Reduction::kCandidates)
    return r.collect_pairs(placed_[i], to_evaluate_);
  const std::uint64_t pairs = plan_.pairs.size();
  if (!open_.empty())
    r.scan(open_[i], placed_[i]);
  else if (compares_boxes_)
    r.scan(gaps_.subspan(i * pairs, pairs), placed_[i]);
  else
    for (std::uint64_t unit = 0; unit < r.units(); ++unit) r.run(unit, 0, placed_[i], meter);
  return false;
}

void ConfigurationBlock::take() {
  std::size_t begin = 0;
  for (std::size_t i = 0; i < placed_.size(); ++i) {
    if (evaluated_end_[i] > begin) reductions_[i].take(std::span(answers_).subspan(begin, evaluated_end_[i] - begin));
    begin = evaluated_end_[i];
  }
}

std::uint64_t ConfigurationBlock::end(std::span<std::vector<Row>> rows) {
  assert(rows.size() == placed_.size());
  std::uint64_t evaluated = 0;
  for (std::size_t i = 0; i < placed_.size(); ++i) {
    reductions_[i].take_rows(static_cast<std::uint32_t>(configurations_[i]), placed_[i], rows[i]);
    evaluated += reductions_[i].evaluated();
  }
  placed_ = {};
  return evaluated;
}

}  // namespace clearance
