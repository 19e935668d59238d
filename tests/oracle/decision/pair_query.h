// Queries of bodies of balls, decided by covers alone. Included by the tests of decisions.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "engine/cover/cover_store.h"
#include "engine/decision/cover_plan.h"
#include "engine/decision/motion_decider.h"
#include "engine/decision/state_lanes.h"
#include "engine/joint_table/joint_table_store.h"
#include "engine/query/distance/cover_bounds.h"
#include "engine/selection/body_poses.h"
#include "engine/selection/configuration_poses.h"
#include "engine/state/pose_store.h"
#include "tests/oracle/cases/cases.h"
#include "tests/oracle/decision/ball_scene.h"

namespace clearance::exact {

/// Covers of every scene, made when they are needed.
inline CoverStore& covers() {
  static CoverStore store;
  return store;
}

/// How the bodies of states are placed for distances.
enum class Placing { kByPoses, kInLanes, kOneByOne };

/// A query of one pair, or of some, for some states, or for one motion of two control points or more.
class PairQuery {
 public:
  /// \param tables may be null
  PairQuery(const BallScene& made, std::vector<BodyPair> pairs, std::vector<double> positions, double margin,
            bool is_motion = false, const JointTableStore* tables = nullptr)
      : scene_(made.scene()),
        pairs_(std::move(pairs)),
        positions_(std::move(positions)),
        poses_(made.scene(), std::chrono::seconds(60)) {
    for (const BodyPair pair : pairs_)
      for (const std::uint32_t body : {pair.a, pair.b})
        if (const Body& b = made.scene().bodies()[body]; !b.is_static || b.robot != kNone || surface_of(b))
          covers().request({b.parts});
    if (!covers().wait(std::chrono::minutes(10))) throw std::runtime_error("covers are not made in time");
    for (std::uint32_t j = 0; j < made.scene().joints().size(); ++j) joints_.push_back(j);
    QueryView query;
    query.joints = joints_;
    query.positions = positions_;
    query.configuration_count = static_cast<std::uint32_t>(positions_.size() / joints_.size());
    query.control_points = is_motion ? query.configuration_count : 2;
    query.max_evaluations = is_motion ? 100 : 0;
    query.reduce = Reduce::kAny;
    query.fields = kFieldVerdict;
    query.margin = margin;
    query.all_pairs = false;
    query.pairs = pairs_;
    plan_ = make_plan(query, made.scene(), poses_.snapshot(), 1u << 20, true);
    plan_.uncertainties = uncertainties_of(made.scene(), *plan_.snapshot, plan_.begun_ns);
    covers_ = CoverPlan::make(made.scene(), plan_, covers(), tables);
    if (!covers_) throw std::runtime_error("covers cannot decide this");
  }

  const DecisionView& view() const { return covers_->view(); }
  /// Index of a body in the view.
  std::uint32_t index_of(std::uint32_t body) const {
    return static_cast<std::uint32_t>(std::find(plan_.moved.begin(), plan_.moved.end(), body) - plan_.moved.begin());
  }
  std::vector<Pose> poses() {
    ConfigurationPoses all(plan_);
    const auto block = all.at(0, 1);
    return {block.poses.begin(), block.poses.end()};
  }
  /// Growth of the outer radii of a moved body, against an obstacle or another one.
  double grow(std::uint32_t body) const {
    return view().moved_pair_count ? view().moved_pairs[0].grow : view().grow[index_of(body)];
  }
  Verdict state() {
    const std::uint8_t usable = 1;
    Decision decision;
    std::uint64_t open[8];
    const std::vector<Pose> at = poses();
    decision_kernels()[0].run(
        {&view(), at.data(), plan_.bodies.size(), 1, &usable, true, positions_.data(), joints_.size()},
        {&decision, open, 8});
    return decision.verdict;
  }
  /// Bounds on the distance of each pair to a tolerance, for a margin of 0.
  std::vector<DistanceBounds> distances(double abs_tol) { return bounds_of(Reduce::kNone, abs_tol).bounds; }
  /// The same for their least distance, with the positions of the pairs left.
  CoverBounds::Room least_distance(double abs_tol) { return bounds_of(Reduce::kMin, abs_tol); }
  /// Bounds of the groups of a reduction, in batches of states.
  /// \param batch states that are bounded at once, up to 8 in lanes; 1 one by one
  /// \param take called with each batch: its first state, the number of states, and their bounds
  template <class Take>
  void bound_states(Reduce reduce, double abs_tol, Placing placing, std::size_t batch, const Take& take) {
    plan_.query.reduce = reduce;
    plan_.query.abs_tol = abs_tol;
    plan_.size.fields = kDefaultFields;
    CoverBounds bounds(plan_, scene_, false);
    bounds.take(*covers_, {});
    ConfigurationPoses all(plan_);
    std::optional<StateLanes> lanes;
    if (placing != Placing::kByPoses) lanes.emplace(*covers_, plan_);
    CoverBounds::Room room;
    for (std::size_t first = 0; first < plan_.query.configuration_count; first += batch) {
      const std::size_t count = std::min<std::size_t>(batch, plan_.query.configuration_count - first);
      DistanceBatch of{&view(), nullptr, {}, nullptr, plan_.bodies.size(), count, nullptr, nullptr, 0};
      std::vector<std::uint8_t> usable;
      if (lanes) {
        if (placing == Placing::kInLanes)
          lanes->place(first, count), of.frames = lanes->frames();
        else
          of.poses = lanes->place_one(first);
        of.usable = lanes->usable(), of.cells = lanes->cells();
      } else {
        const ConfigurationPoses::PoseBlock block = all.at(first, count);
        for (std::size_t k = 0; k < count; ++k) usable.push_back(is_usable(block.of(k, of.stride), first + k));
        of.poses = block.poses.data(), of.usable = usable.data();
        of.positions = positions_.data() + first * joints_.size(), of.position_stride = joints_.size();
      }
      bounds.bound(of, room);
      take(first, count, room);
    }
  }
  /// Whether the bodies of a plan have poses by links alone.
  bool can_place_lanes() const { return StateLanes(*covers_, plan_).can_place(); }
  std::size_t groups(Reduce reduce) const {
    return reduce == Reduce::kMin ? 1 : reduce == Reduce::kNearest ? scene_.bodies().size() : pairs_.size();
  }
  Verdict motion() { return MotionDecider(*covers_, plan_).decide(0); }

