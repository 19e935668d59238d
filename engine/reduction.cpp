#include "reduction.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "broad_phase.h"

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr std::uint64_t kBlock = 4096;    // pairs whose boxes one unit compares
constexpr std::uint64_t kEvaluate = 64;   // pairs that one unit answers

std::uint64_t blocks(std::uint64_t count, std::uint64_t size) { return (count + size - 1) / size; }

}  // namespace

Reduction::Reduction(const Scene& scene, const Plan& plan, const EvaluateOptions& options, int workers)
    : scene_(scene), plan_(plan), options_(options),
      groups_(plan.query.reduce == Reduce::kNearest ? scene.bodies().size() : 1),
      by_broad_phase_(within() && plan.pairs.is_whole_table() && !options.reference &&
                      std::isfinite(plan.query.max_distance)),
      workers_(static_cast<std::size_t>(workers), WorkerState(scene, options)) {}

template <class Visit>
void Reduction::for_groups(BodyPair pair, Visit visit) const {
  if (!per_body()) return visit(0u);
  if (pair.a < groups_) visit(pair.a);
  if (pair.b < groups_) visit(pair.b);
}

void Reduction::begin() {
  for (WorkerState& w : workers_) {
    w.seed.assign(groups_, Seed{kInf, ~std::uint64_t{0}});
    w.incomplete.assign(groups_, 0);
    w.candidates.clear();
  }
  incomplete_.assign(groups_, 0);
  // Within a distance every pair stands alone: its cut-off is known. So it is for the oracle, which leaves nothing out.
  const bool no_seeds = within() || options_.reference;
  cutoff_.assign(groups_, options_.reference ? kInf : plan_.query.max_distance);
  seeds_.clear();
  seed_answers_.clear();
  candidates_.clear();
  stage_ = no_seeds ? kScan : kSeedScan;
}

std::uint64_t Reduction::units() const {
  switch (stage_) {
    case kScan:
      if (by_broad_phase_) return 1;
      [[fallthrough]];
    case kSeedScan: return blocks(plan_.pairs.size(), kBlock);
    case kSeeds: return blocks(seeds_.size(), kEvaluate);
    case kCandidates: return blocks(candidates_.size(), kEvaluate);
    case kDone: break;
  }
  return 0;
}

void Reduction::run(std::uint64_t unit, int worker, const Placement& placement) {
  switch (stage_) {
    case kSeedScan: return seed_scan(unit, workers_[worker], placement);
    case kScan:
      if (by_broad_phase_) return scan_by_broad_phase(workers_[worker], placement);
      return scan(unit, workers_[worker], placement);
    case kSeeds:
    case kCandidates: {
      const auto& positions = stage_ == kSeeds ? seeds_ : candidates_;
      auto& answers = stage_ == kSeeds ? seed_answers_ : candidate_answers_;
      const std::uint64_t begin = unit * kEvaluate, end = std::min<std::uint64_t>(positions.size(), begin + kEvaluate);
      WorkerState& w = workers_[worker];
      w.asked.clear();
      for (std::uint64_t i = begin; i < end; ++i) w.asked.push_back({plan_.pairs.at(positions[i]), &placement});
      w.evaluator.run(w.asked, std::span(answers).subspan(begin, end - begin));
      return;
    }
    case kDone: return;
  }
}

void Reduction::seed_scan(std::uint64_t block, WorkerState& worker, const Placement& placement) {
  const std::uint64_t begin = block * kBlock, count = std::min(kBlock, plan_.pairs.size() - begin);
  std::uint64_t position = begin;
  for (const BodyPair pair : plan_.pairs.slice(begin, count, worker.room)) {
    const Seed seed{box_gap(scene_, placement, pair), position++};
    for_groups(pair, [&](std::uint32_t g) { worker.seed[g] = std::min(worker.seed[g], seed); });
  }
}

void Reduction::scan(std::uint64_t block, WorkerState& worker, const Placement& placement) {
  const std::uint64_t begin = block * kBlock, count = std::min(kBlock, plan_.pairs.size() - begin);
  std::uint64_t position = begin;
  for (const BodyPair pair : plan_.pairs.slice(begin, count, worker.room)) {
    const double gap = box_gap(scene_, placement, pair);
    bool wanted = false;
    if (gap == kInf && is_unusable(scene_, placement, pair)) {
      wanted = within() || options_.reference;
      for_groups(pair, [&](std::uint32_t g) { worker.incomplete[g] = 1; });
    } else {
      for_groups(pair, [&](std::uint32_t g) { wanted |= gap <= cutoff_[g]; });
    }
    if (wanted) worker.candidates.push_back(position);
    ++position;
  }
}

void Reduction::scan_by_broad_phase(WorkerState& worker, const Placement& placement) {
  const PairTable& table = *plan_.pairs.table();
  const auto n = static_cast<std::uint32_t>(scene_.bodies().size());
  std::vector<Aabb> boxes;
  for (std::uint32_t b = 0; b < n; ++b) boxes.push_back(placement.box(b));
  broad_phase_for(n).candidates(boxes, plan_.query.max_distance, worker.room);
  for (const BodyPair pair : worker.room)
    if (table.enabled(pair.a, pair.b)) worker.candidates.push_back(table.position(pair));
  worker.room.clear();
  // Bodies that cannot be placed have no box: nothing is proved about their pairs, so all of them are answered.
  for (std::uint32_t bad = 0; bad < n; ++bad) {
    if (placement[bad].status == Status::kOk) continue;
    for (std::uint32_t b = 0; b < n; ++b)
      if (table.enabled(bad, b) && (b > bad || placement[b].status == Status::kOk))
        worker.candidates.push_back(table.position({std::min(bad, b), std::max(bad, b)}));
  }
}

