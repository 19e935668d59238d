// The least distance of two bodies of several pieces: which of their piece pairs are looked at, in which order, and
// what the bounds found make of the bodies' answer. For host and device.
//
// Piece pairs are taken nearest boxes first, in rounds of 1, 2, 4, ... The pairs of a round are answered with the same
// cut-off, so that they can be answered side by side, and taken in their order: an answer depends on the two bodies
// alone, whatever else is asked.
#pragma once

#include <cstddef>
#include <cstdint>

#include "engine/hull/box.h"
#include "engine/narrow/certify.h"
#include "wire/types.h"

namespace clearance {

/// A piece of each of two bodies, and how far apart their boxes are at least.
struct PiecePair {
  double gap;
  std::uint32_t a, b;
};
/// The order in which they are taken.
CLEARANCE_HD inline bool goes_before(const PiecePair& p, const PiecePair& q) {
  if (p.gap != q.gap) return p.gap < q.gap;
  return p.a != q.a ? p.a < q.a : p.b < q.b;
}

/// What is known of two bodies while their piece pairs are taken.
struct PieceSearch {
  double lower = __builtin_inf();  ///< the least of the pairs taken, and the gap of those left out
  double upper = __builtin_inf();  ///< the least of the pairs taken
  std::size_t round = 1;           ///< how many are answered side by side

  /// Beyond which a pair of the next round need not be refined: one that is proved farther than an upper bound is not
  /// the least.
  CLEARANCE_HD double cut_off(double max_distance) const {
    const double least = upper < 0 ? 0 : upper;
    return least < max_distance ? least : max_distance;
  }
  /// Whether a pair belongs to a round with this cut-off; else neither do those after it.
  CLEARANCE_HD bool asks(double gap, double cut_off) const { return round == 1 || !(gap > cut_off); }
  /// Whether a pair and all after it are farther than one that was taken.
  CLEARANCE_HD bool ends_before(double gap) const { return gap > 0 && gap > upper; }
  /// The search ends: this pair and all after it have boxes at least so far apart.
  CLEARANCE_HD void leave_out(double gap) { lower = gap < lower ? gap : lower; }
  /// Takes a pair's bounds. Returns whether it is the nearest so far.
  CLEARANCE_HD bool take(double gap, double pair_lower, double pair_upper) {
    lower = pair_lower < lower ? pair_lower : lower;
    if (!(pair_upper < upper || gap == __builtin_inf())) return false;
    upper = pair_upper;
    return true;
  }
};

/// The next few piece pairs in their order, found without a list of all. \tparam kCount how many at a time.
/// `boxes_a(i)`, `boxes_b(j)`: the Aabb of each piece.
template <int kCount, class BoxesA, class BoxesB>
class NearestPieces {
 public:
  CLEARANCE_HD NearestPieces(const BoxesA& boxes_a, std::uint32_t count_a, const BoxesB& boxes_b, std::uint32_t count_b)
      : boxes_a_(boxes_a),
        boxes_b_(boxes_b),
        count_a_(count_a),
        count_b_(count_b),
        left_(std::uint64_t{count_a} * count_b) {}

  /// False: there are no more.
  CLEARANCE_HD bool next(PiecePair& pair) {
    if (left_ == 0) return false;
    if (at_ == kCount) find();
    pair = found_[at_++];
    --left_;
    return true;
  }

 private:
  // Those that come next after the last of what was found before. No gap is NaN: that stands for none.
  CLEARANCE_HD void find() {
    PiecePair near[kCount];  // where a GPU can keep it in registers
    CLEARANCE_UNROLL
    for (int i = 0; i < kCount; ++i) near[i] = {__builtin_nan(""), kNone, kNone};
    const bool is_first = !begun_;
    const PiecePair last = found_[kCount - 1];
    for (std::uint32_t a = 0; a < count_a_; ++a) {
      const Aabb box = boxes_a_(a);
      for (std::uint32_t b = 0; b < count_b_; ++b) {
        const PiecePair p{certify_box_gap(box, boxes_b_(b)), a, b};
        if (!(near[kCount - 1].gap <= p.gap) && (is_first || goes_before(last, p))) insert(p, near);
      }
    }
    CLEARANCE_UNROLL
    for (int i = 0; i < kCount; ++i) found_[i] = near[i];
    at_ = 0;
    begun_ = true;
  }
  // Of those with the same gap it comes last, so that gaps alone need to be compared.
  CLEARANCE_HD static void insert(const PiecePair& p, PiecePair (&near)[kCount]) {
    CLEARANCE_UNROLL
    for (int i = kCount - 1; i > 0; --i)
      near[i] = !(near[i - 1].gap <= p.gap) ? near[i - 1] : near[i].gap <= p.gap ? near[i] : p;
    if (!(near[0].gap <= p.gap)) near[0] = p;
  }

  const BoxesA& boxes_a_;
  const BoxesB& boxes_b_;
  std::uint32_t count_a_, count_b_;
  std::uint64_t left_;
  PiecePair found_[kCount]{};
  int at_ = kCount;  // in found_
  bool begun_ = false;
};

/// What became of a piece pair.
enum class PieceEnd { kApart, kOverlap, kOpen };

/// Takes a search to its end, one piece pair after another. \param look answers one with this cut-off: kApart: taken by
/// the search; kOverlap: proved, which ends it where no depth is asked for; kOpen: not settled, which is the end too.
/// \param stop_below an upper bound so low is all that is asked
template <class Nearest, class Look>
CLEARANCE_HD inline PieceEnd search_pieces(PieceSearch& search, double max_distance, Nearest& nearest, const Look& look,
                                           double stop_below = -__builtin_inf()) {
  PiecePair p;
  bool there = nearest.next(p);
  while (there) {
    const double cut_off = search.cut_off(max_distance);
    std::size_t asked = 0;
    for (; there && asked < search.round && search.asks(p.gap, cut_off); ++asked) {
      if (search.ends_before(p.gap)) {
        search.leave_out(p.gap);
        return PieceEnd::kApart;
      }
      if (const PieceEnd end = look(p, cut_off); end != PieceEnd::kApart) return end;
      const double gap = p.gap;
      there = nearest.next(p);
      if (search.upper <= stop_below && there && !(p.gap > max_distance)) {
        search.leave_out(gap);
        return PieceEnd::kApart;
      }
    }
    if (there && asked == 0) {
      search.leave_out(p.gap);
      return PieceEnd::kApart;
    }
    search.round *= 2;
  }
  return PieceEnd::kApart;
}

}  // namespace clearance
