#include "engine/evaluate/still_pairs.h"

#include <algorithm>

namespace clearance {

std::unique_ptr<StillPairs> StillPairs::find(const engine::Scene& scene, const Plan& plan,
                                             const EvaluateOptions& options, std::span<const Aabb> boxes) {
  if (plan.query.reduce != Reduce::kAny || plan.query.all_pairs) return nullptr;  // those have a moved body
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
    : placement_(scene, plan, boxes), evaluator_(scene, options) {
  for (const std::uint64_t p : positions) {
    const BodyPair pair = plan.pairs.at(p);
    const double margin = plan.margins.of(p);
    if (is_unusable(scene, placement_, pair)) continue;
    if (box_gap(scene, placement_, pair) > margin) {
      beyond_.push_back(p);
    } else {
      near_.push_back(p);
      to_evaluate_.push_back({pair, &placement_, margin, margin});
    }
  }
  answers_.resize(near_.size());
  evaluator_.begin(to_evaluate_, answers_);
}

bool StillPairs::advance(WorkMeter& meter) {
  if (!evaluator_.advance(meter)) return false;
  for (std::size_t i = 0; i < near_.size(); ++i)
    if (answers_[i].status == Status::kBeyond) beyond_.push_back(near_[i]);
  std::sort(beyond_.begin(), beyond_.end());
  is_done_ = true;
  return true;
}

}  // namespace clearance
