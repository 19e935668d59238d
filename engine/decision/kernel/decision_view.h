// Input and output of the kernel of decisions, as plain arrays.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/cover/cover.h"
#include "engine/cover/obstacle.h"
#include "engine/joint_table/joint_table.h"
#include "engine/pose/pose.h"
#include "wire/types.h"

namespace clearance {

/// What covers prove of a pair or of a state.
enum class Verdict : std::uint8_t {
  kFree,        ///< every pair is beyond its margin
  kHit,         ///< a pair is within its margin
  kUnresolved,  ///< neither: see the open pairs
};

/// A moved body. Bodies without a cover only carry others.
struct DecidedBody {
  const BallPacket* packets;   ///< of the cover; null without one
  std::uint32_t root_packets;  ///< number of packets of the root's children, 0 to 2
  std::uint32_t pose;          ///< index of its pose in a configuration, or kNone: it stays at `constant`
  std::uint32_t carrier;       ///< index of the body that it follows, which comes before it, or kNone
  bool is_direct;              ///< no carrier, and `constant` is the identity
  Pose constant;               ///< with a pose: of the frame that the pose refers to, before it; otherwise its own
  double farthest;             ///< metres: the bounds hold up to this distance of its origin
};

inline constexpr std::uint32_t kColumns = 16;  ///< columns of bodies are a multiple of this

/// Two moved bodies with covers.
struct MovedPair {
  std::uint32_t a, b;
  std::uint64_t position;  ///< in the plan
  float grow, shrink;      ///< as in DecisionView
  std::uint8_t table;      ///< index in DecisionView::tabled, or kNoTable
};

/// Pairs of one moved body with kColumns others, side by side.
struct MovedRow {
  std::uint32_t a, begin;  ///< the body; column of the first of the others
  float reach[kColumns];   ///< the roots are beyond their margin if their centres are farther than this from each other
  std::uint32_t pair[kColumns];  ///< index of the moved pair, or kNone
};

/// A pair of links of one robot with a joint table.
struct TabledPair {
  TableCells table;
  std::uint32_t at[2];  ///< index of the column in a row of positions, or kNone: it stays at `fixed`
  double fixed[2];
  std::int32_t free_above, hit_below;  ///< the pair is beyond its margin if TableCell::low exceeds `free_above`, and
                                       ///< within its margin if `high` is less than `hit_below`
  std::uint64_t position;              ///< in the plan

