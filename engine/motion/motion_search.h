// One motion, divided until each pair is proved far enough away all along, or found near at some time.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "engine/evaluate/evaluate.h"
#include "engine/motion/half_spans.h"
#include "engine/motion/motion_bounds.h"
#include "engine/selection/columns.h"

namespace clearance {

/// When a pair is proved to be within its margin.
struct MotionHit {
  double time = std::numeric_limits<double>::infinity();  // 0 to 1; inf: never
  std::uint64_t position = 0;                             // of the pair in the plan
  std::uint32_t piece_a = 0, piece_b = 0;                 // the nearest of its bodies then
};

/// A row of a motion.
struct MotionRow {
  Row row;
  double time = std::numeric_limits<double>::quiet_NaN();
  double found = std::numeric_limits<double>::quiet_NaN();  // when the upper bound was found, whatever the row says
  double free_until = 0;                                    // nothing is within its margin before; inf: all along
  MotionHit hit;                                            // the first that was found
  std::uint32_t steps = 0;
};

/// Writes it as a row of a reply.
void write_motion_row(const ReplyView& reply, std::uint64_t at, const MotionRow& row);

/// Makes the answer with the least upper bound that of the least distance. \param low no pair is nearer all along.
/// \param forced the search was ended before it was done
void decide_least(const QueryView& query, double low, bool forced, PairAnswer& answer);

/// What every search of a query shares. All must outlive it.
struct MotionQuery {
  const Scene& scene;
  const Plan& plan;
  const MotionBounds& bounds;
};

/// The search for one motion's rows: a tree of spans of time, each looked at in its middle. A pair leaves where what it
/// can move until the span's ends cannot bring it as near as is asked: its margin (Reduce::kAny), or what is to be
/// known of the least distance. It never asks anything itself: nodes come out, answers come in.
class MotionSearch {
 public:
  /// A span whose middle is looked at next.
  struct Node {
    double begin, end;
    std::vector<std::uint64_t> open;  // positions of pairs that are not proved
    std::vector<double> low;          // of each of them: no nearer all along
    double least = 0;                 // of `low`
    bool has_steps = false;           // it was looked at in part, and counts no more
    bool seeds = false;               // one pair is asked before the others

    double middle() const { return 0.5 * begin + 0.5 * end; }
    double half() const { return 0.5 * (end - begin); }
  };
  /// A pair that a node asks for.
  struct PairRequest {
    std::uint32_t open;  // of Node::open
    double target;       // metres: it leaves where it is proved to be no nearer all along
    double way;          // metres that it can come nearer until the ends, at most
    double inner;        // Slack::inner of the pair
    PairRates rates;
  };

  /// Where bodies are in the middle of a span, and how fast they move there.
  struct Moment {
    const BodyPoses& placed;
    std::span<const Twist> twists;  // of Plan::moved
  };

  explicit MotionSearch(const MotionQuery& request) : motion_query_(request) {}

  /// Begins with another motion, `moving`.
  void begin();
  MovingBodies moving;

  bool is_done() const { return done_; }
  /// The most promising span; false: there is none for now.
  bool next(Node& node);
  /// What it asks for in its middle. Appends to both in the same order.
  void ask(Node& node, const Moment& moment, std::vector<PlacedBodies>& asked, std::vector<PairRequest>& requests);
  /// The answers to that. The node is spent then.
  void take(Node& node, const Moment& moment, std::span<const PairRequest> requests,
            std::span<const PairAnswer> answers);
  /// Once is_done().
  void append_rows(std::vector<MotionRow>& rows) const;
  std::uint64_t evaluated() const { return evaluated_; }

 private:
  static constexpr std::uint64_t kNowhere = ~std::uint64_t{0};
  static constexpr double kInf = std::numeric_limits<double>::infinity();
  // The least lower bound of what has left the search, and its pair.
  struct Lowest {
    double low = kInf;
    std::uint64_t pair = kNowhere;
  };
  // What a row is about: all pairs, or one.
  struct Goal {
    Lowest lowest;             // no pair is nearer
    Lowest lowest_of_contact;  // likewise, by the search for first contact; nowhere: it had no need of one
    double unproved = kInf;    // begin of the first span of which no margin is proved
    MotionHit hit;             // the first time at which a pair is proved to be within its margin
    double time = std::numeric_limits<double>::quiet_NaN();  // of `best`
    std::uint64_t pair = kNowhere;                           // likewise
    PairAnswer best;                                         // of the least upper bound
    Vec3d origin_a{0, 0, 0}, origin_b{0, 0, 0};              // of its bodies
    double slack = 0;                                        // what is not known of `best` alone
    std::uint64_t unusable = kNowhere;                       // the first pair without usable poses
    PairAnswer unusable_answer;
    bool decided = false;  // nothing more is asked
    bool forced = false;   // of the least distance: something left before it was proved

    double upper() const { return pair == kNowhere ? kInf : best.upper; }
  };

  // Half a span, with the pairs that go on in it.
  struct Half {
    Node node;
    double proved = 0;               // of it, from the middle on: all pairs are
    std::vector<double> proved_low;  // of each pair: no nearer there
  };

  bool any() const { return motion_query_.plan.query.reduce == Reduce::kAny; }
  /// Whether pairs are tested against their margins now.
  bool decides() const { return any() || seeks_contact_; }
  bool wants_contact() const { return (motion_query_.plan.size.fields & kFieldFirstContact) != 0; }
  bool has_converged(const Goal& goal) const { return goal.decided && !seeks_contact_; }
  Goal& goal_of(std::uint64_t position) { return goals_[goals_.size() == 1 ? 0 : position]; }
  double target_of(std::uint64_t position, const Goal& goal, double slack) const;
  void leave(Goal& goal, std::uint64_t position, double low, double begin);
  void see(Goal& goal, std::uint64_t position, double time, const PairAnswer& answer, const BodyPoses& placed);
  bool is_proved(std::uint64_t position, const Goal& goal, double low, double slack) const;
  void divide(const PairRequest& asked, const PairAnswer& answer, const Moment& moment, const Node& node,
              Half (&halves)[2]);
  void push_rest(Half& half, double middle);
  HalfSpans half_spans(BodyPair pair, const PairRates& rates, const Vec3d& n, double inner, const Moment& moment,
                       double half, bool of_boxes) const;
  void open_all();
  bool seek_contact();
  bool may_ask() const {
    return !spans_.empty() && (spans_[0].has_steps || steps_ < motion_query_.plan.query.max_steps);
  }
  std::size_t nearest_of(const Node& node, const BodyPoses& placed) const;
  bool leaves_by_boxes(std::size_t i, const Node& node, BodyPair pair, const BodyPoses& placed);
  bool leaves_along_boxes(const PairRequest& asked, const Node& node, BodyPair pair, const Moment& moment);
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
  std::vector<Node> spans_;     // a heap: that of the least `least` first, or the earliest where contact is sought
  bool seeks_contact_ = false;  // what is left to find is when a pair first is within its margin
  std::size_t under_way_ = 0;
  std::vector<double> speeds_;  // of Plan::moved, at the node that asks
  std::uint32_t steps_ = 0;
  std::uint64_t evaluated_ = 0;
  bool seeded_ = false;  // one pair was asked before the others
  bool done_ = true;
};

}  // namespace clearance
