#include "engine/evaluate/evaluate.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "engine/hull/primitive.h"
#include "engine/narrow/group.h"
#include "engine/narrow/witness.h"

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr std::size_t kBoxesPerUnit = 16;   // that are compared
constexpr std::size_t kSortedAtOnce = 256;  // piece pairs

}  // namespace

bool is_unusable(const Scene& scene, const BodyPoses& placement, BodyPair pair) {
  for (const std::uint32_t body : {pair.a, pair.b})
    if (body >= scene.bodies().size() || placement[body].status != Status::kOk) return true;
  return false;
}

std::uint16_t pose_flags(const BodyPoses& placement, BodyPair pair) {
  std::uint16_t flags = placement[pair.a].renormalised || placement[pair.b].renormalised ? kFlagRenormalised : 0;
  if (placement[pair.a].beyond_limits || placement[pair.b].beyond_limits) flags |= kFlagBeyondLimits;
  return flags;
}

double box_gap(const Scene& scene, const BodyPoses& placement, BodyPair pair) {
  const std::size_t n = scene.bodies().size();
  if (pair.a >= n || pair.b >= n) return kInf;
  const Aabb *a = placement.known_box(pair.a), *b = placement.known_box(pair.b);
  if (a && b) return certify_box_gap(*a, *b);
  return certify_box_gap(placement.box(pair.a), placement.box(pair.b));
}

namespace {

// The flags of a pair's bodies, and its answer if that needs no look at the pieces.
bool answer_without_pieces(const Scene& scene, const PlacedBodies& bodies, const EvaluateOptions& options,
                           PairAnswer& answer) {
  const BodyPair pair = bodies.pair;
  const BodyPoses& placement = *bodies.placement;
  if (pair.a >= scene.bodies().size() || pair.b >= scene.bodies().size()) {
    answer = no_answer(Status::kUnknownBody);
    return true;
  }
  const std::uint16_t flags = options.want_flags ? pose_flags(placement, pair) : 0;
  const auto is_nowhere = [&](std::uint32_t body) { return scene.bodies()[body].cloud == CloudState::kEmpty; };
  if (scene.has_surfaces() && (is_nowhere(pair.a) || is_nowhere(pair.b)) && !is_unusable(scene, placement, pair)) {
    answer = beyond_answer(kInf);
    answer.flags = flags;
    return true;
  }
  return answer_without_pieces(
      placement[pair.a].status, placement[pair.b].status, flags, options.cull, bodies.max_distance,
      [&] { return box_gap(scene, placement, pair); }, answer);
}

}  // namespace

PairAnswer unusable_answer(const Scene& scene, const BodyPoses& placement, BodyPair pair,
                           const EvaluateOptions& options) {
  assert(is_unusable(scene, placement, pair));
  PairAnswer answer;
  answer_without_pieces(scene, {pair, &placement, kInf}, options, answer);
  return answer;
}

