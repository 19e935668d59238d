#include "engine/reduce/reduction.h"

#include <algorithm>
#include <atomic>
#include <cassert>
#include <cmath>

#include "engine/narrow/group.h"

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
// Pairs of the first step, if an overlap ends the search; each step has twice as many as the one before.
constexpr std::uint64_t kAtFirst = 8, kAtFirstOfMany = 2;  // the latter for each of many configurations

// Tolerances below which the bits of a row depend on its state alone (docs/trust/bounds_bodies.md, "Nearer pairs").
constexpr double kNarrowAbsTol = 1e-4, kNarrowRelTol = 1e-3;

// Work that takes one thread a tenth of a millisecond or more.
constexpr std::uint64_t kManyProbes = 512, kManyPairs = 65536, kManyAnswers = 1024;

std::uint64_t blocks(std::uint64_t count, std::uint64_t size) {
  return (count + size - 1) / size;
}

}  // namespace

Reduction::Reduction(const engine::Scene& scene, const Plan& plan, const EvaluateOptions& options, const Boxes& boxes,
                     int workers)
    : scene_(scene),
      plan_(plan),
      options_(options),
      groups_(plan.query.reduce == Reduce::kNearest ? scene.bodies().size() : 1),
      near_pairs_(boxes.near_pairs),
      have_boxes_(!boxes.all.empty()),
      by_tree_(boxes.near_pairs.by_tree()),
      most_seeds_(scene.has_surfaces() ? 1 : kMostSeeds) {
  for (int i = 0; i < workers; ++i) workers_.emplace_back(scene, plan, options, boxes);
}

void Reduction::begin() {
  for (WorkerState& w : workers_) {
    w.seed.assign(groups_, Seed{kInf, ~std::uint64_t{0}});
    w.unusable.assign(groups_, kNoPair);
    w.candidates.clear();
    w.evaluated = 0;
  }
  unusable_.assign(groups_, kNoPair);
  // The reference leaves nothing out.
  cutoff_.assign(groups_, options_.reference ? kInf : any() ? plan_.margins.most() : plan_.query.max_distance);
  gaps_ = {};
  candidate_gaps_.clear();
  seeds_.clear();
  seed_answers_.clear();
  candidates_.clear();
  candidate_pairs_.clear();
  decided_by_ = kNoPair;
  stage_ = needs_no_seed() ? kScan : kSeedScan;
}

std::uint64_t Reduction::evaluated() const {
  std::uint64_t sum = 0;
  for (const WorkerState& w : workers_) sum += w.evaluated;
  return sum;
}

std::uint64_t Reduction::units() const {
  switch (stage_) {
    case kScan:
      if (by_tree_ && near_pairs_.whole_table() && !per_body()) return blocks(near_pairs_.tree().blocks(), kTreeBlocks);
      [[fallthrough]];
    case kSeedScan:
      return by_tree_ ? blocks(near_pairs_.probes().size(), kProbes) : blocks(plan_.pairs.size(), kBlock);
    case kSeeds:
      return blocks(seeds_.size(), kEvaluate);
    case kCandidates:
      return blocks(candidates_.size(), kEvaluate);
    case kDone:
      break;
  }
  return 0;
}

bool Reduction::worth_threads(bool light) const {
  const std::uint64_t many_answers = light ? kManyAnswers : kManyAnswers / 16;
  switch (stage_) {
    case kSeedScan:
    case kScan:
      return by_tree_ ? near_pairs_.probes().size() >= kManyProbes : plan_.pairs.size() >= kManyPairs;
    case kSeeds:
      return seeds_.size() >= many_answers;
    case kCandidates:
      return candidates_.size() >= many_answers;
    case kDone:
      break;
  }
  return false;
}

bool Reduction::run(std::uint64_t unit, int worker, const BodyPoses& placement, WorkMeter& meter) {
  assert(unit < units() && static_cast<std::size_t>(worker) < workers_.size());
  WorkerState& w = workers_[static_cast<std::size_t>(worker)];
  switch (stage_) {
    case kSeedScan:
      meter.count(kUnitsPerScan);
      by_tree_ ? seed_scan_by_tree(unit, w, placement) : scan_block(unit, w, placement);
      return true;
    case kScan:
      meter.count(kUnitsPerScan);
      by_tree_ ? scan_by_tree(unit, w, placement) : scan_block(unit, w, placement);
      return true;
    case kSeeds:
    case kCandidates:
      return answer(unit, w, placement, meter);
    case kDone:
      break;
  }
  return true;
}

