// What covers know of a query: its moved bodies with covers, the obstacles around them, and radii of its pairs.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "engine/cover/cover_store.h"
#include "engine/decision/kernel/decision_view.h"
#include "engine/decision/span_rates.h"
#include "engine/decision/table_plan.h"
#include "engine/scene/scene.h"
#include "engine/selection/plan.h"

namespace clearance {

/// Constants for decisions about the states of one plan, as long as its snapshot and its pairs are the same. All
/// lengths are relative to the frame that carries the first robot moved, or else the first body, so that they are short.
/// Immutable.
class CoverPlan {
 public:
  /// Whether covers may decide states or motions of a plan: not those of many pairs and few states.
  static bool may_decide(const Plan& plan);
  /// Whether a plan is made in less time than it saves in one answer.
  static bool pays_at_once(const Plan& plan);
  /// Returns null for a plan that covers cannot decide, or while too few covers have been made.
  /// \param tables may be null
  /// \param known positions of pairs, ascending, that covers need not bound
  static std::unique_ptr<const CoverPlan> make(const engine::Scene& scene, const Plan& plan, const CoverStore& covers,
                                               const JointTableStore* tables = nullptr,
                                               std::span<const std::uint64_t> known = {});
  /// Increases whenever make() may return something else.
  static std::uint64_t revision(const CoverStore& covers, const JointTableStore* tables) {
    return covers.revision() + (tables ? tables->revision() : 0);
  }

  const DecisionView& view() const { return view_; }
  /// A link that moves a body, or that it is fixed to.
  struct LinkOf {
    std::uint32_t robot = kNone, link = kNone;  ///< index in Plan::motions; of that robot
  };
  const LinkOf& link_of(std::uint32_t body) const { return links_[body]; }
  /// For motions; null if covers cannot decide them.
  const SpanRates* rates() const { return rates_.get(); }
  /// Positions of pairs, ascending, that covers do not know: they are open in every state.
  std::span<const std::uint64_t> unknown() const { return unknown_; }
  /// Whether the bounds hold for a row of the plan's positions. Joints that slide have limits.
  bool holds_for(std::span<const double> positions) const;
  /// Whether the bounds hold for the poses of the given bodies in a configuration: usable and not too far away. Makes
  /// their quaternions units, as the kernels expect.
  bool take_given(std::span<Pose> poses) const;

 private:
  friend class CoverPlanBuilder;

  struct SlideLimit {
    std::uint32_t at;  // in a row of positions
    double most;       // metres
  };
  std::vector<SlideLimit> slides_;
  std::vector<double> most_distance_;  // by given body, metres
  std::vector<LinkOf> links_;          // of bodies_
  std::unique_ptr<const SpanRates> rates_;
  std::vector<std::shared_ptr<const Cover>> covers_;  // of bodies_
  std::vector<DecidedBody> bodies_;
  std::vector<Obstacle> obstacles_;
  std::vector<ObstacleBox> boxes_;
  std::vector<ObstacleNode> nodes_;
  std::vector<float> node_bound_;
  std::vector<MovedPair> moved_pairs_;
  std::vector<std::int32_t> moved_a_, moved_b_;
  std::vector<float> moved_reach_;
  std::vector<MovedRow> moved_rows_;
  std::vector<float> root_x_, root_y_, root_z_, moved_root_outer_, moved_root_inner_;
  std::vector<float> box_reach_, root_outer_, root_inner_, grow_, shrink_;
  std::vector<std::uint64_t> position_, unknown_;
  TablePlan tables_;
  std::vector<std::uint8_t> table_of_cell_;
  DecisionView view_{};
};

}  // namespace clearance