namespace {

// What an interval speaks of where bodies overlap: of their pieces, which are the truth or stand for it, or of meshes
// of which one holds the other.
enum class Overlap : std::uint8_t { kOfTruth, kOfPieces, kHeld };

// \param answer holds the flags of the bodies; the rest is written here. \param rooms for triangles
void finish(const Scene& scene, const PlacedBodies& bodies, const EvaluateOptions& options, const BodiesAnswer& found,
            Piece (&rooms)[2], PairAnswer& answer, Overlap overlap = Overlap::kOfTruth) {
  NarrowLimits limits = options.limits;
  limits.max_distance = bodies.max_distance;
  const NarrowAnswer& best = found.best;
  const double lower = found.lower;
  const Body &a = scene.bodies()[bodies.pair.a], &b = scene.bodies()[bodies.pair.b];
  const PoseMatrix &pose_a = (*bodies.placement)[bodies.pair.a].pose, &pose_b = (*bodies.placement)[bodies.pair.b].pose;

  if (best.bounds.upper == kInf && lower == -kInf) {
    const std::uint16_t flags = answer.flags;
    answer = unproved_answer();
    answer.flags = flags;
    return;
  }
  if (options.want_points) {
    answer.piece_a = found.a.piece;
    answer.piece_b = found.b.piece;
    answer.point_a = best.point_a;
    answer.point_b = best.point_b;
    answer.normal = best.normal;
  }
  const auto rounding = [&] {
    if (found.best.rounding > 0) return found.best.rounding;
    return rounding_of(*a.pieces[found.a.piece], pose_a, *b.pieces[found.b.piece], pose_b);
  };
  const Slack slack = overlap == Overlap::kHeld ? Slack() : pair_slack(*bodies.placement, bodies.pair);
  // Pieces that overlap prove that what they stand for is no farther apart than they may miss it.
  const bool has_no_depth = overlap == Overlap::kOfPieces && !limits.signed_distance;
  const double upper = has_no_depth ? std::max(best.bounds.upper, 0.0) : best.bounds.upper;
  assert(lower <= upper);
  assert(found.a.piece < a.pieces.size() && found.b.piece < b.pieces.size());
  decide(limits, lower, upper, rounding, answer, slack);
  const bool of_several = a.pieces.size() > 1 || b.pieces.size() > 1;
  const bool is_of_pieces = overlap == Overlap::kOfPieces  ? answer.lower < 0
                            : overlap == Overlap::kOfTruth ? of_several && upper <= 0
                                                           : false;
  if (limits.signed_distance && is_of_pieces) answer.flags |= kFlagPieces;
  if (!options.want_flags || answer.status == Status::kBeyond) return;
  const Piece &piece_a = piece_of(a, found.a, rooms[0]), &piece_b = piece_of(b, found.b, rooms[1]);
  if (is_nonsmooth(answer.lower, piece_a, pose_a.R_wb, piece_b, pose_b.R_wb, best.normal,
                   normal_angle(piece_a, piece_b, best.bounds.lower, best.bounds.upper)))
    answer.flags |= kFlagNonsmooth;
}

// The same for single pieces that lanes have settled: apart, and as narrow as asked or beyond max_distance.
void take_lane(const EvaluateOptions& options, const PieceTask& task, const LaneAnswer& lane,
               const LaneWitness& witness, const PlacedBodies& bodies, PairAnswer& answer) {
  assert(lane.converged && lane.lower <= lane.upper);
  const Slack slack = pair_slack(*bodies.placement, bodies.pair);
  NarrowLimits limits = options.limits;
  limits.max_distance = bodies.max_distance;
  if (slack.any())
    decide(limits, lane.lower, lane.upper, [] { return 0.0; }, answer, slack);
  else
    decide_apart(limits.max_distance, lane.lower, lane.upper, true, answer);
  if (!options.want_points) return;
  const Mat3d &R_wa = task.pose_a->R_wb, &R_wb = task.pose_b->R_wb;
  answer.piece_a = answer.piece_b = 0;
  take_lane_witness(*task.a, R_wa, *task.b, R_wb, witness, answer.point_a, answer.point_b, answer.normal);
  if (answer.status == Status::kBeyond)
    answer.point_a = answer.point_b = no_point();
  else if (options.want_flags && is_nonsmooth(answer.lower, *task.a, R_wa, *task.b, R_wb, answer.normal))
    answer.flags |= kFlagNonsmooth;
}

// How many bodies there may be in so many pairs; one in two placements counts as two.
std::size_t most_bodies(const Scene& scene, std::span<const PlacedBodies> pairs) {
  const bool one_placement =
      std::all_of(pairs.begin(), pairs.end(), [&](const PlacedBodies& p) { return p.placement == pairs[0].placement; });
  return one_placement ? std::min(2 * pairs.size(), scene.bodies().size()) : 2 * pairs.size();
}

}  // namespace

void Evaluator::begin(std::span<const PlacedBodies> pairs, std::span<PairAnswer> answers) {
  assert(answers.size() >= pairs.size());
  pairs_ = pairs;
  answers_ = answers;
  next_ = singles_ = 0;
  in_round_ = gathering_ = false;
  tasks_.clear();
  searches_.clear();
}

