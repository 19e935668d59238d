#include "engine/evaluate/still_pairs.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace clearance {

namespace {

/// Pairs evaluated for distances: those with the nearest boxes. Boxes bound the others.
constexpr std::size_t kMostNear = 32;

}  // namespace

std::unique_ptr<StillPairs> StillPairs::find(const engine::Scene& scene, const Plan& plan,
                                             const EvaluateOptions& options, std::span<const Aabb> boxes) {
  if (plan.query.all_pairs) return nullptr;  // those have a moved body
  std::vector<std::uint8_t> stays(scene.bodies().size(), 1);
  for (const std::uint32_t b : plan.moved) stays[b] = 0;
  std::vector<std::uint64_t> positions;
  for (std::uint64_t p = 0; p < plan.pairs.size(); ++p) {
    const BodyPair pair = plan.pairs.at(p);
    if (pair.a < stays.size() && pair.b < stays.size() && stays[pair.a] && stays[pair.b]) positions.push_back(p);
  }
  if (positions.empty()) return nullptr;
  return std::unique_ptr<StillPairs>(new StillPairs(scene, plan, options, boxes, positions));
}

StillPairs::StillPairs(const engine::Scene& scene, const Plan& plan, const EvaluateOptions& options,
                       std::span<const Aabb> boxes, std::span<const std::uint64_t> positions)
    : decides_(plan.query.reduce == Reduce::kAny),
      finds_least_(plan.query.reduce == Reduce::kMin),
      placement_(scene, plan, boxes),
      evaluator_(scene, options) {
  find_near(scene, plan, positions);
  for (const std::uint64_t p : near_) {
    const double margin = plan.margins.of(p), most = plan.query.max_distance;
    if (decides_)
      to_evaluate_.push_back({plan.pairs.at(p), &placement_, margin, margin});
    else
      to_evaluate_.push_back({plan.pairs.at(p), &placement_, most, -std::numeric_limits<double>::infinity(), most});
  }
  answers_.resize(near_.size());
  evaluator_.begin(to_evaluate_, answers_);
}

void StillPairs::find_near(const engine::Scene& scene, const Plan& plan, std::span<const std::uint64_t> positions) {
  for (const std::uint64_t p : positions) {
    const BodyPair pair = plan.pairs.at(p);
    if (is_unusable(scene, placement_, pair)) continue;
    const double gap = box_gap(scene, placement_, pair);
    if (!decides_)
      bounds_.push_back({p, gap, std::numeric_limits<double>::infinity()});
    else if (gap > plan.margins.of(p))
      known_.push_back(p);
    else
      near_.push_back(p);
  }
  if (decides_) return;
  std::stable_sort(bounds_.begin(), bounds_.end(),
                   [](const StillBounds& a, const StillBounds& b) { return a.lower < b.lower; });
  for (std::size_t i = 0; i < std::min(kMostNear, bounds_.size()); ++i) near_.push_back(bounds_[i].position);
}

bool StillPairs::advance(WorkMeter& meter) {
  if (!evaluator_.advance(meter)) return false;
  for (std::size_t i = 0; i < near_.size(); ++i) {
    if (decides_ && answers_[i].status == Status::kBeyond) known_.push_back(near_[i]);
    if (decides_) continue;
    bounds_[i].lower = answers_[i].lower;
    const bool overlaps = answers_[i].status == Status::kOverlap;
    bounds_[i].upper = overlaps ? 0 : std::max(answers_[i].upper, std::numeric_limits<double>::min());
  }
  if (!finds_least_) std::erase_if(bounds_, [](const StillBounds& b) { return std::isinf(b.upper); });
  const auto before = [](const StillBounds& a, const StillBounds& b) { return a.position < b.position; };
  std::sort(bounds_.begin(), bounds_.end(), before);
  for (const StillBounds& b : bounds_) known_.push_back(b.position);
  std::sort(known_.begin(), known_.end());
  is_done_ = true;
  return true;
}

}  // namespace clearance