  /// Position of a column of the table, from a row of positions.
  CLEARANCE_TABLE_INLINE double position_of(int c, const double* positions) const {
    return at[c] == kNone ? fixed[c] : positions[at[c]];
  }
  /// The cell of a row of positions, or null outside the table. It begins to arrive from memory.
  CLEARANCE_TABLE_INLINE const TableCell* find(const double* positions) const {
    const double both[2] = {position_of(0, positions), position_of(1, positions)};
    const TableCell* const cell = table.find(both);
    __builtin_prefetch(cell);
    return cell;
  }
};
inline constexpr std::uint32_t kMostTabledPairs = 64;
inline constexpr std::uint8_t kNoTable = 255;

/// A node of the tree of obstacles, in depth-first order.
struct ObstacleNode {
  std::array<float, 3> at;    ///< in the common frame
  std::uint32_t first, last;  ///< obstacles of a leaf; empty for other nodes
  std::uint32_t skip;         ///< the next node that is not below
};

/// A box in the common frame that holds an obstacle's core, or the centre of a ball that does.
struct ObstacleBox {
  std::array<float, 3> at, half;
};

/// Constants of a query. Bodies are in columns of a multiple of kColumns; `grow` and `shrink`, by (obstacle, body), are
/// added to a ball's outer and inner radius: a pair is beyond its margin if an obstacle's gap exceeds outer + grow for every
/// ball of a complete cut, and within its margin if a gap is below inner + shrink for one ball.
struct DecisionView {
  const DecidedBody* bodies;
  std::uint32_t body_count, columns;
  const float *root_x, *root_y, *root_z;             ///< (columns,) centres of the roots, in the bodies' frames
  const float *moved_root_outer, *moved_root_inner;  ///< (columns,)
  const Obstacle* obstacles;
  std::uint32_t obstacle_count;
  const ObstacleBox* boxes;  ///< of the obstacles
  const float* box_reach;    ///< (obstacles, columns) the root is beyond its margin from the obstacle if its
                             ///< centre is farther than this from the box; infinite for unbounded ones
  const float *root_outer, *root_inner;  ///< (obstacles, columns) with grow and shrink
  const float *grow, *shrink;            ///< (obstacles, columns)
  const std::uint64_t* position;         ///< (obstacles, columns) of the pair in the plan
  const MovedPair* moved_pairs;
  const std::int32_t *moved_a, *moved_b;  ///< (moved_pairs,) and more, up to a multiple of 8: their bodies
  const float* moved_reach;               ///< likewise: their roots' outer radii with grow
  std::uint32_t moved_pair_count;
  const MovedRow* moved_rows;  ///< every moved pair is in one
  std::uint32_t moved_row_count;
  const std::uint8_t* table;  ///< (obstacles, columns) index in `tabled`, or kNoTable
  const TabledPair* tabled;
  std::uint32_t tabled_count;  ///< up to kMostTabledPairs
  const ObstacleNode* nodes;   ///< every obstacle is in one leaf
  std::uint32_t node_count;
  const float*
      node_bound;  ///< (nodes, columns) the root is beyond its margin from the obstacles below if its centre is
                   ///< farther than this from the node
};
inline constexpr std::uint32_t kMostDecidedBodies = 64;

/// States to decide.
struct DecisionBatch {
  const DecisionView* view;
  const Pose* poses;  ///< (states, stride)
  std::size_t stride, states;
  const std::uint8_t* usable;  ///< (states,) 0 if the bounds do not hold; unresolved, without a list of open pairs
  bool any_hit;                ///< one pair within its margin suffices; otherwise the first one is requested
  const double* positions = nullptr;  ///< (states, position_stride) of joints; null to use no tables
  std::size_t position_stride = 0;
  /// (body_count,) of each body, (7, 8) qw, qx, qy, qz, x, y, z in up to 8 states, if all bodies are direct
  /// (DecidedBody::is_direct); null to use `poses`.
  const double* const* frames = nullptr;
  const TableCell* const* cells = nullptr;  ///< (states, tabled_count) TabledPair::find(); null to find them here
};

/// Result of one state. The open pairs are those before the first hit, ascending but with repeats.
struct Decision {
  Verdict verdict = Verdict::kUnresolved;
  bool is_listed = false;  ///< whether the open pairs are listed; if not, every pair is open
  std::uint64_t hit = 0;   ///< position of the first pair found within its margin, if kHit
  std::uint32_t open_begin = 0, open_end = 0;
};

/// Receives decisions and open pairs: arrays that the caller owns.
struct DecisionRoom {
  Decision* decisions;     ///< (states,)
  std::uint64_t* open;     ///< positions
  std::uint32_t capacity;  ///< of `open`, at least the pairs of one state for each state
};

/// Velocity of a body in the middle of a span of time, multiplied by half its length: metres until its ends. In the
/// axes of the common frame.
struct SpanTwist {
  float turn[3], shift[3];  ///< radians; of the body's origin
};
/// Movement of a body within half a span: a point r from its origin moves at most the lesser of `way` and
/// |shift + turn x r| + bend. Metres.
struct SpanBody {
  SpanTwist twist;
  float way, bend;
  float grown = 0;  ///< lower bound on the body's growth in the middle
};
/// The same for two moved bodies, relative to a reference body: they come nearer by at most the lesser of `way` and the
/// sum for both twists.
struct PairSpan {
  SpanTwist a, b;
  float way, bend;
  float grown;  ///< lower bound on the sum of their growths in the middle
};
/// An obstacle and a body, or, if `obstacle` is kNone, an index of DecisionView::moved_pairs.
struct SpanItem {
  std::uint32_t obstacle, at;
  bool is_near = false;  ///< of an open item: the balls are too coarse for it even in the middle
};

/// A span of a motion to decide: some of its pairs, or all of them.
struct SpanInput {
  const SpanItem* items;  ///< null for all pairs
  std::size_t count;
};
struct SpanDecision;

/// Spans of one motion, of the same length: whether all pairs of one are beyond their margins throughout, or one is
/// within its margin in the middle, with the growth of its bodies. They are decided in order.
struct SpanBatch {
  const DecisionView* view;
  const SpanInput* spans;
  std::size_t count;       ///< up to 8
  const SpanBody* bodies;  ///< (columns,); with `frames`, of all spans and without twists
  /// As in DecisionBatch, in the middles of the spans; null to use `poses`.
  const double* const* frames;
  const double* const* twists;  ///< with `frames`: (body_count,) of each body, (6, 8) turn and shift per unit of time
  double half;                  ///< of that time, until a span's ends
  const Pose* poses;            ///< in the middle of the only span; null to use `frames`
  /// Of a moved pair in a span.
  PairSpan (*pair)(void* context, std::size_t span, std::uint32_t moved_pair);
  /// Takes the decision on a span. Returns false to leave out the rest.
  bool (*decided)(void* context, std::size_t span, const SpanDecision& decision);
  void* context;
  SpanItem* open;  ///< receives the items that a span leaves open, in order, until decided() returns
  std::size_t capacity;
  const std::uint8_t* is_left = nullptr;  ///< (moved_pairs,) whether a pair is not to be decided: open, and near
  const double* positions = nullptr;      ///< (count, position_stride) of joints in the middles; null to use no tables
  std::size_t position_stride = 0;
  const double* reach = nullptr;  ///< change of each position until the spans' ends, >= 0
};
/// A ball of a moved body inside an obstacle.
struct BallHit {
  std::uint32_t obstacle = kNone, body = 0, packet = 0, ball = 0;
  bool operator==(const BallHit&) const = default;
};
struct SpanDecision {
  Verdict verdict = Verdict::kUnresolved;
  std::size_t open = 0;  ///< number of items left open; 0 if the span could not be decided at all
  BallHit hit;           ///< of kHit by a ball; without an obstacle for other hits
};

/// Balls that were inside obstacles in other motions, to be tried in some states.
struct HitGuess {
  const DecisionView* view;
  const double* const* frames;    ///< as in DecisionBatch
  std::size_t states;             ///< up to 8
  std::span<const BallHit> hits;  ///< of bodies with a pose of their own (DecidedBody::is_direct)
};
/// The first ball that is inside its obstacle again, and the state.
struct GuessedHit {
  const BallHit* hit = nullptr;
  std::size_t state = 0;
};

/// One version of the kernel; all give the same results.
struct DecisionKernel {
  const char* name;  ///< "avx512", "avx2", "baseline"
  void (*run)(const DecisionBatch&, const DecisionRoom&);
  void (*run_spans)(const SpanBatch&);
  GuessedHit (*guess_hit)(const HitGuess&);
};
/// The versions that this machine can run, the fastest first.
std::span<const DecisionKernel> decision_kernels();

}  // namespace clearance