bool Evaluator::advance(WorkMeter& meter) {
  while (in_round_ || begin_round(meter)) {
    in_round_ = true;
    const auto is_single = [&](const PieceTask& task) {
      return static_cast<std::size_t>(&task - tasks_.data()) < singles_;
    };
    const bool answered = batch_.advance(
        meter,
        [&](const PieceTask& task, const LaneAnswer& lane, const LaneWitness& witness) {
          if (is_single(task))
            take_lane(options_, task, lane, witness, pairs_[task.id], answers_[task.id]);
          else
            found_[task.id] = batch_.converged_answer(task, lane, witness);
        },
        [&](const PieceTask& task, const NarrowAnswer& answer) {
          if (is_single(task))
            finish(scene_, pairs_[task.id], options_, {answer, answer.bounds.lower}, rooms_, answers_[task.id]);
          else
            found_[task.id] = answer;
        });
    if (!answered) return false;
    in_round_ = false;
    std::size_t taken = 0;
    for (Search& s : searches_) {
      take_round(s, stop_below(pairs_[s.index], s.slack), std::span(found_).subspan(taken, s.asked));
      taken += s.asked;
    }
    assert(taken == found_.size());
    if ((!searches_.empty() || next_ < pairs_.size()) && meter.is_over()) return false;
  }
  return !gathering_;
}

// The piece pairs that are asked next, in tasks_; false: there are none, and all pairs are answered, or else the slice
// is over (gathering_).
bool Evaluator::begin_round(WorkMeter& meter) {
  if (!gathering_) {
    tasks_.clear();
    singles_ = 0;
  }
  do {
    if (!gathering_ && searches_.empty()) take_in(meter);
    gathering_ = true;
    for (Search& s : searches_)
      if (s.elements && !gather(s, meter)) return false;
    gathering_ = false;
    std::erase_if(searches_, [&](Search& s) {
      if (ask(s, pairs_[s.index], singles_)) return false;
      finish_search(s, meter);
      return true;
    });
  } while (tasks_.empty() && next_ < pairs_.size());
  if (tasks_.empty()) return false;
  found_.resize(tasks_.size() - singles_);
  batch_.begin(tasks_);
  return true;
}

// Takes in pairs: those of single pieces become tasks, others searches, some are answered at once.
void Evaluator::take_in(WorkMeter& meter) {
  piece_pairs_.clear();
  for (std::size_t elements = 0; next_ < pairs_.size() && piece_pairs_.size() < kMostPiecePairs; ++next_) {
    const auto i = static_cast<std::uint32_t>(next_);
    const BodyPair pair = pairs_[i].pair;
    const BodyPoses& placement = *pairs_[i].placement;
    if (answer_without_pieces(scene_, pairs_[i], options_, answers_[i])) continue;
    const std::vector<PiecePtr>&a = scene_.bodies()[pair.a].pieces, &b = scene_.bodies()[pair.b].pieces;
    assert(!a.empty() && !b.empty());
    // What a half-space sees of a body is the body's hull, which is known of all but clouds.
    const bool by_hulls = (is_half_space(*a[0]) && !is_cloud(scene_.bodies()[pair.b])) ||
                          (is_half_space(*b[0]) && !is_cloud(scene_.bodies()[pair.a]));
    if (a.size() == 1 && b.size() == 1 && !is_by_pieces(pair) && (by_hulls || (!a[0]->surface && !b[0]->surface))) {
      const Slack slack = pair_slack(placement, pair);
      tasks_.push_back({a[0].get(), b[0].get(), &placement[pair.a].pose, &placement[pair.b].pose,
                        slack.cut_off(pairs_[i].max_distance), i, pairs_[i].warm, slack.outer,
                        stop_below(pairs_[i], slack)});
    } else if (!by_hulls && scene_.has_surfaces() &&
               (has_surface(scene_.bodies()[pair.a]) || has_surface(scene_.bodies()[pair.b]))) {
      if (elements++ == kMostElementSearches) break;
      begin_element_search(pairs_[i], i);
    } else {
      if (searches_.empty()) boxes_.expect(most_bodies(scene_, pairs_));
      begin_search(pairs_[i], i, meter);
    }
  }
  singles_ = tasks_.size();
}

