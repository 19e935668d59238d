// The groups of pairs whose least distances a query requests, as cells of the kernel of distances.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/decision/cover_plan.h"
#include "engine/decision/kernel/distance_view.h"
#include "engine/selection/plan.h"

namespace clearance {

/// Groups by row: all pairs of Reduce::kMin, those of each body of Reduce::kNearest, and otherwise each pair alone.
class PairGroups {
 public:
  /// Most packets of balls of groups: of single convex parts, which the exact engine answers in less than 1 us, and of
  /// others.
  struct Packets {
    int light, heavy;
  };

  PairGroups(const Plan& plan, const engine::Scene& scene, Packets packets);

  std::uint32_t count() const { return count_; }
  /// Whether there is one group of all pairs.
  bool is_one() const { return reduce_ == Reduce::kMin; }
  /// Takes the cells of covers, which must outlive their use, and of pairs that stay.
  void take(const CoverPlan& covers, std::span<const StillCell> still);
  const DistanceGroups& view() const { return view_; }  ///< empty for one group
  /// Whether a group has pairs that covers know.
  bool has_cells(std::uint32_t group) const { return is_one() || begin_[group] < begin_[group + 1]; }
  /// Position of a group's first pair, or kNoPair for a group without pairs.
  std::uint64_t first(std::uint32_t group) const { return first_[group]; }
  static constexpr std::uint64_t kNoPair = ~std::uint64_t{0};
  /// Positions of a group's pairs that covers do not know, ascending.
  std::span<const std::uint64_t> unknown(std::uint32_t group) const {
    return std::span(unknown_).subspan(unknown_begin_[group], unknown_begin_[group + 1] - unknown_begin_[group]);
  }

 private:
  template <class Visit>
  void for_groups(std::uint64_t position, const Visit& visit) const {
    if (reduce_ == Reduce::kMin) return visit(0u);
    if (reduce_ != Reduce::kNearest) return visit(static_cast<std::uint32_t>(position));
    const BodyPair pair = plan_.pairs.at(position);
    if (pair.a < count_) visit(pair.a);
    if (pair.b < count_) visit(pair.b);
  }

  const Plan& plan_;
  Reduce reduce_;
  std::uint32_t count_;
  std::vector<int> packets_;
  std::vector<std::uint64_t> first_;
  std::vector<std::uint32_t> begin_, cells_, unknown_begin_;
  std::vector<std::uint64_t> unknown_;
  DistanceGroups view_{};
};

}  // namespace clearance
