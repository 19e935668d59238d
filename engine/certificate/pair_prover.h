// Proves that a pair stays at least a given length apart along a motion or its beginning, by spans of time with
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

/// Poses of a motion's bodies at one time, as its search computes them.
class MotionMoment {
 public:
  /// Both must outlive this.
  /// \param boxes as for BodyPoses
  MotionMoment(const engine::Scene& scene, const Plan& plan, std::span<const Aabb> boxes)
      : plan_(plan), poses_(plan), placed_(scene, plan, boxes) {}

  /// Begins with another motion.
  /// \param moving must outlive its use
  void begin(MovingBodies& moving);
  /// \param time in [0, 1]
  void move_to(double time) { move_to(time, time, time); }
  /// To a time in a span, with velocities for both sides of it.
  void move_to(double begin, double time, double end);

  MovingBodies& moving() const { return *moving_; }
  const BodyPoses& placed() const { return placed_; }
  /// On side 0 until the span's begin, or 1 until its end; the same for straight motions.
  std::span<const Twist> twists(int side) const { return twists_[side]; }

 private:
  const Plan& plan_;
  MotionPoses poses_;
  BodyPoses placed_;
  MovingBodies* moving_ = nullptr;
  double begin_ = -1, time_ = -1, end_ = -1;
  std::uint64_t moments_ = 0;  // number of moments so far; each has a number of its own
  std::vector<Mat3d> rotations_;
  std::vector<Twist> twists_[2];
};

/// Halves the motion until each span is proved by the pair's speed, or by a direction along which the motion is
/// bounded. Writes the spans that it proves.
class PairProver {
 public:
  /// All references must outlive this.
  /// \param position of the pair in the plan
  /// \param lower bound to be proved, in metres
  /// \param until end of the time to be covered, from 0, at most 1
  PairProver(const engine::Scene& scene, const MotionBounds& bounds, const EvaluateOptions& options,
             MotionMoment& moment, std::uint64_t position, BodyPair pair, double lower, double until,
             CertificateText& text);

  /// Returns true once the bound is proved or the proof has failed, and false if the slice ended first.
  /// \param span_at converts the moment to the span that is written
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
    double at = 0;  // time of its evaluation
    // Exact, even where the middle is rounded: a span begins at 0, or no earlier than it is long.
    double half() const { return std::max(end - at, at - begin); }
  };
  // Halves of the current span that are proved so far.
  struct Halves {
    bool before = true, after = true;
    bool any() const { return before || after; }
  };

  bool is_curved() const { return !moment_.moving().curves.empty(); }
  void begin_span();
  void take_rates();
  bool step(WorkMeter& meter);
  Vec3d towards_b() const;
  bool try_boxes();
  bool step_cover(WorkMeter& meter);
  bool is_too_near_somewhere(WorkMeter& meter);
  Halves try_parts(const ConvexPart& p, const ConvexPart& q, PartProof claim, bool in_all_ways);
  Halves by_direction(const Vec3d& n, const ConvexPart* p, const ConvexPart* q) const;
  bool is_proved_along(const Vec3d& n, const ConvexPart* p, const ConvexPart* q, int side) const;
  bool by_speed(double lower) const { return difference_below(slack_.true_lower(lower), way_) >= lower_; }
  void write(SpanPlace place);
  void end_span(const Halves& proved);

  const engine::Scene& scene_;
  const MotionBounds& bounds_;
  MotionMoment& moment_;
  std::uint64_t position_;
  BodyPair pair_;
  const Body &a_, &b_;
  double lower_;
  CertificateText& text_;
  NarrowLimits limits_;
  std::vector<Span> left_;  // earliest span last
  std::uint32_t spans_ = 0;
  bool has_begun_span_ = false, has_failed_ = false;

  // Of the current span.
  PairRates rates_;
  double reach_ = 0;  // until its ends, in the units of rates_: time, or the progress of a curve
  double rest_ = 0;   // MotionBounds::rest()
  PairGrowth growth_;
  Slack slack_;  // of the parts, which do not grow: growth in its middle is inner slack
  double way_ = 0;
  std::uint32_t i_ = 0, j_ = 0;     // the current pair of parts
  std::optional<PairCover> cover_;  // used instead of i_ and j_ if a body is not convex
  NearestElements nearest_;
  Halves halves_;
  std::vector<PartProof> claims_;
  SpanPlace proved_;  // its begin, end and middle
};

}  // namespace clearance