// Evaluates a unit's pairs.
bool Reduction::answer(std::uint64_t unit, WorkerState& w, const BodyPoses& placement, WorkMeter& meter) {
  const auto begin_next = [&] {
    w.to_evaluate.clear();
    collect_pairs(w, placement, w.to_evaluate);
    w.evaluator.begin(w.to_evaluate, std::span(answers()).subspan(w.first, w.to_evaluate.size()));
  };
  const std::atomic_ref<std::uint64_t> decided_by(decided_by_);
  if (w.step == 0) {
    if (decided_by.load(std::memory_order_relaxed) < unit) return true;
    begin_answers(unit * kEvaluate, (unit + 1) * kEvaluate, kAtFirst, w);
    begin_next();
  }
  while (true) {
    if (!w.evaluator.advance(meter)) return false;
    if (take(w) && any())  // later units of a minimum may hold rivals of the seeds, so each stops by itself
      for (std::uint64_t first = decided_by.load(std::memory_order_relaxed);
           unit < first && !decided_by.compare_exchange_weak(first, unit, std::memory_order_relaxed);) {
      }
    if (w.first == w.end) break;
    begin_next();
    if (meter.is_over()) return false;
  }
  w.step = 0;
  return true;
}

void Reduction::begin_answers(std::uint64_t begin, std::uint64_t end, std::uint64_t at_first, WorkerState& w) const {
  w.first = begin;
  w.end = std::min<std::uint64_t>(end, stage_ == kSeeds ? seeds_.size() : candidates_.size());
  w.step = stops_early() ? at_first : kEvaluate;
  w.cut_off = stage_ == kCandidates && stops_at_overlap() ? cutoff_[0] : kInf;
}

// Appends the pairs of the next step.
void Reduction::collect_pairs(WorkerState& w, const BodyPoses& placement, std::vector<PlacedBodies>& to_evaluate) {
  const auto& positions = stage_ == kSeeds ? seeds_ : candidates_;
  auto& pairs = stage_ == kSeeds ? seed_pairs_ : candidate_pairs_;
  // A far pair of meshes evaluated to a wide tolerance may lower the interval, which then depends on the order of pairs.
  const bool is_narrow = options_.limits.abs_tol < kNarrowAbsTol && options_.limits.rel_tol < kNarrowRelTol;
  const double far = scene_.has_surfaces() && !is_narrow ? w.cut_off : loser_beyond(w.cut_off, options_.limits);
  if (!candidate_gaps_.empty()) leave_out_far(w);
  for (std::uint64_t i = w.first; i < std::min(w.end, w.first + w.step); ++i) {
    pairs[i] = plan_.pairs.at(positions[i]);
    const double alone = cut_off(positions[i]), cut = std::min(alone, far);
    to_evaluate.push_back({pairs[i], &placement, cut, any() ? cut : -kInf, alone});
  }
}

// Sorts the nearest candidates first, so that others are left out sooner. Overlapping pairs keep their order, and pairs
// after the first of them have separate boxes or come later in the query.
void Reduction::sort_candidates(const BodyPoses& placement) {
  std::vector<Seed>& order = workers_[0].order;
  order.clear();
  for (const std::uint64_t p : candidates_)
    order.push_back({gaps_.empty() ? box_gap(scene_, placement, plan_.pairs.at(p)) : gaps_[p], p});
  std::sort(order.begin(), order.end());
  for (std::size_t i = 0; i < order.size(); ++i) candidates_[i] = order[i].position;
  candidate_gaps_.clear();
  for (const Seed& s : order) candidate_gaps_.push_back(s.gap);
}

// Candidates whose boxes are farther apart can neither win nor lower the interval. They come last.
void Reduction::leave_out_far(WorkerState& w) {
  assert(stage_ == kCandidates && w.end == candidates_.size());
  while (w.end > w.first && candidate_gaps_[w.end - 1] > w.cut_off) --w.end;
  candidates_.resize(w.end);
  candidate_pairs_.resize(w.end);
  candidate_answers_.resize(w.end);
}

