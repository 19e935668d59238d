// Motion data shared by host and device: how joints move the bodies of each pair, and the result of each motion.
#pragma once

#include <algorithm>

#include "engine/device/layout.h"
#include "engine/motion/motion_arrays.h"
#include "engine/motion/motion_step.h"

namespace clearance::cuda {

/// MotionArrays, in device memory.
struct MotionTables {
  const Mover* movers;
  const MotionChain* chains;
  const std::uint32_t* chain_of_slot;  ///< (moved,) from the world; kNone if nothing moves it
  const MotionViews* views;
  const std::uint32_t* views_of_pair;  ///< (pairs,); kNone if both bodies are described from the world
  const double* reach;                 ///< (bodies,) metres: bound on the distance of points from the origin
};

/// Part of a motion, evaluated at its middle. If the least distance is requested, both ends are evaluated too, as spans
/// of zero length.
struct MotionSpan {
  std::uint32_t motion;
  std::uint32_t late;  ///< nonzero if a pair within its margin here cannot be the first
  double begin, end;   ///< within the motion, 0 to 1
  double
      required_distance;  ///< metres: required distance of pairs over the whole span, by required_distance_for(); -inf if irrelevant

  CLEARANCE_HD double middle() const { return 0.5 * begin + 0.5 * end; }
  CLEARANCE_HD double half() const { return 0.5 * (end - begin); }
};
/// A pair in a span. If the pair goes on in half a span, `pair` is 2 * pair, plus 1 for the second half.
struct SpanPair {
  std::uint32_t span, pair;
};

/// A pair apart at the middle of a span, to be divided there.
struct ApartPair {
  SpanPair at;
  double lower;  ///< metres
  Vec3d normal;
};

/// Motion bounds of a span's moved bodies, in addition to their poses. Each component is contiguous over all spans.
enum MotionNumber : std::uint32_t {
  kOwnSpeed,
  kOwnAcceleration,
  kOwnDrift,
  kOwnTurn,
  kOwnShift = 6,
  kMotionNumbers = 9
};

/// A pair within its margin at some time, or the nearest pair found if the least distance is requested.
struct MotionHitRow {
  std::uint64_t key;  ///< hit_key(); the hit with the least key represents the motion
  std::uint32_t motion, pair;
  double time;
  Vec3d origin_a, origin_b;
  PairAnswer answer;
  // Nearest pair only:
  double slack;    ///< Slack::outer of the pair at that time
  double low;      ///< lower bound on the distance of all pairs over the whole motion
  double contact;  ///< if first contact is requested: time of a pair within its margin; inf if there is none
};
/// Result of a motion.
enum class MotionOutcome : std::uint8_t {
  kFree,  ///< no pair is within its margin
  kHit,   ///< a pair is, or the least distance is found; a MotionHitRow exists
  kOpen,  ///< left to the CPU
};

/// Indices into MotionsView::counts, per level: spans, pairs left by boxes, pairs evaluated, pairs that go on, hits,
/// pairs apart at the middle, pairs left by the kernel that only iterates.
inline constexpr std::uint32_t kSpanCount = 0, kNearCount = 1, kEvaluateCount = 2, kOnCount = 3, kHitCount = 4,
                               kApartCount = 5, kLaterCount = 6, kCountsOfLevel = 7;
/// Spans of level k are at most 2^-k of a motion; what remains after the last level is left to the CPU. First contact
/// needs more levels: a span is halved until it is as short as the contact interval, and half of it is proved.
inline constexpr std::uint32_t kMotionLevels = 8, kContactLevels = 12;
/// One more level if the least distance is requested: the first, which evaluates the ends.
inline constexpr std::uint32_t kMostLevels = 1 + kContactLevels;
/// After the counts of the levels: rows of hits, pairs resolved by the narrow phase.
inline constexpr std::uint32_t kHitRowCount = kCountsOfLevel * (kMostLevels + 1), kConvergedCount = kHitRowCount + 1,
                               kMotionCounts = kHitRowCount + 2;

/// Capacity of a chunk's lists at each level. Motions that do not fit are left to the CPU. A motion's pairs are spread
/// over a whole list, so if pairs do not fit, nearly all motions are affected: the capacity is therefore twice the
/// pairs of the first level, each of which may go on in both halves. Both ends of all motions are spans too
/// (begin_at_ends()).
struct MotionCapacity {
  static constexpr std::uint32_t kMoreSpans = 256, kHitsOfMotion = 4;
  static constexpr std::uint64_t kMostPairs = 1u << 23;

