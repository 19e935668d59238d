#include "engine/device/query/moved_chains.h"

#include <algorithm>

namespace clearance::cuda {

MovedChains::MovedChains(const engine::Scene& scene, const Plan& plan)
    : moved_(plan.moved), links_(plan), given_count_(static_cast<std::uint32_t>(plan.given_bodies)) {
  const PoseSnapshot& snapshot = *plan.snapshot;
  std::vector<std::uint32_t> slot_of(scene.bodies().size(), kNone);
  for (std::uint32_t i = 0; i < moved_.size(); ++i) slot_of[moved_[i]] = i;
  source_.assign(moved_.size(), kNone);
  for (std::uint32_t m = 0; m < plan.bodies.size(); ++m)
    source_[slot_of[plan.bodies[m]]] = m < given_count_ ? m : given_count_ + links_.frames()[m - given_count_];
  chain_begin_.assign(1, 0);
  base_.resize(moved_.size());
  for (std::uint32_t i = 0; i < moved_.size(); ++i) {
    const std::uint32_t body = moved_[i];
    own_.push_back(snapshot.local[body]);
    slot_state_.push_back(state_of(scene, plan, i));
    const std::size_t first = chain_.size();
    std::uint32_t b = body;
    for (; b != kNone && slot_of[b] != kNone; b = snapshot.parent[b]) chain_.push_back(slot_of[b]);
    std::reverse(chain_.begin() + static_cast<std::ptrdiff_t>(first), chain_.end());
    chain_begin_.push_back(static_cast<std::uint32_t>(chain_.size()));
    has_base_.push_back(b != kNone);
    if (b != kNone) base_[i] = snapshot.placed[b];
  }
}

// The state that BodyPoses::configure() derives for a body in addition to its pose.
std::uint8_t MovedChains::state_of(const engine::Scene& scene, const Plan& plan, std::uint32_t slot) const {
  const PoseSnapshot& snapshot = *plan.snapshot;
  const std::uint32_t body = moved_[slot];
  const bool by_query = source_[slot] != kNone;
  std::uint8_t state = 0;
  if ((!by_query && !snapshot.given[body]) || scene.bodies()[body].cloud == CloudState::kAwaited)
    state |= kSlotUnplaced;
  if (snapshot.placed[body].status == Status::kStalePose) state |= kSlotStale;
  if (!by_query && snapshot.beyond_limits[body]) state |= kSlotBeyondLimits;
  return state;
}

MovedSetup MovedChains::setup() const {
  return {given_count_, moved_, source_, chain_begin_, chain_, own_, base_, has_base_, slot_state_, links_.setup()};
}

}  // namespace clearance::cuda