 private:
  bool is_usable(const ConfigurationPoses::PoseBlock& block, std::size_t state) const {
    const auto row = std::span<const double>(positions_).subspan(state * joints_.size(), joints_.size());
    return covers_->holds_for(row) && std::none_of(block.facts.begin(), block.facts.end(), [](std::uint8_t fact) {
             return (fact & (kLinkUnplaced | kLinkBad)) != 0;
           });
  }
  CoverBounds::Room bounds_of(Reduce reduce, double abs_tol) {
    CoverBounds::Room of_first;
    bound_states(reduce, abs_tol, Placing::kByPoses, 1, [&](auto, auto, CoverBounds::Room& room) { of_first = room; });
    return of_first;
  }

  const engine::Scene& scene_;
  std::vector<BodyPair> pairs_;
  std::vector<double> positions_;
  std::vector<std::uint32_t> joints_;
  PoseStore poses_;
  Plan plan_;
  std::unique_ptr<const CoverPlan> covers_;
};

inline Balls random_balls(Random& random, int count, double far, double radius) {
  Balls balls;
  for (int i = 0; i < count; ++i) balls.push_back({random.direction() * (far * random.uniform(0.3, 1)), radius});
  return balls;
}
inline const Balls kPebble{{{0, 0, 0}, 0.015625}};

inline std::vector<double> random_positions(const BallScene& made, Random& random) {
  std::vector<double> q;
  for (const SceneJoint& joint : made.scene().joints())
    q.push_back(random.uniform(std::max(joint.lower, -3.0), std::min(joint.upper, 3.0)));
  return q;
}

/// Verdicts near a margin.
struct Verdicts {
  int free = 0, hit = 0, open = 0;
  int late = 0;  ///< open, though farther from the margin than the errors allow
};

inline engine::RobotOptions with_slack() {
  engine::RobotOptions options;
  options.base = Pose{{1, 2, 0.5}, 0.5, 0.5, -0.5, 0.5};
  options.link_padding = {{"l3", 0.0078125}};
  options.link_uncertainty = {{"l4", {0.00390625, 0}}};
  return options;
}

// An arm, one link of which slides, a body that it holds, and an arm of one link.
inline BallScene made_arm(int balls, double radius, const engine::RobotOptions& options = {}) {
  Random random(static_cast<std::uint64_t>(balls));
  const auto shape = [&] {
    return balls == 1 ? Balls{{{0.25, 0.0625, 0}, radius}} : random_balls(random, balls, 0.25, radius);
  };
  BallScene made({{},
                  {shape(), 0, turning({0, 0, 0.25}, {0.25, 0, 1})},
                  {shape(), 1, sliding({0.5, 0, 0}, {1, 0.25, 0}, -0.25, 0.5)},
                  {shape(), 2, turning({0.25, 0, 0}, {0, 1, 0.25})},
                  {shape(), 3, turning({0.375, 0, 0.125}, {1, 0.5, 0})},
                  {shape(), 0, turning({0.5, 0.25, 0.25}, {0, 0.25, 1})}},
                 options);
  made.add_tool(shape(), "r/l4", random.rotation({0.125, 0, 0.25}));
  made.add_obstacle(shape(), random.rotation({0.5, -0.5, 0.75}));
  made.add_obstacle(kPebble, random.rotation({1.5, 0.5, 0.25}),
                    {0.015625, 0});  // its uncertain position is part of its radius
  return made;
}
inline std::vector<BodyPair> pairs_of(const BallScene& made) {
  const auto bodies = static_cast<std::uint32_t>(made.scene().bodies().size());
  const std::uint32_t tool = bodies - 3, wall = bodies - 2, pebble = bodies - 1;
  return {{made.link(1), wall}, {made.link(3), wall},         {made.link(4), pebble},
          {tool, wall},         {made.link(1), made.link(3)}, {made.link(2), made.link(4)},
          {made.link(1), tool}, {made.link(2), made.link(5)}, {made.link(5), tool}};
}
// Tables bound distances up to 125 mm, which these links do not exceed by much.
inline BallScene made_folding() {
  return BallScene({{},
                    {{{{0.125, 0.0625, 0}, 0.015625}}, 0, turning({0, 0, 0.25}, {0.25, 0, 1})},
                    {{{{0, 0, 0}, 0.0078125}}, 1, turning({0.125, 0, 0}, {0, 0, 1})},
                    {{{{0.0625, 0.03125, 0}, 0.015625}}, 2, turning({0.03125, 0, 0.03125}, {0, 1, 0.25})}});
}
/// The tables of a scene, made at once.
inline std::unique_ptr<JointTableStore> tables_of(const BallScene& made) {
  auto tables = std::make_unique<JointTableStore>();
  tables->request(made.scene());
  EXPECT_TRUE(tables->wait(std::chrono::minutes(10)));
  return tables;
}

}  // namespace clearance::exact
