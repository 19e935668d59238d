// Evaluates pairs of bodies in configurations: from poses to answers.
#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "engine/evaluate/part_boxes.h"
#include "engine/mesh_distance/element_search.h"
#include "engine/narrow/answer.h"
#include "engine/narrow/part_batch.h"
#include "engine/narrow/part_search.h"
#include "engine/selection/body_poses.h"

namespace clearance {

class JointGradient;  // engine/evaluate/joint_gradient.h
class SecondOrder;    // engine/evaluate/second_order.h

/// Options that hold for every pair of a query.
struct EvaluateOptions : NarrowOptions {
  bool cull = false;          ///< compare bounding boxes with max_distance first
  bool drops_beyond = false;  ///< the distance of pairs beyond max_distance is not needed
  bool want_flags = false;
  const JointGradient* joint_gradient = nullptr;  ///< null unless its column is requested
  const SecondOrder* second_order = nullptr;      ///< null unless one of its columns is requested
};

/// The least of the intervals of two bodies' pairs of elements.
struct BodiesAnswer {
  NarrowAnswer best;  ///< of the pair with the least upper bound
  double lower = std::numeric_limits<double>::infinity();
  Element a{0, kNone}, b{0, kNone};
};

/// A pair in the configuration that `placement` has the poses of.
struct PlacedBodies {
  BodyPair pair;
  const BodyPoses* placement;
  double max_distance;  ///< replaces that of the limits
  /// The search may stop at an upper bound no higher than this, in metres.
  double stop_below = -std::numeric_limits<double>::infinity();
  /// That of the pair alone: `max_distance` is less if a nearer pair is known.
  double max_distance_alone = -std::numeric_limits<double>::infinity();
};

/// Replaces an answer except its flags.
inline void replace_answer(PairAnswer& answer, const PairAnswer& by) {
  const std::uint16_t flags = answer.flags;
  answer = by;
  answer.flags = flags;
}

/// Evaluates many pairs, valid or not. Each worker has its own.
class Evaluator {
 public:
  Evaluator(const engine::Scene& scene, const EvaluateOptions& options)
      : scene_(scene), options_(options), batch_(narrow_options(scene, options)), boxes_(scene) {}
  void run(std::span<const PlacedBodies> pairs, std::span<PairAnswer> answers) {
    WorkMeter unlimited;
    begin(pairs, answers);
    advance(unlimited);
  }

  /// Begins an evaluation in slices. The arguments must stay valid until advance() has returned true.
  void begin(std::span<const PlacedBodies> pairs, std::span<PairAnswer> answers);
  /// Continues until the slice is over, which may be between two part pairs. Returns true once all pairs are answered.
  bool advance(WorkMeter& meter);

 private:
  // Limit on the part pairs listed at a time, unless those of one pair are more.
  static constexpr std::size_t kMostPartPairs = 1u << 16;
  // Limit on non-convex bodies searched at a time; it suffices to fill the lanes.
  static constexpr std::size_t kMostElementSearches = 16;

  // Search for the nearest part pair of two bodies (part_search.h).
  struct PairSearch {
    std::uint32_t index;     // of the pair
    std::size_t next, end;   // part pairs not yet evaluated, in part_pairs_
    std::size_t sorted;      // part pairs before this one are sorted, and nearer than the others
    std::size_t task_count;  // tasks of this round
    Slack slack;             // of the pair
    double max_distance;     // of the search
    double min_penetration = 0;
    PartSearch state;
    BodiesAnswer found;                         // without the lower bound
    std::unique_ptr<ElementSearch> elements{};  // source of part pairs for bodies that are not convex, else null
    bool is_cut = false;                        // max_distance has ruled elements out
  };
  static NarrowOptions narrow_options(const engine::Scene& scene, NarrowOptions options);
  bool begin_round(WorkMeter& meter);
  void take_in(WorkMeter& meter);
  void finish(const PlacedBodies& bodies, double max_distance, const BodiesAnswer& found, PairAnswer& answer);

  // evaluate_search.cpp
  void begin_search(const PlacedBodies& bodies, std::uint32_t index, WorkMeter& meter);
  bool drops(double max_distance) const;
  bool is_searched_again(const PairSearch& search) const;
  void sort_ahead(PairSearch& search, double cut_off);
  bool add_tasks(PairSearch& search);
  void drop_losers(PairSearch& search, std::size_t end, double cut_off);
  void add_task(PairSearch& search, double cut_off, double stop_below, const ConvexPart& a, const ConvexPart& b);
  double cut_off_of(const PairSearch& search) const;
  void take_round(PairSearch& search, double stop_below, std::span<const NarrowAnswer> answers);
  void finish_search(PairSearch& search, WorkMeter& meter);

  // evaluate_elements.cpp
  void begin_element_search(std::uint32_t index, double max_distance);
  bool gather(PairSearch& search, WorkMeter& meter);
  bool add_element_tasks(PairSearch& search);
  bool take_hulls(PairSearch& search, std::span<const NarrowAnswer> answers);
  void end_element_round(PairSearch& search, std::span<const NarrowAnswer> answers);

  // evaluate_containment.cpp
  void take_containment(PairSearch& search, WorkMeter& meter);
  // Upper bound on the distance of the parts at which a search may stop, in metres; -inf if it may not.
  static double stop_below(const PlacedBodies& bodies, const Slack& slack) {
    return std::isinf(bodies.stop_below) ? bodies.stop_below : slack.near_enough(bodies.stop_below);
  }

  const engine::Scene& scene_;
  EvaluateOptions options_;
  PartBatch batch_;
  PartBoxes boxes_;
  std::span<const PlacedBodies> pairs_;
  std::span<PairAnswer> answers_;
  std::size_t next_ = 0;     // first of pairs_ not taken in yet
  std::size_t singles_ = 0;  // tasks_ of single parts, which come first
  bool in_round_ = false;    // tasks_ are being answered
  std::vector<PartTask> tasks_;
  std::vector<PairSearch> searches_;
  std::vector<std::uint32_t> again_;  // pairs to search without regard to nearer ones
  std::vector<PartPair> part_pairs_;
  std::vector<NarrowAnswer> found_;
  std::vector<std::unique_ptr<ElementSearch>> unused_;  // for reuse
  bool gathering_ = false;                              // a round is being put together
  ConvexPart scratch_[2];                               // for triangles
};

/// Lower bound on a pair's distance from its boxes; +inf if a body has none.
double box_gap(const engine::Scene& scene, const BodyPoses& placement, BodyPair pair);
/// Flags of the poses of a pair of known bodies: kFlagRenormalised, kFlagBeyondLimits.
std::uint16_t pose_flags(const BodyPoses& placement, BodyPair pair);
/// Whether a pair has an unknown body, or one without a usable pose.
bool is_unusable(const engine::Scene& scene, const BodyPoses& placement, BodyPair pair);
/// The answer for such a pair: its status gives the reason, and its bounds are -inf and inf.
PairAnswer unusable_answer(const engine::Scene& scene, const BodyPoses& placement, BodyPair pair,
                           const EvaluateOptions& options);

}  // namespace clearance
