// One pair of bodies in one configuration: from poses to an answer.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "answer.h"
#include "certify.h"
#include "lanes.h"
#include "narrow_phase.h"
#include "plan.h"

namespace clearance {

/// Where all bodies are in one configuration: a snapshot with some bodies moved. Each worker has its own.
class Placement {
 public:
  /// \param boxes of all bodies in the snapshot; empty: made when asked for. Both must outlive this.
  Placement(const Scene& scene, const Plan& plan, std::span<const Aabb> boxes);

  /// Moves to configuration k of the plan; nothing to do where it has none. \param rotations (M,) of its poses
  void configure(std::uint64_t k, std::span<const Mat3d> rotations);
  bool moves_any() const { return !moved_slot_.empty(); }
  bool moves(std::uint32_t body) const { return !moved_slot_.empty() && moved_slot_[body] != kNone; }
  bool stands_at(std::uint64_t k) const { return moved_slot_.empty() || k == configuration_; }

  const BodyPlacement& operator[](std::uint32_t body) const {
    return moved_slot_.empty() || moved_slot_[body] == kNone ? plan_.snapshot->placed[body] : moved_[moved_slot_[body]];
  }
  /// A box around the body; empty (low > high) without a usable pose.
  Aabb box(std::uint32_t body) const;
  /// The same where it has been made already; else null.
  const Aabb* known_box(std::uint32_t body) const {
    if (boxes_.empty()) return nullptr;
    return moved_slot_.empty() || moved_slot_[body] == kNone ? &boxes_[body] : &moved_boxes_[moved_slot_[body]];
  }

 private:
  const Scene& scene_;
  const Plan& plan_;
  std::span<const Aabb> boxes_;
  std::uint64_t configuration_ = ~std::uint64_t{0};
  std::vector<std::uint32_t> moved_slot_;  // of each body: index into moved_, or kNone; empty without configurations
  std::vector<Pose> local_;                // of each moved body
  std::vector<const Mat3d*> rotation_of_;  // of local_, while a configuration is being placed
  std::vector<BodyPlacement> moved_;
  std::vector<Aabb> moved_boxes_;
};

/// The box of a placed body.
Aabb body_box(const Body& body, const BodyPlacement& placement);

/// What is asked of every pair of a query.
struct EvaluateOptions {
  NarrowLimits limits;
  const LaneKernel* lanes = nullptr;  ///< null: one pair after another
  bool f32 = false;              ///< begin with float32 where it can hold the pieces
  bool reference = false;        ///< the brute-force oracle: no culling, double-double
  bool cull = false;             ///< compare bounding boxes with max_distance first
  bool want_points = true;       ///< witness points, normals and pieces; without, only the interval
  bool want_nonsmooth = false;
  std::span<const std::uint8_t> stale;  ///< of each body
};

/// A pair in the configuration that a placement stands at.
struct PlacedBodies {
  BodyPair pair;
  const Placement* placement;
  WarmSimplex* warm = nullptr;  ///< of a pair of single pieces; null: cold
};

/// Answers many pairs, whatever their ids. Each worker has its own.
class Evaluator {
 public:
  Evaluator(const Scene& scene, const EvaluateOptions& options) : scene_(scene), options_(options) {}
  void run(std::span<const PlacedBodies> pairs, std::span<PairAnswer> answers);

 private:
  struct Waiting {  // a pair of single pieces, to be answered in lanes
    const Piece *a, *b;
    std::uint32_t index;
  };
  void take_lane(const LaneAnswer& lane, const LaneWitness& witness, const Piece& a, const LanePair& placed, const Piece& b,
                 PairAnswer& answer) const;
  void settle_in_f64(const LaneBatch& all);
  void run_in_lanes(std::span<const PlacedBodies> pairs, std::span<PairAnswer> answers);

  const Scene& scene_;
  EvaluateOptions options_;
  std::vector<Waiting> waiting_;
  std::vector<LanePair> lane_pairs_;
  std::vector<LaneAnswer> lane_answers_;
  std::vector<LaneWitness> lane_witnesses_;
  std::vector<Gjk<double>> lane_unsettled_;
  // Of the pairs that float32 left open.
  std::vector<std::size_t> again_;
  std::vector<LanePair> again_pairs_;
  std::vector<LaneAnswer> again_answers_;
  std::vector<LaneWitness> again_witnesses_;
  std::vector<Gjk<double>> again_unsettled_;
};

/// A lower bound on a pair's distance from boxes alone; +inf if one of them cannot be placed.
double box_gap(const Scene& scene, const Placement& placement, BodyPair pair);
/// The flags that a pair of known bodies has for its poses alone: kFlagRenormalised, kFlagStale.
std::uint16_t pose_flags(const Placement& placement, BodyPair pair, std::span<const std::uint8_t> stale);
/// Whether a pair's answer is a bad or missing pose or an unknown body.
bool is_unusable(const Scene& scene, const Placement& placement, BodyPair pair);

}  // namespace clearance
