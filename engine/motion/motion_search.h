// Subdivision of one motion until each pair is proved far enough apart throughout, or found near at some time.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "engine/decision/motion_decider.h"
#include "engine/evaluate/evaluate.h"
#include "engine/motion/half_spans.h"
#include "engine/motion/motion_bounds.h"
#include "engine/selection/columns.h"

namespace clearance {

/// Time at which a pair is proved to be within its margin.
struct MotionHit {
  double time = std::numeric_limits<double>::infinity();  // in [0, 1]; inf if never
  std::uint64_t position = 0;                             // of the pair in the plan
  std::uint32_t part_a = 0, part_b = 0;                   // its bodies' nearest parts at that time
};

/// A row of a motion.
struct MotionRow {
  Row row;
  double time = std::numeric_limits<double>::quiet_NaN();
  double found = std::numeric_limits<double>::quiet_NaN();  // time of the upper bound, even if not reported
  double free_until = 0;                                    // no pair is within its margin before; inf if free
  MotionHit hit;                                            // the first one found
  std::uint32_t steps = 0;
};

/// Writes a motion's row to a reply.
void write_motion_row(const ReplyView& reply, std::uint64_t at, const MotionRow& row);

/// Converts the answer with the least upper bound to that of the least distance.
/// \param low lower bound of all pairs throughout the motion
/// \param forced the search ended before it had converged
void decide_least(const QueryView& query, double low, bool forced, PairAnswer& answer);

/// Data shared by all searches of a query. All references must outlive it.
struct MotionQuery {
  const engine::Scene& scene;
  const Plan& plan;
  const MotionBounds& bounds;
};

/// The answer for a pair whose bodies are grown. Points stay on the bodies as they are without growth.
PairAnswer grown_answer(PairAnswer answer, const PairGrowth& growth);

/// The search for one motion's rows: a tree of spans of time, each evaluated at a time in it. A pair leaves a span once
/// its motion until the span's ends cannot bring it to its target: the margin (Reduce::kAny), or the required bound on
/// the least distance. The search evaluates nothing itself: the caller fetches nodes and returns answers.
class MotionSearch {
 public:
  /// A span that is evaluated next.
  struct Node {
    double begin = 0, end = 1;
    double at = -1;                   // the time of its evaluation: its middle, or that of a curve's length
    std::vector<std::uint64_t> open;  // positions of unproved pairs
    std::vector<double> low;          // lower bound for each of them throughout the span
    double least = 0;                 // minimum of `low`
    double pace[2] = {1, 1};          // CurveSides::pace(); 1 for straight motions
    bool has_steps = false;           // already counted as a step: evaluated in part
    bool seeds = false;               // one pair is evaluated before the others

    double half() const { return 0.5 * (end - begin); }
  };
  /// A pair that a node needs evaluated.
  struct PairRequest {
    std::uint32_t open = 0;  // index in Node::open
    double target = 0;       // metres: the pair leaves once this lower bound is proved throughout
    double way = 0;          // upper bound on the approach until the ends of the span, in metres
    double inner = 0;        // Slack::inner of the pair
    PairRates rates{};
    double rest = 0;  // MotionBounds::rest()
    PairGrowth growth{};
  };

  /// Poses and velocities of bodies at the time of a node.
  struct Moment {
    const BodyPoses& placed;
    std::span<const Twist> twists[2];  // of Plan::moved, for both sides
  };

  explicit MotionSearch(const MotionQuery& request) : motion_query_(request) {}

  /// Begins with another motion, `moving`.
  /// \param open the pairs that may be within their margins, and when; empty for all pairs and times
  void begin(std::span<const OpenPair> open);
  MovingBodies moving;

  bool is_done() const { return done_; }
  /// Fetches the most promising span. Returns false if there is none at present.
  bool next(Node& node);
  /// Appends the pairs to evaluate in a span, and their requests in the same order.
  void collect_pairs(Node& node, const Moment& moment, std::vector<PlacedBodies>& to_evaluate,
                     std::vector<PairRequest>& requests);
  /// Processes the answers to those requests. The node must not be used afterwards.
  void take(Node& node, const Moment& moment, std::span<const PairRequest> requests,
            std::span<const PairAnswer> answers);
  /// Requires is_done().
  void append_rows(std::vector<MotionRow>& rows) const;
  std::uint64_t evaluated() const { return evaluated_; }