  std::uint32_t spans, pairs, hits, apart;

  MotionCapacity(std::uint32_t motions, std::uint32_t pairs_of_motion)
      : spans(2 * motions + kMoreSpans),
        pairs(static_cast<std::uint32_t>(
            std::min((2 * std::uint64_t{motions} + kMoreSpans) * pairs_of_motion, kMostPairs))),
        hits(kHitsOfMotion * motions + kMoreSpans),
        apart(pairs / 2) {}
};

/// One chunk of motions at one level.
struct MotionsView {
  ChunkView chunk;  ///< pairs in query order; its configurations are the spans, up to their capacity
  MovesView moves;  ///< at the middles of the spans
  MotionTables tables;
  const double* margins;  ///< (pairs,) metres; if null, all pairs have `margin`
  double margin;
  bool seeks_contact;  ///< finds the first time at which a pair is within its margin, not only whether one is
  bool finds_least;    ///< the least distance is requested, with these tolerances
  double abs_tol, rel_tol;
  std::uint32_t motions, level, levels;
  std::uint32_t span_capacity, pair_capacity, hit_capacity, apart_capacity;
  std::uint32_t max_evaluations;
  const double* ends;  ///< (motions, 2, joints)
  double* positions;   ///< (spans, joints) at their middles
  double* travels;     ///< (motions, robots) maximum over both ends
  double* twists;      ///< (frames, 6, spans) of links relative to their roots: turn, shift
  double* numbers;     ///< (moved, kMotionNumbers, spans)
  float* speeds;       ///< (moved, spans) metres per unit of time including the drift, rounded up
  // Per motion:
  std::uint64_t* hit;  ///< least hit_key(); all bits set if none
  std::uint32_t* steps;
  std::uint8_t *open, *to_cpu;  ///< a pair is unproved; the motion is left to the CPU regardless of other findings
  std::uint8_t* unresolved;     ///< if first contact is requested: the narrow phase left a pair unresolved at some time
  MotionOutcome* outcomes;
  std::uint64_t* low;   ///< if the least distance is requested: lower bound on skipped pairs, as the bits of a double
  std::uint64_t* seed;  ///< if the least distance is requested: (motions, 2) the pair with the nearest boxes
  std::uint32_t* lock;  ///< if the least distance is requested: guards `best`
  double* free_until;   ///< if first contact is requested: pairs are beyond their margins until then; inf if always
  // Of the spans of this level and of the next:
  MotionSpan *spans, *next_spans;
  std::uint32_t* shares;                    ///< (spans, 2) proved share of each half, float bits; all set if complete
  std::uint32_t *children, *next_children;  ///< (spans, 2) index of each half at the next level, or kNone
  SpanPair *on, *next_on;                   ///< pairs that go on
  SpanPair *near, *to_evaluate;             ///< `near` becomes the list of pairs left by the kernel that only iterates
  float* ways;       ///< (pairs,) metres: approach of a pair to evaluate until the ends, rounded up
  ApartPair* apart;  ///< up to apart_capacity
  MotionHitRow* hits;
  // Of motions that hit: the best hit so far, then these rows in no order.
  MotionHitRow *best, *hit_rows;
  std::uint32_t* counts;
};

/// Number of levels.
inline std::uint32_t levels_of(const MotionsView& m) {
  return (m.finds_least ? 1 : 0) + (m.seeks_contact ? kContactLevels : kMotionLevels);
}

}  // namespace clearance::cuda