// Of the piece pairs beyond the cut-off only the nearest may be asked: if no other is as near.
void Evaluator::begin_search(const PlacedBodies& bodies, std::uint32_t index, WorkMeter& meter) {
  const std::size_t begin = piece_pairs_.size();
  const std::span<const Aabb> boxes_a = boxes_.at(*bodies.placement, bodies.pair.a),
                              boxes_b = boxes_.at(*bodies.placement, bodies.pair.b);
  const Slack slack = pair_slack(*bodies.placement, bodies.pair);
  const double cut_off = options_.reference ? kInf : slack.cut_off(bodies.max_distance);
  PiecePair far{kInf, kNone, kNone};  // the nearest beyond it
  double left = kInf;                 // the gap of the next one
  for (std::uint32_t i = 0; i < boxes_a.size(); ++i)
    for (std::uint32_t j = 0; j < boxes_b.size(); ++j) {
      const PiecePair p{certify_box_gap(boxes_a[i], boxes_b[j]), i, j};
      if (!(p.gap > cut_off)) {
        piece_pairs_.push_back(p);
      } else if (goes_before(p, far)) {
        left = far.gap;
        far = p;
      } else {
        left = std::min(left, p.gap);
      }
    }
  meter.count(boxes_a.size() * boxes_b.size() / kBoxesPerUnit);
  if (piece_pairs_.size() > begin) {
    left = far.gap;
  } else if (drops(far.gap, bodies) &&
             !(is_by_pieces(bodies.pair) && box_gap(scene_, *bodies.placement, bodies.pair) <= 0)) {
    PairAnswer& answer = answers_[index];
    const std::uint16_t flags = answer.flags;
    answer = beyond_answer(slack.true_lower(far.gap));
    answer.flags = flags;
    return;
  } else {
    piece_pairs_.push_back(far);
  }
  searches_.push_back({index, begin, piece_pairs_.size(), begin, 0, slack, {}, {}});
  PieceSearch& state = searches_.back().state;
  state.lower = left;
  if (options_.reference) state.round = piece_pairs_.size() - begin;  // all at once
}

void Evaluator::begin_element_search(const PlacedBodies& bodies, std::uint32_t index) {
  const BodyPoses& placement = *bodies.placement;
  Search& search = searches_.emplace_back(
      Search{index, 0, std::numeric_limits<std::size_t>::max(), 0, 0, pair_slack(placement, bodies.pair), {}, {}});
  if (unused_.empty()) unused_.push_back(std::make_unique<ElementSearch>());
  search.elements = std::move(unused_.back());
  unused_.pop_back();
  const Body &a = scene_.bodies()[bodies.pair.a], &b = scene_.bodies()[bodies.pair.b];
  search.elements->begin(a, placement[bodies.pair.a].pose, b, placement[bodies.pair.b].pose);
}

// Puts the next round of a search together: first hulls and then one pair that is near, which say where to look. False:
// the slice is over.
bool Evaluator::gather(Search& search, WorkMeter& meter) {
  if (search.next == search.end) return true;
  const PlacedBodies& bodies = pairs_[search.index];
  ElementSearch& elements = *search.elements;
  const double user = search.slack.cut_off(bodies.max_distance), upper = search.state.upper;
  if (search.state.round == 1) {
    if (drops(elements.left(), bodies)) return true;
    if (!elements.are_hulls_taken() && (options_.limits.signed_distance || !elements.leave_hulls())) {
      elements.begin_hulls(options_.limits.signed_distance);
      return true;
    }
    if (is_left_to_pieces(search) || elements.begin_near(user)) return true;
    search.state.round = 2;
  }
  double cut_off = search.state.cut_off(user);
  // Around a nearest vertex all pairs are as near as it is: what keeps the interval as narrow as half of what is asked
  // is left out.
  if (!options_.reference && upper > 0 && upper <= user && upper < kInf)
    cut_off =
        std::max(0.5 * upper, upper - 0.5 * tolerance_at(upper, options_.limits.abs_tol, options_.limits.rel_tol));
  return elements.gather(std::min(search.state.round, ElementSearch::kMostOfRound), cut_off, meter);
}

