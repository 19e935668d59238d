// Pairs of bodies in configurations: from poses to answers.
#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "engine/evaluate/piece_boxes.h"
#include "engine/mesh_distance/element_search.h"
#include "engine/narrow/answer.h"
#include "engine/narrow/piece_batch.h"
#include "engine/narrow/piece_search.h"
#include "engine/selection/body_poses.h"

namespace clearance {

class JointGradient;  // engine/evaluate/joint_gradient.h

/// What is asked of every pair of a query.
struct EvaluateOptions : NarrowOptions {
  bool cull = false;          ///< compare bounding boxes with max_distance first
  bool drops_beyond = false;  ///< of pairs beyond max_distance nobody wants to know how far
  bool want_flags = false;
  const JointGradient* joint_gradient = nullptr;  ///< where its column is asked for
};

/// The least of the intervals of two bodies' pairs of elements.
struct BodiesAnswer {
  NarrowAnswer best;  ///< of the pair whose upper bound is the least
  double lower = std::numeric_limits<double>::infinity();
  Element a{0, kNone}, b{0, kNone};
};

/// A pair in the configuration that a placement stands at.
struct PlacedBodies {
  BodyPair pair;
  const BodyPoses* placement;
  double max_distance;          ///< instead of the limits'
  WarmSimplex* warm = nullptr;  ///< of a pair of single pieces; null: cold
  /// An upper bound no higher is all that is asked, metres.
  double stop_below = -std::numeric_limits<double>::infinity();
};

/// Answers many pairs, whatever their ids. Each worker has its own.
class Evaluator {
 public:
  Evaluator(const Scene& scene, const EvaluateOptions& options)
      : scene_(scene), options_(options), batch_(narrow_options(scene, options)), boxes_(scene) {}
  void run(std::span<const PlacedBodies> pairs, std::span<PairAnswer> answers) {
    WorkMeter unlimited;
    begin(pairs, answers);
    advance(unlimited);
  }

  /// The same in slices. What is passed must stay until advance() has returned true.
  void begin(std::span<const PlacedBodies> pairs, std::span<PairAnswer> answers);
  /// Goes on until the slice is over, which may be between two piece pairs of a pair. Returns true once all are
  /// answered.
  bool advance(WorkMeter& meter);

 private:
  // Piece pairs that are listed at a time, unless those of one pair are more.
  static constexpr std::size_t kMostPiecePairs = 1u << 16;

  // Bodies of which one is not convex that are searched at a time: enough to fill lanes with.
  static constexpr std::size_t kMostElementSearches = 16;

  // The distance of two bodies is the least over their piece pairs (piece_search.h).
  struct Search {
    std::uint32_t index;    // of the pair
    std::size_t next, end;  // of piece_pairs_: not looked at yet
    std::size_t sorted;     // before this one they are in their order, and nearer than the others
    std::size_t asked;      // of a round: how many wait in tasks_
    Slack slack;            // of the pair
    PieceSearch state;
    BodiesAnswer found;                         // without the lower bound
    std::unique_ptr<ElementSearch> elements{};  // of bodies that are not convex: where their pairs come from
  };
  // A search among triangles is led by normals: they are there whoever asks, so that bounds are the same.
  static NarrowOptions narrow_options(const Scene& scene, NarrowOptions options) {
    options.want_points |= scene.has_surfaces();
    return options;
  }
  bool begin_round(WorkMeter& meter);
  bool gather(Search& search, WorkMeter& meter);
  bool is_left_to_pieces(Search& search);
  void take_in(WorkMeter& meter);
  void begin_search(const PlacedBodies& bodies, std::uint32_t index, WorkMeter& meter);
  void begin_element_search(const PlacedBodies& bodies, std::uint32_t index);
  void finish_search(Search& search, WorkMeter& meter);
  bool is_held(Search& search, WorkMeter& meter);
  void take_held(Search& search, double apart, const Vec3d (&shared)[2]);
  bool drops(double gap, const PlacedBodies& bodies) const;
  void sort_ahead(Search& search);
  bool ask(Search& search, const PlacedBodies& bodies, std::size_t singles);
  // That pieces overlap is all that those which stand for a mesh have to say of how near it is.
  double stop_below(const PlacedBodies& bodies, const Slack& slack) const {
    if (std::isinf(bodies.stop_below)) return bodies.stop_below;
    const double near = slack.near_enough(bodies.stop_below);
    return near < 0 && is_by_pieces(bodies.pair) ? 0 : near;
  }
  // Whether convex pieces stand for a body of the pair: then an overlap of pieces proves none of bodies. Before a
  // half-space it does, where a body is as its hull is.
  bool is_by_pieces(BodyPair pair) const;
  void take_round(Search& search, double stop_below, std::span<const NarrowAnswer> answers);

  const Scene& scene_;
  EvaluateOptions options_;
  PieceBatch batch_;
  PieceBoxes boxes_;
  std::span<const PlacedBodies> pairs_;
  std::span<PairAnswer> answers_;
  std::size_t next_ = 0;     // of pairs_: not taken in yet
  std::size_t singles_ = 0;  // of tasks_: pairs of single pieces, the first ones
  bool in_round_ = false;    // tasks_ are being answered
  std::vector<PieceTask> tasks_;
  std::vector<Search> searches_;
  std::vector<PiecePair> piece_pairs_;
  std::vector<NarrowAnswer> found_;
  std::vector<std::unique_ptr<ElementSearch>> unused_;  // to be used again
  bool gathering_ = false;                              // a round is being put together
  Piece rooms_[2];                                      // for triangles
};

/// A lower bound on a pair's distance from boxes alone; +inf if one of them cannot be placed.
double box_gap(const Scene& scene, const BodyPoses& placement, BodyPair pair);
/// Flags of the poses of a pair of known bodies: kFlagRenormalised, kFlagBeyondLimits.
std::uint16_t pose_flags(const BodyPoses& placement, BodyPair pair);
/// Whether a pair's answer is a bad or missing pose or an unknown body.
bool is_unusable(const Scene& scene, const BodyPoses& placement, BodyPair pair);
/// The answer for such a pair: its status says why, and the bounds are -inf and inf.
PairAnswer unusable_answer(const Scene& scene, const BodyPoses& placement, BodyPair pair,
                           const EvaluateOptions& options);

}  // namespace clearance