 private:
  static constexpr std::uint64_t kNowhere = ~std::uint64_t{0};
  static constexpr double kInf = std::numeric_limits<double>::infinity();
  // The least lower bound of the pairs that have left the search, and its pair.
  struct Lowest {
    double low = kInf;
    std::uint64_t pair = kNowhere;
  };
  // State of a row, which concerns one pair or all pairs.
  struct Goal {
    Lowest lowest;             // over all pairs of the row
    Lowest lowest_of_contact;  // likewise, from the search for first contact; kNowhere if there was none
    double unproved = kInf;    // begin of the first span with an unproved margin
    MotionHit hit;             // the first time at which a pair is proved to be within its margin
    double time = std::numeric_limits<double>::quiet_NaN();  // of `best`
    std::uint64_t pair = kNowhere;                           // likewise
    PairAnswer best;                                         // answer with the least upper bound
    Vec3d origin_a{0, 0, 0}, origin_b{0, 0, 0};              // of its bodies
    double slack = 0;                                        // uncertainty of `best` alone
    std::uint64_t unusable = kNowhere;                       // the first pair without usable poses
    PairAnswer unusable_answer;
    bool decided = false;  // no further evaluation is needed
    bool forced = false;   // of the least distance: something left before it was proved

    double upper() const { return pair == kNowhere ? kInf : best.upper; }
  };

  // One side of a span, with the pairs that continue in it.
  struct Half {
    Node node;
    double proved = 0;               // time from the evaluation on for which all pairs are proved
    std::vector<double> proved_low;  // lower bound of each pair in that time
  };

  bool is_curved() const { return motion_query_.plan.query.control_points > 2; }
  bool any() const { return motion_query_.plan.query.reduce == Reduce::kAny; }
  /// Returns whether pairs are currently tested against their margins.
  bool decides() const { return any() || seeks_contact_; }
  bool wants_contact() const { return (motion_query_.plan.size.fields & kFieldFirstContact) != 0; }
  bool has_converged(const Goal& goal) const { return goal.decided && !seeks_contact_; }
  Goal& goal_of(std::uint64_t position) { return goals_[goals_.size() == 1 ? 0 : position]; }
  double target_of(std::uint64_t position, const Goal& goal, double slack) const;
  void leave(Goal& goal, std::uint64_t position, double low, double begin);
  void see(Goal& goal, std::uint64_t position, double time, const PairAnswer& answer, const BodyPoses& placed);
  double target_of_margin(std::uint64_t position, const Goal& goal, const Node& node, const Slack& slack) const;
  bool is_proved(double low, double target) const { return decides() ? low > target : low >= target; }
  void divide(const PairRequest& request, const PairAnswer& answer, const Moment& moment, const Node& node,
              Half (&halves)[2]);
  void push_rest(Half& half, double at);
  HalfSpans half_spans(BodyPair pair, const PairRequest& request, const Vec3d& n, double inner, const Moment& moment,
                       double reach, bool of_boxes) const;
  /// Length of either side in the units of its rates: time, or the progress of a curve.
  double reach_of(const Node& node) const { return is_curved() ? 1 : node.half(); }
  void open_all();
  void open_some(std::span<const OpenPair> open);
  bool seek_contact();
  bool may_request() const {
    return !spans_.empty() && (spans_[0].has_steps || steps_ < motion_query_.plan.query.max_evaluations);
  }
  std::size_t nearest_of(const Node& node, const BodyPoses& placed) const;
  bool leaves_by_boxes(std::size_t i, const Node& node, BodyPair pair, const BodyPoses& placed);
  bool leaves_along_boxes(const PairRequest& request, const Node& node, BodyPair pair, const Moment& moment);
  PairRequest request_for(std::size_t i, const Node& node, BodyPair pair, const BodyPoses& placed);
  void push(Node&& node);
  void give_up();
  void end_if_done();
  MotionRow row_of(const Goal& goal) const;
  const Lowest& lowest_of(const Goal& goal) const;
  void decide_any(const Goal& goal, Row& row) const;
  void decide_distance(const Goal& goal, Row& row) const;
  void take_unusable(const Goal& goal, Row& row) const;

  const MotionQuery& motion_query_;
  std::vector<Goal> goals_;
  std::vector<Node> spans_;     // a heap: the least `least` first, or the earliest span while contact is sought
  bool seeks_contact_ = false;  // only the time at which a pair is first within its margin is still unresolved
  std::size_t under_way_ = 0;
  std::vector<double> speeds_;  // of Plan::moved, at the current node
  std::uint32_t steps_ = 0;
  std::uint64_t evaluated_ = 0;
  bool seeded_ = false;  // one pair was evaluated before the others
  bool done_ = true;
};

}  // namespace clearance
