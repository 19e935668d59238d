// Lower bounds: along a direction two bodies are apart, when they are looked at and as they move.
#include <algorithm>
#include <set>

#include "bounds.h"

namespace clearance::judge {
namespace {

using PiecePair = std::pair<std::size_t, std::size_t>;

// What all directions of a span have in common.
struct Look {
  const Motion& motion;
  const IdPair& ids;
  const Body &a, &b;
  const Pose &X_wa, &X_wb;
  double begin, at, end;
  Dyadic half;    // how long it is from `at` to the farther end, at most
  Dyadic target;  // how far apart the pieces have to be if nothing moves

  Rates rates(Frame seer) const {
    const Rates of_a = motion.rates(seer, ids[0], at, half), of_b = motion.rates(seer, ids[1], at, half);
    return {of_a.speed + of_b.speed, of_a.bend + of_b.bend};
  }
};

// Points x that keep the speed that they have as `seer` sees it get along n, in s, to n_moved·x + more.
struct Lean {
  Vector n_moved;
  Dyadic more;
};

Lean lean(const Motion& motion, Frame seer, Id id, double time, const Vector& n, const Dyadic& s) {
  Lean lean{n, {}};
  if (s.sign() == 0) return lean;
  Vector turn;
  for (const Mover& mover : motion.path(seer, id, time)) {
    if (mover.turns) turn = turn + mover.rate;
    lean.more += dot(n, mover.turns ? cross(mover.point, mover.rate) : mover.rate);
  }
  lean.more = s * lean.more;
  lean.n_moved = n + s * cross(n, turn);
  return lean;
}

// No less than n·p of any point of the piece, times the divisor of its body's pose.
std::map<std::size_t, Dyadic> supports(const Body& body, const Pose& pose, const Vector& n,
                                       const std::set<std::size_t>& places) {
  const Vector in_body = turned_back(pose.rows, n);
  std::map<std::size_t, Dyadic> supports;
  for (const std::size_t i : places) supports.emplace(i, body.pieces[i]->support(in_body));
  return supports;
}

// The pieces are apart by `need` along n (in the world's axes, of any length) after s.
void check_gap(const Look& look, Frame seer, const Vector& n, const Dyadic& s, const Dyadic& need,
               const std::set<PiecePair>& pairs) {
  const Lean of_a = lean(look.motion, seer, look.ids[0], look.at, n, s);
  const Lean of_b = lean(look.motion, seer, look.ids[1], look.at, n, s);
  std::set<std::size_t> of_pieces_a, of_pieces_b;
  for (const auto& [i, j] : pairs) {
    of_pieces_a.insert(i);
    of_pieces_b.insert(j);
  }
  const auto ahead = supports(look.a, look.X_wa, of_a.n_moved, of_pieces_a);
  const auto behind = supports(look.b, look.X_wb, Dyadic(-1.0) * of_b.n_moved, of_pieces_b);
  // The root is above |n|: what is to be less than a negative number times |n| is asked for a little more.
  Dyadic asked = need * length_above(n);
  if (need.sign() < 0) asked -= asked * blur();
  const Dyadic between =
      dot(of_b.n_moved, look.X_wb.origin) + of_b.more - dot(of_a.n_moved, look.X_wa.origin) - of_a.more - asked;
  const Dyadic &over_a = look.X_wa.divisor, &over_b = look.X_wb.divisor, all = over_a * over_b * between;
  for (const auto& [i, j] : pairs)
    if (over_b * ahead.at(i) + over_a * behind.at(j) > all)
      throw Refusal("pieces " + std::to_string(i) + " and " + std::to_string(j) + " of '" + look.a.name + "' and '" +
                    look.b.name + "' are not as far apart as is said");
}

void check_direction(const Look& look, const Value& claim, const Rates& rates, const std::set<PiecePair>& pairs) {
  const Frame seer = frame_of(claim["seer"]);
  // Of any length: that a's rows are not divided lengthens it.
  const Vector n = turned(look.X_wa.rows, claim["direction"].vector_of_sums());
  const std::int64_t order = claim["order"].integer();
  require(!is_zero(n), "a direction is 0");
  require(order == 1 || order == 2, "a proof is of no known order");
  if (order == 1) return check_gap(look, seer, n, {}, look.target + rates.speed * look.half, pairs);
  for (const double end : {look.begin, look.end}) {
    const Dyadic s = Dyadic(end) - look.at;
    check_gap(look, seer, n, s, look.target + Dyadic(0.5) * rates.bend * s * s, pairs);
  }
}

std::set<PiecePair> named_pairs(const Look& look, const Value& claim, const std::set<PiecePair>& open) {
  const Value& pieces = claim["pieces"];
  if (pieces.is_null()) return open;
  require(pieces.list().size() == 2, "a direction is not of two pieces");
  return {{pieces.at(0).index(look.a.pieces.size()), pieces.at(1).index(look.b.pieces.size())}};
}

// Slack that bodies have before each other: what carries both moves neither.
Dyadic checked_slack(const Motion& motion, const IdPair& ids, const Value& said, double at, const Dyadic& half) {
  std::vector<Id> of_a = motion.frames(ids[0]), of_b = motion.frames(ids[1]);
  const auto [a, b] = std::mismatch(of_a.begin(), of_a.end(), of_b.begin(), of_b.end());
  of_a.erase(of_a.begin(), a);
  of_b.erase(of_b.begin(), b);
  const Doubt doubt_a = motion.doubt(ids[0], of_a, at, half), doubt_b = motion.doubt(ids[1], of_b, at, half);
  Dyadic counted;
  for (const Value& term : said["terms"].list()) counted += term["inner"].length();
  require(counted >= doubt_a.in_the_middle + doubt_b.in_the_middle, "slack is too little");
  return doubt_a.all_along + doubt_b.all_along;
}

Dyadic blur_of(const Pose& X_wa, const Pose& X_wb) {
  return Dyadic(static_cast<double>(X_wa.is_rounded + X_wb.is_rounded)) * blur();
}

}  // namespace

IdPair pair_of(const Value& ids) {
  require(ids.list().size() == 2, "a pair is not of two bodies");
  return {ids.at(0).integer(), ids.at(1).integer()};
}

Span check_span(const Motion& motion, const IdPair& ids, const Value& span, const Dyadic& bound) {
  const double begin = span["begin"].finite(), at = span["at"].finite(), end = span["end"].finite();
  const Body &a = motion.body(ids[0]), &b = motion.body(ids[1]);
  require(begin <= at && at <= end, "a span is looked at beyond its ends");
  require(!a.pieces.empty() && !b.pieces.empty(), "a body has no pieces");
  const Pose &X_wa = motion.at(ids[0], at).pose, &X_wb = motion.at(ids[1], at).pose;
  const Dyadic half = std::max(Dyadic(end) - at, Dyadic(at) - begin);
  const Dyadic inner = checked_slack(motion, ids, span["slack"], at, half);
  const Look look{motion, ids, a, b, X_wa, X_wb, begin, at, end, half, bound + inner + blur_of(X_wa, X_wb)};
  std::set<PiecePair> open;
  for (std::size_t i = 0; i < a.pieces.size(); ++i)
    for (std::size_t j = 0; j < b.pieces.size(); ++j) open.emplace(i, j);
  std::map<Frame, Rates> rates;
  for (const Value& claim : span["lower"].list()) {
    const std::set<PiecePair> pairs = named_pairs(look, claim, open);
    const Frame seer = frame_of(claim["seer"]);
    if (!rates.contains(seer)) rates.emplace(seer, look.rates(seer));
    check_direction(look, claim, rates.at(seer), pairs);
    for (const PiecePair& pair : pairs) open.erase(pair);
  }
  require(open.empty(), "two pieces have no direction");
  return {begin, end};
}

}  // namespace clearance::judge
