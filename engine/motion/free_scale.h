// How far joints may move from a configuration before bodies can be as near to each other as their margins.
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

/// For each pair of a plan what joints can do to its distance (docs/bounds.md, "Motion"), where each joint moves by no
/// more than s times its weight.
class FreeScale {
 public:
  /// \param plan with weights: (J,) radians and metres, >= 0. \param scene, plan outlive this. Throws QueryError for
  /// other weights, for a query without joints or with bodies or too many pairs, and for a robot whose root the joints
  /// move.
  FreeScale(const Scene& scene, const Plan& plan);

  /// Looks at the pairs until the slice is over. Returns true once all are, from when on the rest may be called. Throws
  /// QueryError for a pair of an unknown body, and of one that moves by itself.
  bool advance(WorkMeter& meter);

  /// How far sliding joints are out, of each robot. \param row (J,) positions
  std::vector<double> travels(std::span<const double> row) const;
  /// The largest s that is proved to keep a pair beyond its margin, rounded down; 0: none is, +inf: nothing moves it.
  /// \param position of the pair. \param lower bound on its distance where the joints are
  double of(std::uint64_t position, std::span<const double> travels, double lower, double margin) const;

 private:
  using Wide = long double;  // weights have any size: squares of their products neither underflow nor overflow

  // What moves a body: a link that carries it, and a ball of the link's around all its points.
  struct Carried {
    std::uint32_t robot = kNone, link = kNone;
    LinkBall points;
  };
  // Ways of one robot's joints while s is 1: so long, and so much longer for each metre of travel.
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

  const Scene& scene_;
  const Plan& plan_;
  std::vector<std::uint8_t> moves_;                       // of each body: whether the joints move it
  std::vector<std::optional<Carried>> carried_;           // of each body that a pair has named
  std::uint64_t next_ = 0;                                // pair to be looked at
  std::vector<std::vector<double>> positions_, weights_;  // of each robot, by column: as in the snapshot; while s is 1
  std::vector<Wide> weight_travels_;                      // of each robot: the most that s = 1 adds to the travel
  std::vector<Way> ways_;
  // Of each pair: bounds in ways_, of which each holds; the ways of one are added up.
  std::vector<std::uint32_t> bound_end_, pair_end_;
};

/// Of a plan with kFieldFreeScale. Throws QueryError as FreeScale does.
std::unique_ptr<Job::State> make_free_scale_job(const JobContext& context, Plan plan, const ReplyView& reply);

}  // namespace clearance