// Takes the answers of the last step. Returns true if one of them decides.
bool Reduction::take(WorkerState& w) {
  const std::uint64_t next = std::min(w.end, w.first + w.step);
  w.evaluated += next - w.first;
  const auto& positions = stage_ == kSeeds ? seeds_ : candidates_;
  bool decided = false;
  for (; w.first < next; ++w.first) {
    const PairAnswer& answer = answers()[w.first];
    decided |= stops_early() && decides(positions[w.first], answer);
    if (stops_at_overlap()) w.cut_off = std::min(w.cut_off, answer.upper);
  }
  for (; decided && w.first < w.end; ++w.first) {
    (stage_ == kSeeds ? seed_pairs_ : candidate_pairs_)[w.first] = plan_.pairs.at(positions[w.first]);
    answers()[w.first] = beyond_answer(0);  // no nearer than the one found, and behind it
  }
  w.step *= 2;
  return decided;
}

bool Reduction::collect_pairs(const BodyPoses& placement, std::vector<PlacedBodies>& to_evaluate) {
  assert(stage_ == kSeeds || stage_ == kCandidates);
  WorkerState& w = workers_[0];
  if (w.step == 0) {
    if (stage_ == kCandidates && stops_at_overlap()) sort_candidates(placement);
    begin_answers(0, ~std::uint64_t{0}, kAtFirstOfMany, w);
  }
  const std::size_t before = to_evaluate.size();
  collect_pairs(w, placement, to_evaluate);
  if (to_evaluate.size() > before) return true;
  w.step = 0;
  return false;
}

void Reduction::take(std::span<const PairAnswer> found) {
  WorkerState& w = workers_[0];
  std::copy(found.begin(), found.end(), answers().begin() + static_cast<std::ptrdiff_t>(w.first));
  take(w);
}

void Reduction::collect_seeds() {
  for (std::size_t g = 0; g < groups_; ++g) {
    Seed least = workers_[0].seed[g];
    for (const WorkerState& w : workers_) least = std::min(least, w.seed[g]);
    if (least.position != ~std::uint64_t{0}) seeds_.push_back(least.position);
  }
  std::sort(seeds_.begin(), seeds_.end());
  seeds_.erase(std::unique(seeds_.begin(), seeds_.end()), seeds_.end());
  assert(seeds_.empty() || seeds_.back() < plan_.pairs.size());
  seed_pairs_.resize(seeds_.size());
  seed_answers_.resize(seeds_.size());
}

void Reduction::find_cutoffs() {
  cutoff_.assign(groups_, kInf);
  for (std::size_t i = 0; i < seeds_.size(); ++i)
    for_groups(seed_pairs_[i], [&](std::uint32_t g) {
      // If a seed's boxes alone are beyond max_distance, no pair with boxes farther apart lowers the interval or
      // wins. Touching boxes do not bound the depth of an overlap, so its depth is no cut-off.
      const PairAnswer& seed = seed_answers_[i];
      const bool beyond_by_boxes = seed.status == Status::kBeyond && seed.upper == kInf;
      cutoff_[g] = std::min(cutoff_[g], beyond_by_boxes ? seed.lower : std::max(seed.upper, 0.0));
    });
}

void Reduction::collect_candidates() {
  for (const WorkerState& w : workers_) {
    candidates_.insert(candidates_.end(), w.candidates.begin(), w.candidates.end());
    for (std::size_t g = 0; g < groups_; ++g) unusable_[g] = std::min(unusable_[g], w.unusable[g]);
  }
  std::sort(candidates_.begin(), candidates_.end());
  candidates_.erase(std::unique(candidates_.begin(), candidates_.end()), candidates_.end());
  assert(candidates_.empty() || candidates_.back() < plan_.pairs.size());
  candidates_.erase(
      std::remove_if(candidates_.begin(), candidates_.end(),
                     [&](std::uint64_t p) { return std::binary_search(seeds_.begin(), seeds_.end(), p); }),
      candidates_.end());
  candidate_pairs_.resize(candidates_.size());
  candidate_answers_.resize(candidates_.size());
}

void Reduction::end_stage() {
  switch (stage_) {
    case kSeedScan:
      collect_seeds();
      stage_ = kSeeds;
      break;
    case kSeeds:
      find_cutoffs();
      stage_ = kScan;
      break;
    case kScan:
      collect_candidates();
      stage_ = kCandidates;
      break;
    case kCandidates:
    case kDone:
      stage_ = kDone;
      break;
  }
}

}  // namespace clearance
