// The joint tables of a query.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "engine/decision/kernel/decision_view.h"
#include "engine/decision/slack_bounds.h"
#include "engine/joint_table/joint_table_store.h"
#include "engine/scene/scene.h"
#include "engine/selection/plan.h"

namespace clearance {

/// The pairs of a plan that have a joint table.
class TablePlan {
 public:
  /// \param tables null without any
  TablePlan(const engine::Scene& scene, const Plan& plan, const SlackBounds& slack, const JointTableStore* tables);
  TablePlan() = default;

  const std::vector<TabledPair>& pairs() const { return pairs_; }
  /// Index in pairs() of the pair at a position in the plan, or kNoTable.
  std::uint8_t at(std::uint64_t position) const { return of_position_.empty() ? kNoTable : of_position_[position]; }
  /// The table of this pair decides nothing, since the pair has no usable poses.
  void disable(std::uint64_t position) {
    if (const std::uint8_t table = at(position); table != kNoTable) pairs_[table].hit_below = TableCell::kNoLow;
  }

 private:
  void take(const engine::Scene& scene, const Plan& plan, const SlackBounds& slack, const JointTableStore& tables,
            std::uint64_t position);

  std::vector<std::shared_ptr<const JointTable>> tables_;  // of pairs_
  std::vector<TabledPair> pairs_;
  std::vector<std::uint8_t> of_position_;  // empty without pairs
};

}  // namespace clearance