// Whether the pieces that stand for triangles are asked next, or have answered for them: that none is near enough.
bool Evaluator::is_left_to_pieces(Search& search) {
  const PlacedBodies& bodies = pairs_[search.index];
  const BodyPoses& placement = *bodies.placement;
  ElementSearch& elements = *search.elements;
  if (options_.reference ||
      elements.go_on_by_pieces(placement[bodies.pair.a].pose, placement[bodies.pair.b].pose,
                               search.slack.cut_off(bodies.max_distance)) != ElementSearch::ByPieces::kGoesOn)
    return false;
  if (elements.pieces().round().empty()) {
    search.state.leave_out(elements.pieces().lower());
    search.next = search.end;
  }
  return true;
}

// What the pairs of elements that were taken say of their bodies.
void Evaluator::finish_search(Search& search, WorkMeter& meter) {
  const PlacedBodies& bodies = pairs_[search.index];
  BodiesAnswer& found = search.found;
  found.lower = search.state.lower;
  const bool by_elements = search.elements != nullptr, by_pieces = is_by_pieces(bodies.pair);
  const bool held = (by_elements || by_pieces) && is_held(search, meter);
  if (by_elements) {
    const ElementSearch::HullsGap hulls = search.elements->hulls_gap();
    unused_.push_back(std::move(search.elements));
    // What takes hulls apart takes apart what is within.
    if (options_.limits.signed_distance && search.slack.true_lower(found.lower) <= 0 && !(held && by_pieces)) {
      found.lower = hulls.lower;
      found.best.normal = hulls.normal;
    }
  }
  PairAnswer& answer = answers_[search.index];
  const double true_lower = search.slack.true_lower(found.lower);
  const bool was_asked = found.best.bounds.upper < kInf;
  if (by_elements && !was_asked && true_lower > bodies.max_distance) {
    const std::uint16_t flags = answer.flags;
    answer = beyond_answer(true_lower);
    answer.flags = flags;
    return;
  }
  finish(scene_, bodies, options_, found, rooms_, answer,
         !by_pieces ? Overlap::kOfTruth
         : held     ? Overlap::kHeld
                    : Overlap::kOfPieces);
}

// Whether no more need be known of a pair than that its boxes are so far apart.
bool Evaluator::drops(double gap, const PlacedBodies& bodies) const {
  const NarrowLimits& asked = options_.limits;
  return (options_.drops_beyond || bodies.max_distance < asked.max_distance) &&
         gap > loser_beyond(pair_slack(*bodies.placement, bodies.pair).cut_off(bodies.max_distance), asked);
}

// Brings the piece pairs of the next round into their order. Of the others it is enough that they come later: most
// searches end after a few.
void Evaluator::sort_ahead(Search& search) {
  const std::size_t wanted = std::min(search.next + search.state.round, search.end);
  if (wanted <= search.sorted) return;
  const auto at = [&](std::size_t i) { return piece_pairs_.begin() + static_cast<std::ptrdiff_t>(i); };
  const std::size_t to = std::min(search.end, std::max(wanted, search.sorted + kSortedAtOnce));
  if (to < search.end) std::nth_element(at(search.sorted), at(to), at(search.end), goes_before);
  std::sort(at(search.sorted), at(to), goes_before);
  search.sorted = to;
}

