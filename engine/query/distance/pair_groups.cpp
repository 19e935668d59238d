#include "engine/query/distance/pair_groups.h"

#include <algorithm>
#include <utility>

namespace clearance {

namespace {

/// Sorts entries of (group, value) into lists by group.
template <class T>
void make_lists(std::vector<std::pair<std::uint32_t, T>>& entries, std::uint32_t groups,
                std::vector<std::uint32_t>& begin, std::vector<T>& values) {
  std::sort(entries.begin(), entries.end());
  begin.assign(groups + 1, 0);
  values.clear();
  for (const auto& [group, value] : entries) {
    ++begin[group + 1];
    values.push_back(value);
  }
  for (std::uint32_t g = 0; g < groups; ++g) begin[g + 1] += begin[g];
}

}  // namespace

PairGroups::PairGroups(const Plan& plan, const engine::Scene& scene, Packets packets)
    : plan_(plan),
      reduce_(plan.query.reduce),
      count_(static_cast<std::uint32_t>(reduce_ == Reduce::kMin       ? 1
                                        : reduce_ == Reduce::kNearest ? scene.bodies().size()
                                                                      : plan.pairs.size())) {
  const auto is_light = [&](std::uint32_t b) {
    return b >= scene.bodies().size() || (scene.bodies()[b].parts.size() <= 1 && !has_surface(scene.bodies()[b]));
  };
  packets_.assign(count_, packets.light);
  first_.assign(count_, kNoPair);
  for (std::uint64_t p = 0; p < plan.pairs.size() && !is_one(); ++p)
    for_groups(p, [&](std::uint32_t g) { first_[g] = std::min(first_[g], p); });
  for (std::uint64_t p = 0; p < plan.pairs.size() && !is_one(); ++p)
    if (const BodyPair pair = plan.pairs.at(p); !is_light(pair.a) || !is_light(pair.b))
      for_groups(p, [&](std::uint32_t g) { packets_[g] = packets.heavy; });
}

void PairGroups::take(const CoverPlan& covers, std::span<const StillCell> still) {
  std::vector<std::pair<std::uint32_t, std::uint64_t>> unknown;
  for (const std::uint64_t p : covers.unknown()) for_groups(p, [&](std::uint32_t g) { unknown.emplace_back(g, p); });
  make_lists(unknown, count_, unknown_begin_, unknown_);
  if (is_one()) return;
  const DecisionView& view = covers.view();
  std::vector<std::pair<std::uint32_t, std::uint32_t>> cells;
  const auto add = [&](std::uint64_t position, std::uint32_t cell) {
    for_groups(position, [&](std::uint32_t g) { cells.emplace_back(g, cell); });
  };
  const std::uint32_t of_obstacles = view.obstacle_count * view.columns;
  for (std::uint32_t cell = 0; cell < of_obstacles; ++cell)
    if (view.grow[cell] != BallPacket::kNoRadius) add(view.position[cell], cell);
  for (std::uint32_t k = 0; k < view.moved_pair_count; ++k) add(view.moved_pairs[k].position, of_obstacles + k);
  const std::uint32_t first_still =
      of_obstacles + (view.moved_pair_count + BallPacket::kBalls - 1) / BallPacket::kBalls * BallPacket::kBalls;
  for (std::size_t k = 0; k < still.size(); ++k) add(still[k].position, first_still + static_cast<std::uint32_t>(k));
  make_lists(cells, count_, begin_, cells_);
  view_ = {begin_.data(), cells_.data(), packets_.data(), count_};
}

}  // namespace clearance
