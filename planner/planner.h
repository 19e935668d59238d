// A small planner: RRT-Connect whose every motion is proved free, for clearance::Engine and clearance::Client.
//
//   const clearance::Joints joints = engine.joints("panda/panda_arm");
//   const clearance::PathPlan plan = clearance::plan(engine, joints, start, goal, {.margin = 0.01});
//   if (plan.found()) drive(plan.path);
#pragma once

#include <clearance/check.h>
#include <clearance/prepared.h>
#include <clearance/rrt_connect.h>

#include <cmath>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

namespace clearance {

/// Why a planner stopped.
enum class PlanOutcome {
  kFound,
  kStartNotFree,
  kGoalNotFree,
  kBeyondLimits,  ///< of a joint, at the start or the goal
  kOutOfIterations,
};

/// A path, or the reason why there is none.
struct PathPlan {
  PlanOutcome outcome = PlanOutcome::kOutOfIterations;
  std::vector<double> path;      ///< (N, J) radians and metres; empty if none was found
  std::uint64_t iterations = 0;  ///< samples drawn
  std::uint64_t edges = 0;       ///< motions that were tried
  /// Of a start or goal that is not free or beyond limits: the pair, the verdict and the joints (check()).
  std::optional<Check> blocked;
  bool found() const { return outcome == PlanOutcome::kFound; }
};

namespace planner {

/// Proves motions by a prepared query.
class PreparedProver final : public EdgeProver {
 public:
  explicit PreparedProver(Prepared motions) : motions_(std::move(motions)) {}
  bool is_free(std::span<const double> ends) override { return motions_.run(ends).verdict()[0] == Status::kBeyond; }

 private:
  Prepared motions_;
};

inline bool is_within(std::span<const JointLimits> limits, std::span<const double> state) {
  for (std::size_t j = 0; j < state.size(); ++j)
    if (state[j] < limits[j].lower || state[j] > limits[j].upper) return false;
  return true;
}

inline bool is_state_free(EdgeProver& prover, std::span<const double> state) {
  std::vector<double> ends(state.begin(), state.end());
  ends.insert(ends.end(), state.begin(), state.end());
  return prover.is_free(ends);
}

inline void check_state(const char* what, std::span<const double> state, std::size_t joints) {
  if (state.size() != joints)
    throw std::invalid_argument(std::string(what) + ": " + std::to_string(state.size()) + " positions for " +
                                std::to_string(joints) + " joints");
  for (const double position : state)
    if (!std::isfinite(position)) throw std::invalid_argument(std::string(what) + ": a position is not finite");
}

}  // namespace planner

/// Plans a path of joints, whose every motion is proved free: all pairs of the query stay farther than its margins. The
/// other joints and bodies keep their current positions and poses.
///
/// Throws std::invalid_argument for positions that do not fit the joints, no joints, or a range that is not above 0, and
/// otherwise as motions().
/// \param engine an Engine or a Client
/// \param start, goal (J,) radians and metres
/// \param query pairs, margins and options of motions(); its joints and positions are ignored
template <class Queried>
PathPlan plan(Queried& engine, const Joints& joints, std::span<const double> start, std::span<const double> goal,
              Query query = {}, const PlanOptions& options = {}) {
  if (joints.size() == 0) throw std::invalid_argument("joints: expected one or more");
  if (!(options.range > 0)) throw std::invalid_argument("range: expected a number above 0");
  planner::check_state("start", start, joints.size());
  planner::check_state("goal", goal, joints.size());
  query.joints = joints.ids;
  query.positions = {};
  Query motions = query;
  motions.reduce = Reduce::kAny;
  motions.fields = kFieldVerdict;
  planner::PreparedProver prover(engine.prepare(as_motions(motions)));
  PathPlan made;
  for (const bool is_goal : {false, true}) {
    const std::span<const double> state = is_goal ? goal : start;
    if (planner::is_within(joints.limits, state) && planner::is_state_free(prover, state)) continue;
    query.positions = state;
    made.blocked = engine.check(query);
    made.outcome = made.blocked->beyond_limits[0] ? PlanOutcome::kBeyondLimits
                   : is_goal                      ? PlanOutcome::kGoalNotFree
                                                  : PlanOutcome::kStartNotFree;
    return made;
  }
  PathFound found = find_path(prover, joints.limits, start, goal, options);
  made.outcome = found.path.empty() ? PlanOutcome::kOutOfIterations : PlanOutcome::kFound;
  made.path = std::move(found.path);
  made.iterations = found.iterations;
  made.edges = found.edges;
  return made;
}

}  // namespace clearance