// Adds the next round to tasks_, after those of single pieces; false: nothing is left to ask.
bool Evaluator::ask(Search& search, const PlacedBodies& bodies, std::size_t singles) {
  const Body &a = scene_.bodies()[bodies.pair.a], &b = scene_.bodies()[bodies.pair.b];
  PieceSearch& state = search.state;
  const double user = search.slack.cut_off(bodies.max_distance),
               cut_off = options_.reference ? user : state.cut_off(user);
  search.asked = 0;
  const double min_penetration = is_by_pieces(bodies.pair) ? 0 : search.slack.outer;
  const auto add_up_to = [&](double most, double near_enough, const Piece& piece_a, const Piece& piece_b) {
    tasks_.push_back({&piece_a, &piece_b, &(*bodies.placement)[bodies.pair.a].pose,
                      &(*bodies.placement)[bodies.pair.b].pose, most,
                      static_cast<std::uint32_t>(tasks_.size() - singles), nullptr, min_penetration, near_enough});
    ++search.asked;
  };
  const auto add = [&](const Piece& piece_a, const Piece& piece_b) {
    add_up_to(cut_off, stop_below(bodies, search.slack), piece_a, piece_b);
  };
  if (search.elements) {
    if (search.next == search.end) return false;
    if (search.elements->is_by_pieces()) {  // whether they are beyond is all that is asked
      for (const DecomposedPair::Asked& p : search.elements->pieces().round())
        add_up_to(p.cut_off, p.cut_off, *p.a, *p.b);
      return search.asked > 0;
    }
    for (std::size_t i = 0; i < search.elements->round().size(); ++i)
      add(search.elements->piece_a(i), search.elements->piece_b(i));
    if (search.asked == 0) state.leave_out(search.elements->left());
    return search.asked > 0;
  }
  sort_ahead(search);
  for (std::size_t i = search.next; i < search.end && search.asked < state.round; ++i) {
    const PiecePair& p = piece_pairs_[i];
    if (!options_.reference && !state.asks(p.gap, cut_off)) break;
    add(*a.pieces[p.a], *b.pieces[p.b]);
  }
  if (search.asked == 0 && search.next < search.end) state.leave_out(piece_pairs_[search.next].gap);
  return search.asked > 0;
}

void Evaluator::take_round(Search& search, double stop_below, std::span<const NarrowAnswer> answers) {
  assert(search.next + answers.size() <= search.end);
  PieceSearch& state = search.state;
  ElementSearch* const elements = search.elements.get();
  const bool by_pieces = is_by_pieces(pairs_[search.index].pair);
  if (elements && elements->in_hulls() && !answers.empty()) {
    for (const NarrowAnswer& hulls : answers) elements->see_hulls(hulls.bounds.lower, hulls.normal);
    return elements->take_hulls(answers[0].bounds.lower, answers[0].normal);
  }
  if (elements && elements->is_by_pieces()) {
    for (std::size_t k = 0; k < answers.size(); ++k) elements->pieces().take(k, answers[k].bounds.lower);
    return elements->pieces().end_round();
  }
  const auto pair_at = [&](std::size_t k) -> ElementPair {
    if (elements) return elements->round()[k];
    const PiecePair& p = piece_pairs_[search.next + k];
    return {p.gap, {p.a, kNone}, {p.b, kNone}};
  };
  for (std::size_t k = 0; k < answers.size(); ++k) {
    const NarrowAnswer& answer = answers[k];
    const ElementPair p = pair_at(k);
    if (!options_.reference && state.ends_before(p.gap)) {
      state.leave_out(p.gap);
      search.next = search.end;
      return;
    }
    if (state.take(p.gap, answer.bounds.lower, answer.bounds.upper)) {
      search.found.best = answer;
      search.found.a = p.a;
      search.found.b = p.b;
    }
    const bool wants_depth = options_.limits.signed_distance && !elements;
    const double upper = by_pieces ? state.upper : search.slack.true_upper(state.upper);
    if (!wants_depth && upper <= 0) {  // overlapping: that is all
      search.next = search.end;
      return;
    }
    const bool is_last = !elements && search.next + k + 1 == search.end;
    if (!options_.reference && state.upper <= stop_below && !is_last) {  // near enough: the same
      state.leave_out(p.gap);
      search.next = search.end;
      return;
    }
  }
  const bool is_one_near = state.round == 1;  // which says less of where to look than hulls that are apart
  state.round *= 2;
  search.next += elements ? 0 : answers.size();
  if (!elements) return;
  if (state.upper > 0 && !(is_one_near && elements->hulls_are_apart()))
    elements->look_along(state.upper < kInf ? search.found.best.normal : answers[0].normal);
  elements->end_round();
}

}  // namespace clearance
