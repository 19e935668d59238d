// Least distance of two bodies of several convex parts: the selection and order of their part pairs, and the bodies'
// bounds. For host and device.
//
// Part pairs are taken nearest boxes first, in rounds of 1, 2, 4, ... All pairs of a round have the same cut-off, so
// that they can be answered in parallel, and are taken in their order: an answer depends on the two bodies alone, not
// on the rest of the query.
#pragma once

#include <cstddef>
#include <cstdint>

#include "engine/hull/box.h"
#include "engine/narrow/certify.h"
#include "wire/types.h"

namespace clearance {

/// A part of each of two bodies, and a lower bound on the distance of their boxes.
struct PartPair {
  double gap;
  std::uint32_t a, b;
};
/// The order in which they are taken.
CLEARANCE_HD inline bool goes_before(const PartPair& p, const PartPair& q) {
  if (p.gap != q.gap) return p.gap < q.gap;
  return p.a != q.a ? p.a < q.a : p.b < q.b;
}

/// State of the search over two bodies' part pairs.
struct PartSearch {
  double lower = __builtin_inf();  ///< least of the pairs taken, and the gap of those left out
  double upper = __builtin_inf();  ///< least of the pairs taken
  std::size_t round = 1;           ///< number of pairs answered in parallel

  /// Distance beyond which a pair of the next round need not be refined, since a pair that is farther than an upper
  /// bound is not the nearest.
  CLEARANCE_HD double cut_off(double max_distance) const {
    const double least = upper < 0 ? 0 : upper;
    return least < max_distance ? least : max_distance;
  }
  /// Whether a pair belongs to a round with this cut-off. If not, nor do those after it.
  CLEARANCE_HD bool belongs_to_round(double gap, double cut_off) const { return round == 1 || !(gap > cut_off); }
  /// Whether a pair and all after it are farther than one that was taken.
  CLEARANCE_HD bool ends_before(double gap) const { return gap > 0 && gap > upper; }
  /// Ends the search: the boxes of this pair and all after it are at least this far apart.
  CLEARANCE_HD void leave_out(double gap) { lower = gap < lower ? gap : lower; }
  /// Takes a pair's bounds. Returns whether it is the nearest so far.
  CLEARANCE_HD bool take(double gap, double pair_lower, double pair_upper) {
    lower = pair_lower < lower ? pair_lower : lower;
    if (!(pair_upper < upper || gap == __builtin_inf())) return false;
    upper = pair_upper;
    return true;
  }
};

/// The next few part pairs in their order, found without a list of all.
/// \tparam kCount number of pairs found at a time
/// \tparam BoxesA,BoxesB return the Aabb of each part, as `boxes_a(i)` and `boxes_b(j)`
template <int kCount, class BoxesA, class BoxesB>
class NearestConvexParts {
 public:
  CLEARANCE_HD NearestConvexParts(const BoxesA& boxes_a, std::uint32_t count_a, const BoxesB& boxes_b,
                                  std::uint32_t count_b)
      : boxes_a_(boxes_a),
        boxes_b_(boxes_b),
        count_a_(count_a),
        count_b_(count_b),
        left_(std::uint64_t{count_a} * count_b) {}

  /// False if there are no more.
  CLEARANCE_HD bool next(PartPair& pair) {
    if (left_ == 0) return false;
    if (at_ == kCount) find();
    pair = found_[at_++];
    --left_;
    return true;
  }

 private:
  // Finds the pairs that come after the last one found before. No gap is NaN: that marks an empty place.
  CLEARANCE_HD void find() {
    PartPair near[kCount];  // where a GPU can keep it in registers
    CLEARANCE_UNROLL
    for (int i = 0; i < kCount; ++i) near[i] = {__builtin_nan(""), kNone, kNone};
    const bool is_first = !begun_;
    const PartPair last = found_[kCount - 1];
    for (std::uint32_t a = 0; a < count_a_; ++a) {
      const Aabb box = boxes_a_(a);
      for (std::uint32_t b = 0; b < count_b_; ++b) {
        const PartPair p{certify_box_gap(box, boxes_b_(b)), a, b};
        if (!(near[kCount - 1].gap <= p.gap) && (is_first || goes_before(last, p))) insert(p, near);
      }
    }
    CLEARANCE_UNROLL
    for (int i = 0; i < kCount; ++i) found_[i] = near[i];
    at_ = 0;
    begun_ = true;
  }
  // Among equal gaps it comes last, so that only gaps need to be compared.
  CLEARANCE_HD static void insert(const PartPair& p, PartPair (&near)[kCount]) {
    CLEARANCE_UNROLL
    for (int i = kCount - 1; i > 0; --i)
      near[i] = !(near[i - 1].gap <= p.gap) ? near[i - 1] : near[i].gap <= p.gap ? near[i] : p;
    if (!(near[0].gap <= p.gap)) near[0] = p;
  }

  const BoxesA& boxes_a_;
  const BoxesB& boxes_b_;
  std::uint32_t count_a_, count_b_;
  std::uint64_t left_;
  PartPair found_[kCount]{};
  int at_ = kCount;  // in found_
  bool begun_ = false;
};

/// Result of a part pair.
enum class PartEnd { kApart, kOverlap, kOpen };

/// Runs a search to its end, one part pair after another.
/// \param evaluate answers one pair with this cut-off: kApart if the search has taken it; kOverlap if an overlap is
/// proved, which ends the search without depth; kOpen if it is unresolved, which also ends it
/// \param stop_below upper bound that is low enough to stop
template <class Nearest, class Evaluate>
CLEARANCE_HD inline PartEnd search_parts(PartSearch& search, double max_distance, Nearest& nearest,
                                         const Evaluate& evaluate, double stop_below = -__builtin_inf()) {
  PartPair p;
  bool there = nearest.next(p);
  while (there) {
    const double cut_off = search.cut_off(max_distance);
    std::size_t answered = 0;
    for (; there && answered < search.round && search.belongs_to_round(p.gap, cut_off); ++answered) {
      if (search.ends_before(p.gap)) {
        search.leave_out(p.gap);
        return PartEnd::kApart;
      }
      if (const PartEnd end = evaluate(p, cut_off); end != PartEnd::kApart) return end;
      const double gap = p.gap;
      there = nearest.next(p);
      if (search.upper <= stop_below && there && !(p.gap > max_distance)) {
        search.leave_out(gap);
        return PartEnd::kApart;
      }
    }
    if (there && answered == 0) {
      search.leave_out(p.gap);
      return PartEnd::kApart;
    }
    search.round *= 2;
  }
  return PartEnd::kApart;
}

}  // namespace clearance
