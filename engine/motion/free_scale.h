// How far joints may move from a configuration before bodies can reach their margins.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "engine/query/job_state.h"
#include "engine/robot/motion_path.h"
#include "engine/selection/plan.h"

namespace clearance {

/// Bounds, for each pair of a plan, how much joints can reduce its distance (docs/trust/bounds_robots.md, "Free
/// regions") if each joint moves by at most s times its weight.
class FreeScale {
 public:
  /// Throws QueryError for invalid weights, for a query without joints or with bodies or too many pairs, and for a
  /// robot whose root the joints move.
  /// \param scene, plan must outlive this; the plan has weights: (J,) radians and metres, >= 0
  FreeScale(const engine::Scene& scene, const Plan& plan);

  /// Processes pairs until the slice ends. Returns true once all are done, which the other functions require. Throws
  /// QueryError for a pair with an unknown body, or with one that moves by itself.
  bool advance(WorkMeter& meter);

  /// Travel of the sliding joints of each robot.
  /// \param row (J,) positions
  std::vector<double> travels(std::span<const double> row) const;
  /// The largest s proved to keep a pair beyond its margin, rounded down. Returns 0 if no s is proved, and +inf if
  /// nothing moves the pair.
  /// \param position of the pair
  /// \param lower bound on its distance at the joints' current positions
  double of(std::uint64_t position, std::span<const double> travels, double lower, double margin) const;

 private:
  using Wide = long double;  // weights have any size: squares of their products neither underflow nor overflow

  // The link that carries a body, and a ball in the link's frame around all points of the body.
  struct Carried {
    std::uint32_t robot = kNone, link = kNone;
    LinkBall points;
  };
  // Path length of one robot's joints at s = 1, and its increase per metre of travel.
  struct Way {
    std::uint32_t robot;
    Wide fixed, per_travel;
  };

  void check() const;
  void take_weights();
  const Carried& carried(std::uint32_t body);
  Carried carrier_of(std::uint32_t body) const;
  Way way_of(std::uint32_t robot, const MotionPath& path) const;
  void add_pair(const Carried& a, const Carried& b);

  const engine::Scene& scene_;
  const Plan& plan_;
  std::vector<std::uint8_t> moves_;                       // for each body: whether the joints move it
  std::vector<std::optional<Carried>> carried_;           // for each body that a pair has named
  std::uint64_t next_ = 0;                                // next pair to process
  std::vector<std::vector<double>> positions_, weights_;  // for each robot, by column: snapshot; move at s = 1
  std::vector<Wide> weight_travels_;                      // for each robot: the most that s = 1 adds to the travel
  std::vector<Way> ways_;
  // For each pair: bounds in ways_, each of which holds; the ways of one bound are summed.
  std::vector<std::uint32_t> bound_end_, pair_end_;
};

/// For a plan with kFieldFreeScale. Throws QueryError as FreeScale does.
std::unique_ptr<Job::State> make_free_scale_job(const JobContext& context, Plan plan, const ReplyView& reply);

}  // namespace clearance
