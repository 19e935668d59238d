#include "engine/cover/choose_balls.h"

#include <algorithm>
#include <limits>

namespace clearance {

namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

/// Number of samples left that need at most `limit`. Without branches: the compiler vectorizes it.
std::int32_t count_held(const float* needs, const std::int32_t* left, std::size_t samples, float limit) {
  std::int32_t count = 0;
  for (std::size_t k = 0; k < samples; ++k) count += static_cast<std::int32_t>(needs[k] <= limit) & left[k];
  return count;
}

}  // namespace

std::vector<ChosenBall> BallChooser::choose() {
  const bool is_first = chosen_.empty();
  if (is_first) chosen_ = {single_best()};
  most_held_.assign(candidates_.count(), static_cast<std::int32_t>(candidates_.samples()));
  float low = least_need(), high = owners(chosen_).greatest;
  for (int step = is_first ? 6 : 3; step > 0 && low < high; --step) {
    const float middle = 0.5f * (low + high);
    (cover_greedily(middle) ? high : low) = middle;
  }
  for (int step = 0; step < 4; ++step)
    if (!improve()) break;
  const double stand_out = owners(chosen_).greatest;
  std::vector<ChosenBall> balls;
  for (const std::size_t i : chosen_) balls.push_back({candidates_.centre(i), candidates_.inside(i) + stand_out});
  return balls;
}

float BallChooser::least_need() const {
  std::vector<float> least(candidates_.samples(), kInfinity);
  for (std::size_t i = 0; i < candidates_.count(); ++i) {
    const float* needs = candidates_.needs(i);
    for (std::size_t k = 0; k < least.size(); ++k) least[k] = needs[k] < least[k] ? needs[k] : least[k];
  }
  return *std::max_element(least.begin(), least.end());
}

std::size_t BallChooser::single_best() const {
  std::size_t best = 0;
  float least = kInfinity;
  for (std::size_t i = 0; i < candidates_.count(); i += 1 + candidates_.count() / 64)
    if (const float greatest = owners({{i}}).greatest; greatest < least) least = greatest, best = i;
  return best;
}

bool BallChooser::cover_greedily(float limit) {
  const std::size_t samples = candidates_.samples();
  std::vector<std::int32_t> left(samples, 1), first = most_held_;
  // Gains only fall: one that is up to date and greater than the outdated others is the greatest.
  std::vector<std::pair<std::int32_t, std::size_t>> heap;
  for (std::size_t i = 0; i < candidates_.count(); ++i) heap.emplace_back(most_held_[i], i);
  std::make_heap(heap.begin(), heap.end());
  std::vector<std::size_t> selected;
  for (std::size_t held = 0; held < samples;) {
    if (selected.size() == most_ || heap.empty()) return false;
    for (;;) {
      std::pop_heap(heap.begin(), heap.end());
      auto& [gain, i] = heap.back();
      gain = count_held(candidates_.needs(i), left.data(), samples, limit);
      if (selected.empty()) first[i] = gain;
      if (heap.back() >= heap.front()) break;
      std::push_heap(heap.begin(), heap.end());
    }
    const auto [gain, best] = heap.back();
    heap.pop_back();
    if (static_cast<std::size_t>(gain) * (most_ - selected.size()) < samples - held) return false;
    held += static_cast<std::size_t>(gain);
    selected.push_back(best);
    const float* needs = candidates_.needs(best);
    for (std::size_t k = 0; k < samples; ++k) left[k] &= static_cast<std::int32_t>(needs[k] > limit);
  }
  most_held_ = std::move(first);
  chosen_ = std::move(selected);
  return true;
}

BallChooser::Owners BallChooser::owners(std::span<const std::size_t> selected) const {
  Owners result{std::vector<std::size_t>(candidates_.samples(), 0), -kInfinity, 0};
  for (std::size_t k = 0; k < result.of.size(); ++k) {
    float least = kInfinity;
    for (std::size_t c = 0; c < selected.size(); ++c)
      if (const float need = candidates_.needs(selected[c])[k]; need < least) least = need, result.of[k] = c;
    if (least > result.greatest) result.greatest = least, result.worst = k;
  }
  return result;
}

void BallChooser::spend(std::vector<std::size_t>& selected) const {
  while (selected.size() < most_) {
    const Owners owned = owners(selected);
    float least = owned.greatest;
    std::size_t best = candidates_.count();
    for (std::size_t i = 0; i < candidates_.count(); ++i)
      if (const float need = candidates_.needs(i)[owned.worst]; need < least) least = need, best = i;
    if (best == candidates_.count()) return;
    selected.push_back(best);
  }
}

bool BallChooser::improve() {
  std::vector<std::size_t> selected = chosen_;
  spend(selected);
  const Owners owned = owners(selected);
  std::vector<std::vector<std::size_t>> held(selected.size());
  for (std::size_t k = 0; k < owned.of.size(); ++k) held[owned.of[k]].push_back(k);
  std::vector<float> least(selected.size(), kInfinity);
  for (std::size_t i = 0; i < candidates_.count(); ++i) {
    const float* needs = candidates_.needs(i);
    for (std::size_t c = 0; c < held.size(); ++c) {
      float greatest = -kInfinity;
      for (const std::size_t k : held[c])
        if ((greatest = std::max(greatest, needs[k])) >= least[c]) break;
      if (greatest < least[c]) least[c] = greatest, selected[c] = i;
    }
  }
  if (!(owners(selected).greatest < owners(chosen_).greatest)) return false;
  chosen_ = std::move(selected);
  return true;
}

}  // namespace clearance
