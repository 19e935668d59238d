// Bounds on the distances that a query requests, by covers.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "engine/decision/cover_plan.h"
#include "engine/decision/kernel/distance_view.h"
#include "engine/evaluate/still_pairs.h"
#include "engine/narrow/group.h"
#include "engine/query/distance/pair_groups.h"
#include "engine/selection/plan.h"

namespace clearance {

/// Chooses how far covers bound the groups of a plan, and whether their bounds suffice for rows
/// (docs/trust/bounds_covers.md, "Distances"). At narrow tolerances they only leave pairs out.
class CoverBounds {
 public:
  /// Memory of one worker.
  struct Room {
    std::vector<DistanceBounds> bounds;
    std::vector<LeftPair> left;
    std::vector<float> lows, highs;
    std::vector<DistanceItem> items;
  };
  struct Tolerance {
    double abs, rel;
  };
  /// Shares of a wide tolerance that covers and the exact engine may use for a group, whose bounds may come from both.
  struct Shares {
    double covers, exact;
  };

  /// Whether covers are of use for a plan.
  /// \param light whether the exact engine answers a pair in less than 1 us
  static bool may_bound(const Plan& plan, bool light);
  /// Whether covers answer groups of pairs themselves. Otherwise they only leave pairs out.
  static bool is_wide(const Plan& plan, bool light);

  /// \param plan must outlive this
  CoverBounds(const Plan& plan, const engine::Scene& scene, bool light);

  const PairGroups& groups() const { return groups_; }
  /// Whether the exact engine has a narrower tolerance than the query, so that its rows need to_tolerance().
  bool is_wide() const { return wide_; }
  /// Whether all requested columns follow from bounds that are wide enough.
  bool writes_rows() const { return writes_rows_; }
  /// Tolerance of the exact engine.
  Tolerance exact_tolerance() const;
  /// Takes the covers of the plan, which must outlive their use, and bounds of pairs that stay.
  void take(const CoverPlan& covers, std::span<const StillBounds> still);
  /// Returns (states, groups) bounds, valid until the next call.
  /// \param batch its limits, groups and inner radii are set here
  std::span<const DistanceBounds> bound(DistanceBatch batch, Room& room) const;
  /// Whether the row of a group needs only the pairs left. At a narrow tolerance, the bounds of a row beyond
  /// max_distance depend on all pairs.
  bool leaves_pairs_out(const DistanceBounds& bounds) const {
    return bounds.is_listed && (wide_ || bounds.upper <= plan_.query.max_distance);
  }
  /// Whether a group whose pairs covers know has no pair within max_distance, by bounds that are wide enough.
  bool is_beyond(const DistanceBounds& bounds) const {
    return writes_rows_ && bounds.left_begin == bounds.left_end && bounds.upper > 0 &&
           bounds.lower > plan_.query.max_distance;
  }
  /// Writes a group's answer, without flags. Returns false if its bounds, which are listed, do not suffice.
  bool answers(const DistanceBounds& bounds, PairAnswer& answer) const;
  /// Converts an answer of the exact engine, whose interval may reach down to the bounds laid aside, to one of the
  /// query's tolerance. Only slack may have widened it beyond that.
  void to_tolerance(PairAnswer& answer) const;

 private:
  bool is_narrow_enough(double lower, double upper) const {
    return upper < std::numeric_limits<double>::infinity() &&
           is_narrow(upper - lower, upper, plan_.query.abs_tol, plan_.query.rel_tol);
  }
  void set_limits();

  const Plan& plan_;
  PairGroups groups_;
  bool has_surfaces_;
  Shares shares_;
  bool wide_, writes_rows_;
  DistanceLimits limits_;
  std::vector<float> moved_inner_;
  std::vector<StillCell> still_;
  std::vector<TabledCell> tabled_;
};

}  // namespace clearance
