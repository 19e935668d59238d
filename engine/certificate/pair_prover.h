// Finds what proves that a pair stays farther apart than a length along a motion, or its beginning: spans of time, with
// directions.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "engine/certificate/certificate_text.h"
#include "engine/certificate/pair_cover.h"
#include "engine/certificate/row_prover.h"
#include "engine/mesh_distance/nearest_elements.h"
#include "engine/motion/half_spans.h"
#include "engine/motion/motion_bounds.h"
#include "engine/motion/motion_poses.h"

namespace clearance {

/// Where the bodies of a motion are at one time, as its search has them there.
class MotionMoment {
 public:
  /// Both must outlive this. \param boxes as Placement has them
  MotionMoment(const Scene& scene, const Plan& plan, std::span<const Aabb> boxes)
      : plan_(plan), poses_(plan), placed_(scene, plan, boxes) {}

  /// Begins with another motion. \param moving must stay
  void begin(MovingBodies& moving);
  /// \param time from 0 to 1
  void move_to(double time);

  const MovingBodies& moving() const { return *moving_; }
  const BodyPoses& placed() const { return placed_; }
  std::span<const Twist> twists() const { return twists_; }

 private:
  const Plan& plan_;
  MotionPoses poses_;
  BodyPoses placed_;
  const MovingBodies* moving_ = nullptr;
  double time_ = -1;
  std::uint64_t moments_ = 0;  // so far: each has its own number
  std::vector<Mat3d> rotations_;
  std::vector<Twist> twists_;
};

/// Halves it until each span is proved by the pair's speed, or by a direction along which it is looked at as it moves.
/// Writes what it finds.
class PairProver {
 public:
  /// All must outlive this. \param position of the pair in the plan. \param lower metres, to be proved. \param until
  /// when, from 0 on: to 1 at most
  PairProver(const Scene& scene, const MotionBounds& bounds, const EvaluateOptions& options, MotionMoment& moment,
             std::uint64_t position, BodyPair pair, double lower, double until, CertificateText& text);

  /// Returns true once it is known whether the bound is proved; false where the slice is over. \param span_at makes of
  /// the moment what a span is written with
  template <class SpanAt>
  bool advance(WorkMeter& meter, const SpanAt& span_at) {
    while (!left_.empty() && !has_failed_) {
      if (step(meter)) write(span_at(moment_.placed(), pair_));
      if (meter.is_over() && !left_.empty() && !has_failed_) return false;
    }
    return true;
  }
  bool has_proved() const { return left_.empty() && !has_failed_; }

 private:
  struct Span {
    double begin, end;
    double middle() const { return 0.5 * begin + 0.5 * end; }
    // Exact, even where the middle is rounded: a span begins at 0, or no earlier than it is long.
    double half() const { return std::max(end - middle(), middle() - begin); }
  };
  // Of the span that is looked at: which halves are proved so far.
  struct Halves {
    bool before = true, after = true;
    bool any() const { return before || after; }
  };

  void look();
  bool step(WorkMeter& meter);
  Vec3d towards_b() const;
  bool try_boxes();
  bool step_cover(WorkMeter& meter);
  bool is_too_near_somewhere(WorkMeter& meter);
  Halves try_pieces(const Piece& p, const Piece& q, PieceProof claim, bool in_all_ways);
  Halves by_direction(const Vec3d& n, const Piece* p, const Piece* q) const;
  bool by_speed(double lower) const { return difference_below(slack_.true_lower(lower), way_) >= lower_; }
  void write(SpanPlace place);
  void end_span(const Halves& proved);

  const Scene& scene_;
  const MotionBounds& bounds_;
  MotionMoment& moment_;
  std::uint64_t position_;
  BodyPair pair_;
  const Body &a_, &b_;
  double lower_;
  CertificateText& text_;
  NarrowLimits limits_;
  std::vector<Span> left_;  // the earliest last
  std::uint32_t spans_ = 0;
  bool is_looked_at_ = false, has_failed_ = false;

  // Of the span whose turn it is.
  PairRates rates_;
  Slack slack_;
  double way_ = 0;
  std::uint32_t i_ = 0, j_ = 0;     // the pieces whose turn it is
  std::optional<PairCover> cover_;  // instead, where one body is not convex
  NearestElements nearest_;
  Halves halves_;
  std::vector<PieceProof> claims_;
  SpanPlace proved_;  // its begin, end and middle
};

}  // namespace clearance
