// Lower bounds: two bodies are separated along a direction at one time, and as they move.
#include <algorithm>
#include <map>

#include "tests/oracle/certificate/bounds.h"

namespace clearance::certificate_oracle {
namespace {

// Data that all directions of a span share.
struct Look {
  const Motion& motion;
  const IdPair& ids;
  const Body &a, &b;
  const Pose &X_wa, &X_wb;
  Span span;
  Dyadic target;     // required distance of the parts without motion, which do not grow
  Growth growth[2];  // of either body

  Rates rates(Frame seer) const {
    Rates sum;
    for (const Rates& rates :
         {motion.rates(seer, ids[0], span), motion.rates(seer, ids[1], span), growth[0].most, growth[1].most}) {
      sum.way += rates.way;
      for (std::size_t side = 0; side < 2; ++side)
        for (std::size_t share = 0; share < 2; ++share) sum.rest[side][share] += rates.rest[side][share];
    }
    return sum;
  }
};

// Points x that keep their velocity as observed by `seer` move along n to n_moved·x + more.
struct Lean {
  Vector n_moved;
  Dyadic more;
};

// A place in a span: 0 or 1 on one of its sides.
struct Progress {
  std::size_t side;
  int share;
};

// In a uniform motion to the end of a side.
Lean lean(const Look& look, Frame seer, Id id, const Vector& n, const Progress& progress) {
  Lean lean{n, {}};
  if (progress.share == 0) return lean;
  Vector turn;
  for (const Mover& mover : look.motion.path(seer, id, look.span.at)) {
    const Vector rate = mover.curve.way(look.span.at, look.span.end_of(progress.side)).back() * mover.axis;
    if (mover.turns) turn = turn + rate;
    lean.more += dot(n, mover.turns ? cross(mover.point, rate) : rate);
  }
  lean.n_moved = n + cross(n, turn);
  return lean;
}

// Parts of a body, from `begin` until before `end`.
struct Run {
  std::size_t begin, end;
};
struct RunPair {
  Run a, b;
};

Run run_of(const Value& named, std::size_t count) {
  if (named.is_null()) return {0, count};
  if (!named.is_list()) return {named.index(count), named.index(count) + 1};
  require(named.list().size() == 2, "a run of pieces has not two ends");
  const Run run{named.at(0).index(count), named.at(1).index(count + 1)};
  require(run.begin < run.end, "a run has no pieces");
  return run;
}

// Upper bound on n·p over the points of the parts, times the divisor of their body's pose.
Dyadic support(const Body& body, const Pose& pose, const Vector& n, const Run& run) {
  const Vector in_body = turned_back(pose.rows, n);
  Dyadic most = body.parts[run.begin]->support(in_body);
  for (std::size_t i = run.begin + 1; i < run.end; ++i) most = std::max(most, body.parts[i]->support(in_body));
  return most;
}

// Checks that the parts are apart by `need` along n (in the world's axes, of any length) at some progress.
void check_gap(const Look& look, Frame seer, const Vector& n, const Progress& progress, const Dyadic& need,
               const RunPair& runs) {
  const Lean of_a = lean(look, seer, look.ids[0], n, progress), of_b = lean(look, seer, look.ids[1], n, progress);
  const Dyadic ahead = support(look.a, look.X_wa, of_a.n_moved, runs.a);
  const Dyadic behind = support(look.b, look.X_wb, Dyadic(-1.0) * of_b.n_moved, runs.b);
  // The root is above |n|, so that a negative product is too low. It is raised a little.
  Dyadic requested = need * length_above(n);
  if (need.sign() < 0) requested -= requested * blur();
  const Dyadic between =
      dot(of_b.n_moved, look.X_wb.origin) + of_b.more - dot(of_a.n_moved, look.X_wa.origin) - of_a.more - requested;
  const Dyadic &over_a = look.X_wa.divisor, &over_b = look.X_wb.divisor, all = over_a * over_b * between;
  if (over_b * ahead + over_a * behind > all)
    throw Rejection("pieces from " + std::to_string(runs.a.begin) + " and " + std::to_string(runs.b.begin) +
                    " on of '" + look.a.name + "' and '" + look.b.name + "' are not as far apart as is said");
}

void check_direction(const Look& look, const Value& claim, const Rates& rates, const RunPair& runs) {
  const Frame seer = frame_of(claim["seer"]);
  // Of any length: undivided rows lengthen it.
  const Value& named = claim["direction"];
  const Vector n =
      named.is_null() ? turned(look.X_wb.rows, {0.0, 0.0, -1.0}) : turned(look.X_wa.rows, named.vector_of_sums());
  const std::int64_t order = claim["order"].integer();
  require(!is_zero(n), "a direction is 0");
  require(order == 1 || order == 2, "a proof is of no known order");
  if (order == 1) return check_gap(look, seer, n, {0, 0}, look.target + rates.way, runs);
  for (const std::size_t side : {0, 1})
    for (const int share : {0, 1}) {
      Dyadic need = look.target + rates.rest[side][share];
      for (const Growth& growth : look.growth) need += Dyadic(static_cast<double>(share)) * growth.more[side];
      check_gap(look, seer, n, {side, share}, need, runs);
    }
}

RunPair named_runs(const Look& look, const Value& claim) {
  const Value& parts = claim["pieces"];
  const std::size_t of_a = look.a.parts.size(), of_b = look.b.parts.size();
  if (parts.is_null()) return {{0, of_a}, {0, of_b}};
  require(parts.list().size() == 2, "a direction is not of two pieces");
  return {run_of(parts.at(0), of_a), run_of(parts.at(1), of_b)};
}

// Checks that every two parts are in one of them. The covered parts of b change only where one begins or ends in a.
void check_cover(const std::vector<RunPair>& covered, std::size_t of_a, std::size_t of_b) {
  std::vector<std::size_t> starts{0};
  for (const RunPair& runs : covered) {
    starts.push_back(runs.a.begin);
    if (runs.a.end < of_a) starts.push_back(runs.a.end);
  }
  std::sort(starts.begin(), starts.end());
  starts.erase(std::unique(starts.begin(), starts.end()), starts.end());
  std::vector<RunPair> next = covered;  // those that have not begun yet, the first last
  std::sort(next.begin(), next.end(), [](const RunPair& p, const RunPair& q) { return p.a.begin > q.a.begin; });
  std::multimap<std::size_t, RunPair> open;  // by their begin in b
  for (const std::size_t start : starts) {
    std::erase_if(open, [&](const auto& runs) { return runs.second.a.end <= start; });
    for (; !next.empty() && next.back().a.begin == start; next.pop_back())
      open.emplace(next.back().b.begin, next.back());
    std::size_t until = 0;
    for (const auto& [begin, runs] : open)
      if (begin <= until) until = std::max(until, runs.b.end);
    require(until == of_b, "two pieces have no direction");
  }
}

// Checks that no component of one body is within a solid of the other, whose surfaces are at least `apart` from it.
void check_outside(const Body& held, const Pose& X_wh, const Body& holder, const Pose& X_wo, const Dyadic& apart) {
  const Dyadic over = X_wh.divisor * X_wo.divisor;
  for (const ConvexPart* solid : holder.wholes) {
    if (!solid->is_solid()) continue;
    std::vector<Vector> corners;
    for (std::size_t k = 0; k < solid->count(); ++k)
      corners.push_back(X_wh.divisor * turned(X_wo.rows, solid->vertex(k)) + over * (X_wo.origin - X_wh.origin));
    Vector low = corners[0], high = corners[0];
    for (const Vector& corner : corners)
      for (std::size_t k = 0; k < 3; ++k) {
        low[k] = std::min(low[k], corner[k]);
        high[k] = std::max(high[k], corner[k]);
      }
    for (const ConvexPart* whole : held.wholes)
      for (const Vector& seed : whole->seeds()) {
        const Vector p = X_wo.divisor * turned(X_wh.rows, seed);
        bool is_outside = false;
        for (std::size_t k = 0; k < 3; ++k) is_outside = is_outside || p[k] < low[k] || p[k] > high[k];
        if (is_outside) continue;
        std::vector<Vector> around;
        for (const Vector& corner : corners) around.push_back(corner - p);
        require(turns_around(solid->faces(), around, apart * over) == 0, "a body is within another");
      }
  }
}

// Relative slack of two bodies: a frame that carries both adds none.
Dyadic checked_slack(const Motion& motion, const IdPair& ids, const Value& said, const Span& span) {
  std::vector<Id> of_a = motion.frames(ids[0]), of_b = motion.frames(ids[1]);
  const auto [a, b] = std::mismatch(of_a.begin(), of_a.end(), of_b.begin(), of_b.end());
  of_a.erase(of_a.begin(), a);
  of_b.erase(of_b.begin(), b);
  const MotionUncertainty uncertainty_a = motion.uncertainty(ids[0], of_a, span),
                          uncertainty_b = motion.uncertainty(ids[1], of_b, span);
  Dyadic counted;
  for (const Value& term : said["terms"].list()) counted += term["inner"].length();
  require(counted >= uncertainty_a.in_the_middle + uncertainty_b.in_the_middle, "slack is too little");
  return uncertainty_a.all_along + uncertainty_b.all_along;
}

Dyadic blur_of(const Pose& X_wa, const Pose& X_wb) {
  return Dyadic(static_cast<double>(X_wa.is_rounded + X_wb.is_rounded)) * blur();
}

}  // namespace

IdPair pair_of(const Value& ids) {
  require(ids.list().size() == 2, "a pair is not of two bodies");
  return {ids.at(0).integer(), ids.at(1).integer()};
}

ProvedTime check_span(const Motion& motion, const IdPair& ids, const Value& claims, const Dyadic& bound) {
  Span span{claims["begin"].finite(), claims["at"].finite(), claims["end"].finite(), {}};
  const Value* const progress = claims.find("progress");
  const bool has_progress = progress && !progress->is_null();
  if (has_progress) require(progress->list().size() == 2, "a progress has not two sides");
  for (std::size_t side = 0; side < 2; ++side)
    span.progress[side] = motion.progress(has_progress ? &progress->at(side) : nullptr);
  const Body &a = motion.body(ids[0]), &b = motion.body(ids[1]);
  require(span.begin <= span.at && span.at <= span.end, "a span is looked at beyond its ends");
  require(!a.parts.empty() && !b.parts.empty(), "a body has no pieces");
  const Pose &X_wa = motion.at(ids[0], span.at).pose, &X_wb = motion.at(ids[1], span.at).pose;
  const Dyadic inner = checked_slack(motion, ids, claims["slack"], span);
  const Growth of_a = motion.growth(ids[0], span), of_b = motion.growth(ids[1], span);
  const Look look{motion,      ids, a, b, X_wa, X_wb, span, bound + inner + of_a.size + of_b.size + blur_of(X_wa, X_wb),
                  {of_a, of_b}};
  std::vector<RunPair> covered;
  std::map<Frame, Rates> rates;
  for (const Value& claim : claims["lower"].list()) {
    covered.push_back(named_runs(look, claim));
    const Frame seer = frame_of(claim["seer"]);
    if (!rates.contains(seer)) rates.emplace(seer, look.rates(seer));
    check_direction(look, claim, rates.at(seer), covered.back());
  }
  check_cover(covered, a.parts.size(), b.parts.size());
  if (bound.sign() > 0) {
    check_outside(a, X_wa, b, X_wb, bound);
    check_outside(b, X_wb, a, X_wa, bound);
  } else {
    const auto has_elements = [](const ConvexPart* whole) { return whole->has_elements(); };
    require(covered.size() == 1 || (std::none_of(a.wholes.begin(), a.wholes.end(), has_elements) &&
                                    std::none_of(b.wholes.begin(), b.wholes.end(), has_elements)),
            "how deep surfaces overlap is not of one direction");
  }
  return {span.begin, span.end};
}

}  // namespace clearance::certificate_oracle
