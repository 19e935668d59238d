// Motions answered in blocks.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "engine/motion/motion_poses.h"
#include "engine/motion/motion_search.h"

namespace clearance {

/// Sets the evaluation options that motions need in addition to those of a job.
void set_motion_options(const Plan& plan, EvaluateOptions& options);

/// A motion, with the argument of MotionSearch::begin().
struct OpenMotion {
  std::uint64_t motion;
  std::vector<OpenPair> open;
};

/// Answers a block of motions at a time, breadth first: the next nodes of all their searches are placed and evaluated
/// together, so that SIMD lanes find many pairs of the same two hulls. Each worker has its own.
class MotionBlock {
 public:
  /// Maximum number of motions in a block, which bounds its memory.
  static std::uint64_t most(const Plan& plan, int workers);

  /// All references must outlive this.
  /// \param boxes of all bodies in the snapshot, or empty
  /// \param most maximum number of motions
  MotionBlock(const MotionQuery& motion_query, const EvaluateOptions& options, std::span<const Aabb> boxes,
              std::uint64_t most);

  bool has_begun() const { return count_ > 0; }
  /// \param first first of `count` consecutive motions
  void begin(std::uint64_t first, std::uint64_t count, WorkMeter& meter) {
    begin_each(count, [first](std::uint64_t i) { return OpenMotion{first + i, {}}; }, meter);
  }
  /// Motions that need not be consecutive.
  void begin(std::span<const std::uint64_t> motions, WorkMeter& meter) {
    begin_each(motions.size(), [motions](std::uint64_t i) { return OpenMotion{motions[i], {}}; }, meter);
  }
  /// Likewise, with their open pairs.
  void begin(std::span<const OpenMotion> motions, WorkMeter& meter) {
    begin_each(motions.size(), [motions](std::uint64_t i) -> const OpenMotion& { return motions[i]; }, meter);
  }
  /// Continues until the slice ends. Returns true once all motions are answered.
  bool advance(WorkMeter& meter);
  /// Appends the rows of all motions, in order. Returns the number of pairs evaluated.
  std::uint64_t end(std::vector<MotionRow>& rows);

 private:
  // A span that is being evaluated.
  struct Place {
    MotionSearch* search = nullptr;
    MotionSearch::Node node;
    std::vector<Twist> twists[2];  // of Plan::moved, for each of MotionPoses::sides()
    std::size_t end = 0;           // end of its pair requests

    MotionSearch::Moment moment(const BodyPoses& placed) const {
      return {placed, {twists[0], twists[twists[1].empty() ? 0 : 1]}};
    }
  };
  template <class At>
  void begin_each(std::uint64_t count, const At& motion, WorkMeter& meter) {
    begin_searches(count);
    for (std::uint64_t i = 0; i < count; ++i) begin_search(i, motion(i));
    count_begun(meter);
  }
  void begin_searches(std::uint64_t count);
  void begin_search(std::uint64_t i, const OpenMotion& motion);
  void count_begun(WorkMeter& meter) const;
  bool collect_pairs(WorkMeter& meter);
  void place(WorkMeter& meter);
  bool refine();
  void take();

  const MotionQuery& motion_query_;
  Evaluator evaluator_;
  std::optional<Evaluator> rough_;  // coarse first pass, which often decides on which side of its target a pair is
  const std::span<const Aabb> boxes_;
  MotionPoses poses_;
  std::vector<MotionSearch> searches_;  // as many as were needed at once; placements_ likewise
  std::size_t count_ = 0, turn_ = 0;    // the latter is the next search to serve
  std::vector<BodyPoses> placements_;
  std::uint64_t placed_ = 0;  // number of instants so far, which identifies the poses of each
  std::vector<Place> places_;
  std::size_t used_ = 0;  // of places_
  std::vector<Instant> instants_;
  std::vector<Mat3d> rotations_;
  std::vector<PlacedBodies> to_evaluate_;
  std::vector<MotionSearch::PairRequest> requests_;
  std::vector<PairAnswer> answers_;
  std::vector<PlacedBodies> undecided_;  // pairs that the coarse pass left unresolved
  std::vector<std::size_t> undecided_at_;
  std::vector<PairAnswer> fine_answers_;
  bool is_evaluating_ = false, is_rough_ = false;
};

}  // namespace clearance