void Reduction::end_stage() {
  switch (stage_) {
    case kSeedScan: {
      for (std::size_t g = 0; g < groups_; ++g) {
        Seed least = workers_[0].seed[g];
        for (const WorkerState& w : workers_) least = std::min(least, w.seed[g]);
        if (least.position != ~std::uint64_t{0}) seeds_.push_back(least.position);
      }
      std::sort(seeds_.begin(), seeds_.end());
      seeds_.erase(std::unique(seeds_.begin(), seeds_.end()), seeds_.end());
      seed_answers_.resize(seeds_.size());
      stage_ = kSeeds;
      break;
    }
    case kSeeds:
      cutoff_.assign(groups_, kInf);
      for (std::size_t i = 0; i < seeds_.size(); ++i)
        for_groups(plan_.pairs.at(seeds_[i]), [&](std::uint32_t g) {
          // A seed whose boxes alone are beyond max_distance: none with boxes farther apart lowers the interval or wins.
          // Boxes that touch do not say how deep an overlap is: its depth cuts nothing off.
          const PairAnswer& seed = seed_answers_[i];
          const bool beyond_by_boxes = seed.status == Status::kBeyond && seed.upper == kInf;
          cutoff_[g] = std::min(cutoff_[g], beyond_by_boxes ? seed.lower : std::max(seed.upper, 0.0));
        });
      stage_ = kScan;
      break;
    case kScan:
      for (const WorkerState& w : workers_) {
        candidates_.insert(candidates_.end(), w.candidates.begin(), w.candidates.end());
        for (std::size_t g = 0; g < groups_; ++g) incomplete_[g] |= w.incomplete[g];
      }
      std::sort(candidates_.begin(), candidates_.end());
      candidates_.erase(std::remove_if(candidates_.begin(), candidates_.end(),
                                       [&](std::uint64_t p) { return std::binary_search(seeds_.begin(), seeds_.end(), p); }),
                        candidates_.end());
      candidate_answers_.resize(candidates_.size());
      stage_ = kCandidates;
      break;
    case kCandidates:
    case kDone: stage_ = kDone; break;
  }
}

std::vector<Row> Reduction::rows(std::uint32_t configuration, const Placement& placement) {
  const auto row_of = [&](BodyPair pair, const PairAnswer& answer) {
    Row row{pair, configuration, answer, {}, {}};
    if (pair.a < scene_.bodies().size()) row.origin_a = placement[pair.a].pose.t_w;
    if (pair.b < scene_.bodies().size()) row.origin_b = placement[pair.b].pose.t_w;
    return row;
  };
  std::vector<Row> rows;
  if (within()) {
    for (std::size_t i = 0; i < candidates_.size(); ++i)
      if (candidate_answers_[i].status != Status::kBeyond) rows.push_back(row_of(plan_.pairs.at(candidates_[i]), candidate_answers_[i]));
    return rows;
  }
  struct Best {
    std::uint64_t position = ~std::uint64_t{0};
    const PairAnswer* winner = nullptr;
    double lower = kInf;
  };
  std::vector<Best> best(groups_);
  const auto offer = [&](std::uint64_t position, const PairAnswer& answer) {
    const bool usable = !std::isnan(answer.distance);
    const BodyPair pair = plan_.pairs.at(position);
    const double lower = usable && !options_.reference ? lower_with_box(answer.lower, box_gap(scene_, placement, pair)) : answer.lower;
    for_groups(pair, [&](std::uint32_t g) {
      Best& b = best[g];
      if (!usable) incomplete_[g] = 1;
      if (usable) b.lower = std::min(b.lower, lower);
      const bool had_usable = b.winner && !std::isnan(b.winner->distance);
      const bool better = !b.winner || (usable && !had_usable) ||
                          (usable == had_usable && std::tuple(answer.upper, nearest_beyond(answer), position) <
                                                       std::tuple(b.winner->upper, nearest_beyond(*b.winner), b.position));
      if (better) b = {position, &answer, b.lower};
    });
  };
  for (std::size_t i = 0; i < seeds_.size(); ++i) offer(seeds_[i], seed_answers_[i]);
  for (std::size_t i = 0; i < candidates_.size(); ++i) offer(candidates_[i], candidate_answers_[i]);
  for (std::size_t g = 0; g < groups_; ++g) {
    const Best& b = best[g];
    if (!b.winner) {
      const auto body = static_cast<std::uint32_t>(g);
      rows.push_back(row_of({per_body() ? body : kNone, kNone}, empty_answer()));
      continue;
    }
    Row row = row_of(plan_.pairs.at(b.position), *b.winner);
    widen_to_group(row.answer, b.lower, options_.limits.abs_tol, options_.limits.rel_tol);
    if (incomplete_[g]) row.answer.flags |= kFlagIncomplete;
    rows.push_back(row);
  }
  return rows;
}

}  // namespace clearance
