// Decides whether motions are free, by covers alone.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "engine/decision/cover_plan.h"
#include "engine/decision/given_motions.h"
#include "engine/decision/span_rates.h"
#include "engine/robot/lane_kinematics.h"
#include "engine/robot/link_twists.h"
#include "engine/selection/joint_curve.h"

namespace clearance {

/// A pair that is not decided in a part of a motion's time.
struct OpenPair {
  std::uint64_t position;  ///< in the plan
  double begin, end;
};

/// Divides a motion into spans until covers prove each free, or prove a hit in the middle of one. Each worker has its
/// own (docs/trust/bounds_covers.md, "Motions").
class MotionDecider {
 public:
  /// The arguments must outlive this. The covers know rates (CoverPlan::rates()).
  MotionDecider(const CoverPlan& covers, const Plan& plan);

  /// The verdict of a motion of the plan; kUnresolved leaves open() to the exact engine.
  Verdict decide(std::uint64_t motion);
  /// By position, once each. Empty if the motion is open as a whole.
  std::span<const OpenPair> open() const { return left_; }
  /// Motions that were found to hit by a ball or a joint table that had hit in an earlier one.
  std::uint64_t guessed() const { return guessed_; }

 private:
  static constexpr std::size_t kTogether = 8;   // spans placed at once
  static constexpr int kMostSpans = 16;         // of a motion
  static constexpr double kRootSpan = 0.45;     // radians and metres that joints move until a span's end, at first
  static constexpr double kLeastSpan = 0x1p-7;  // half length below which spans are not divided
  /// A span [middle - half, middle + half], with the items left open by the one that it is half of.
  struct Span {
    double middle;
    std::size_t begin, end;  // in items_; empty for all
    std::size_t curve = 0;   // its control points in curve_points_
  };

  bool begin(std::uint64_t motion);
  void begin_curves();
  void take_rates();
  void take_curves(const Span& span, double half);
  void cut_curves();
  void keep_halves();
  void take_middle(const Span& span, double* row) const;
  double begin_spans();
  Verdict decide_spans(double half);
  bool hits_again();
  bool is_hit_at_first();
  bool is_in_table(std::uint32_t table, std::size_t k) const;
  void remember(const BallHit& hit, std::size_t k);
  void place(std::span<const Span> spans);
  void place_links();
  void take_poses(std::size_t k);
  bool decide_placed(std::span<const Span> spans);
  void decide_in_lanes(SpanBatch& batch);
  static bool take(void* self, std::size_t k, const SpanDecision& decision);
  bool take(std::size_t k, const SpanDecision& decision);
  void divide(const Span& span, std::size_t open, bool may_divide);
  Verdict leave_pairs();
  void take_twists(double middle);
  void take_twist(std::uint32_t body);
  void bound_body(std::uint32_t body, double growth);
  Twist twist_of(std::uint32_t body, std::size_t k) const;
  Vec3d origin_of(std::uint32_t body, std::size_t k) const;
  static PairSpan pair_span(void* self, std::size_t k, std::uint32_t pair);
  PairSpan pair_span(std::size_t k, std::uint32_t pair);

  const CoverPlan& covers_;
  const Plan& plan_;
  const DecisionKernel& kernel_;
  std::vector<LinkTwists> robots_;       // for each of Plan::motions
  std::span<const double> start_, end_;  // positions
  GivenMotions given_;
  std::vector<JointCurve> curves_;                               // of joints and given_; none for straight motions
  CurveSpan curve_span_;                                         // the span under way
  std::vector<double> curve_points_, scratch_;                   // of spans: (degree + 1, curves_) each
  std::vector<double> in_middle_;                                // (degree + 1,) shares of control points in a middle
  std::vector<std::vector<double>> along_;                       // by robot and column
  SpanRates::Changes changes_;                                   // of the motion, or of a curve's span
  double total_ = 0;                                             // sum of the changes
  bool has_rates_ = false;                                       // whether rates_ are those of the motion
  std::vector<SpanRates::Rates> rates_;                          // by body
  std::vector<std::vector<SpanRates::View>> views_;              // by moved pair, once requested
  std::vector<std::optional<SpanRates::PairRates>> pair_rates_;  // by moved pair, once requested for a motion
  std::vector<double> rows_, reach_;                   // (spans, joints) middles; (joints,) changes until a span's end
  std::vector<double> middles_;                        // (spans,) times
  bool is_placed_ = true;                              // whether the joints that stay have positions
  std::vector<std::vector<DoubleInLanes>> positions_;  // (columns,) of each robot; spans are lanes
  std::vector<LaneKinematics> lanes_;                  // of each robot
  bool are_links_placed_ = false;                      // whether lanes_ are at positions_
  std::vector<const double*> body_frames_;             // by body, in lanes_; null for a body that no link moves
  std::vector<const double*> body_twists_;             // likewise
  bool all_in_lanes_ = false;                          // whether links move all bodies, along straight motions
  std::vector<Pose> poses_, links_;       // of one span: (Plan::bodies,); of the links of each robot in turn
  std::vector<std::size_t> links_begin_;  // by robot: in links_
  std::size_t links_of_span_ = 0;
  std::vector<Twist> link_twists_;
  std::vector<Twist> twists_;    // by body, in the common frame
  std::vector<Pose> in_frame_;   // likewise; of bodies with a pose of their own
  std::vector<Vec3d> origins_;   // likewise
  std::vector<double> growths_;  // by body: the most in the span
  std::vector<SpanBody> bodies_;
  // Of the spans under way.
  double half_ = 0;
  std::span<const Span> placed_;  // of which the first is placed as number first_placed_
  std::size_t first_placed_ = 0;
  bool has_lanes_ = false;  // whether bodies_ are those of half_, in lanes
  std::vector<SpanInput> inputs_;
  int divided_ = 0;
  bool is_undecided_ = false, is_hit_ = false;
  std::vector<SpanItem> items_, next_items_, open_;
  std::vector<Span> spans_, next_;
  std::vector<Span> first_;  // placed at first: spans_ and instants between
  std::vector<OpenPair> left_;
  std::vector<BallHit> hits_;          // of the last motions, the latest first
  std::vector<std::uint32_t> tables_;  // likewise: DecisionView::tabled
  std::vector<std::uint64_t> state_open_;
  std::uint64_t guessed_ = 0;
  std::vector<std::uint8_t> is_left_;  // by moved pair: in this motion the exact engine decides it
};

}  // namespace clearance
