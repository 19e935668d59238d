// What host and device share of motions: how the joints move the bodies of each pair, and what is found of each motion.
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
  const std::uint32_t* chain_of_slot;  ///< (moved,) from the world; kNone: nothing moves it
  const MotionViews* views;
  const std::uint32_t* views_of_pair;  ///< (pairs,); kNone: both are seen from the world
  const double* reach;                 ///< (bodies,) metres: no point of a body is farther from its origin
};

/// A part of a motion that is looked at in its middle. Of its least distance it is asked at its ends, too: spans
/// without length.
struct MotionSpan {
  std::uint32_t motion;
  std::uint32_t late;  ///< not 0: nothing that is within its margin here is the first
  double begin, end;   ///< of it, 0 to 1
  double enough;       ///< metres: so far pairs have to be all along by enough_for(); -inf: it does not matter

  CLEARANCE_HD double middle() const { return 0.5 * begin + 0.5 * end; }
  CLEARANCE_HD double half() const { return 0.5 * (end - begin); }
};
/// A pair in a span; of those that go on in half a span, 2 pair + 1 for the second half.
struct SpanPair {
  std::uint32_t span, pair;
};

/// What is known of a span's moved bodies beside where they are, each component for all spans side by side.
enum MotionNumber : std::uint32_t {
  kOwnSpeed,
  kOwnAcceleration,
  kOwnDrift,
  kOwnTurn,
  kOwnShift = 6,
  kMotionNumbers = 9
};

/// A pair that is within its margin at a time; or the nearest that was found, where the least distance is asked for.
struct MotionHitRow {
  std::uint64_t key;  ///< hit_key(): the least of a motion stands for it
  std::uint32_t motion, pair;
  double time;
  Vec3d origin_a, origin_b;
  PairAnswer answer;
  // Of the nearest alone:
  double slack;    ///< Slack::outer of the pair then
  double low;      ///< no pair is nearer all along
  double contact;  ///< where first contact is sought: a pair is within its margin then; inf: none is
};
/// What became of a motion.
enum class MotionVerdict : std::uint8_t {
  kFree,  ///< no pair is within its margin
  kHit,   ///< one is, or the least distance is known: there is a MotionHitRow
  kOpen,  ///< the CPU has to look
};

/// Places in MotionsView::counts: of each level spans, pairs that boxes leave, pairs that are asked, pairs that go on,
/// hits that were found.
inline constexpr std::uint32_t kSpanCount = 0, kNearCount = 1, kAskedCount = 2, kOnCount = 3, kHitCount = 4,
                               kCountsOfLevel = 5;
/// Levels: spans of the k-th are at most 2^-k of a motion. What is left then is the CPU's. Where first contact is
/// sought there are more, since a span goes on until it is as short as contact is narrowed to, and half of it is
/// proved.
inline constexpr std::uint32_t kMotionLevels = 8, kContactLevels = 12;
/// Where the least distance is asked for there is one more, the first, which looks at the ends.
inline constexpr std::uint32_t kMostLevels = 1 + kContactLevels;
/// Behind those of the levels: rows of hits, pairs that the narrow phase settled.
inline constexpr std::uint32_t kHitRowCount = kCountsOfLevel * (kMostLevels + 1), kConvergedCount = kHitRowCount + 1,
                               kMotionCounts = kHitRowCount + 2;

/// For how much a chunk's lists have room, at each level. What does not fit makes motions the CPU's: nearly all of them
/// where pairs do not fit, since a motion's pairs lie all over a list. So there is room for twice as many as the first
/// level has: each may go on in both halves. Both ends of all motions are spans, too (begin_at_ends()).
struct MotionRoom {
  static constexpr std::uint32_t kMoreSpans = 256, kHitsOfMotion = 4;
  static constexpr std::uint64_t kMostPairs = 1u << 23;

  std::uint32_t spans, pairs, hits;

  MotionRoom(std::uint32_t motions, std::uint32_t pairs_of_motion)
      : spans(2 * motions + kMoreSpans),
        pairs(static_cast<std::uint32_t>(
            std::min((2 * std::uint64_t{motions} + kMoreSpans) * pairs_of_motion, kMostPairs))),
        hits(kHitsOfMotion * motions + kMoreSpans) {}
};

/// One chunk of motions at one level.
struct MotionsView {
  ChunkView chunk;  ///< pairs in the query's order; its configurations are the spans that there is room for
  MovesView moves;  ///< of the spans' middles
  MotionTables tables;
  const double* margins;  ///< (pairs,) metres; null: each has `margin`
  double margin;
  bool seeks_contact;  ///< not only whether pairs are within their margins, but when one first is
  bool finds_least;    ///< the least distance is asked for, within these tolerances
  double abs_tol, rel_tol;
  std::uint32_t motions, level, levels;
  std::uint32_t span_capacity, pair_capacity, hit_capacity;
  std::uint32_t max_steps;
  const double* ends;  ///< (motions, 2, joints)
  double* positions;   ///< (spans, joints) in their middles
  double* travels;     ///< (motions, robots) the largest of both ends
  double* twists;      ///< (frames, 6, spans) of links before their roots: turn, shift
  double* numbers;     ///< (moved, kMotionNumbers, spans)
  float* speeds;       ///< (moved, spans) metres in a unit of time, rounded up, with the drift
  // Of each motion:
  std::uint64_t* hit;  ///< the least hit_key(); all bits set: none
  std::uint32_t* steps;
  std::uint8_t *open, *to_cpu;  ///< something is not proved; the CPU has to look whatever else is found
  std::uint8_t* unresolved;     ///< where first contact is sought: the narrow phase leaves a pair open at some time
  MotionVerdict* verdicts;
  std::uint64_t* low;   ///< where the least distance is asked for: of what was left out; a double's bits
  std::uint64_t* seed;  ///< likewise, (motions, 2): the pair whose boxes are nearest at each end
  std::uint32_t* lock;  ///< likewise: of `best`
  double* free_until;   ///< where first contact is sought: all pairs are beyond their margins before; inf: all along
  // Of this level's spans and of the next level's:
  MotionSpan *spans, *next_spans;
  std::uint32_t* shares;                    ///< (spans, 2) of each half proved so far, float bits; all set: wholly
  std::uint32_t *children, *next_children;  ///< (spans, 2) where it goes on at the next level; kNone: it does not
  SpanPair *on, *next_on;                   ///< pairs that go on
  SpanPair *near, *asked;
  MotionHitRow* hits;
  // Of motions that hit: the hit that stands for each so far; these rows in no order.
  MotionHitRow *best, *hit_rows;
  std::uint32_t* counts;
};

/// How many levels there are.
inline std::uint32_t levels_of(const MotionsView& m) {
  return (m.finds_least ? 1 : 0) + (m.seeks_contact ? kContactLevels : kMotionLevels);
}

}  // namespace clearance::cuda
