#include "engine/query/block_search.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "engine/narrow/group.h"
#include "engine/query/pair_answer.h"

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr std::uint32_t kFirstRound = 2;     // pairs of pieces of a configuration that are asked first
constexpr std::uint64_t kBoxesPerUnit = 16;  // of work: that are compared
constexpr double kNever = -1;                // a cut-off that no gap is within

// Which entries of a row are within their cut-offs: ascending. Few are, and most chunks have none.
std::size_t near_in_row(const double* gaps, const double* cut_offs, std::size_t count, std::uint32_t* near) {
  constexpr std::size_t kChunk = 8;
  std::size_t found = 0, i = 0;
  for (; i + kChunk <= count; i += kChunk) {
    int within = 0;
    for (std::size_t k = i; k < i + kChunk; ++k) within |= gaps[k] <= cut_offs[k];
    if (!within) continue;
    for (std::size_t k = i; k < i + kChunk; ++k)
      if (gaps[k] <= cut_offs[k]) near[found++] = static_cast<std::uint32_t>(k);
  }
  for (; i < count; ++i)
    if (gaps[i] <= cut_offs[i]) near[found++] = static_cast<std::uint32_t>(i);
  return found;
}

// The square of certify_box_gap() before it is rounded down; without a branch.
double squared_gap(const Aabb& a, const Aabb& b) {
  const auto along = [](double low_a, double high_a, double low_b, double high_b) {
    return std::max(std::max(low_b - high_a, low_a - high_b), 0.0);
  };
  const double x = along(a.low.x, a.high.x, b.low.x, b.high.x), y = along(a.low.y, a.high.y, b.low.y, b.high.y),
               z = along(a.low.z, a.high.z, b.low.z, b.high.z);
  return x * x + y * y + z * z;
}

// Squares beyond this are of gaps beyond the cut-off, whatever was rounded or vanished.
double squared_limit(double cut_off) {
  return cut_off * cut_off * (1 + 0x1p-40) + 1e-290;
}

}  // namespace

bool BlockSearch::fits(const Scene& scene, const Plan& plan, const EvaluateOptions& options) {
  const Reduce reduce = plan.query.reduce;
  return plan.query.configuration_count > 0 && !scene.has_surfaces() && plan.doubts.empty() && !options.reference &&
         !options.limits.signed_distance && options.lanes &&
         (reduce == Reduce::kMin || reduce == Reduce::kWithin || reduce == Reduce::kAny);
}

std::uint64_t BlockSearch::piece_pairs(const Scene& scene, const Plan& plan) {
  std::uint64_t sum = 0;
  for (std::uint64_t p = 0; p < plan.pairs.size(); ++p) {
    const BodyPair pair = plan.pairs.at(p);
    if (pair.a >= scene.bodies().size() || pair.b >= scene.bodies().size()) continue;
    sum += scene.bodies()[pair.a].pieces.size() * scene.bodies()[pair.b].pieces.size();
  }
  return sum;
}

void BlockSearch::begin(std::span<const Placement> placed, const BlockBoxes& boxes, std::span<const double> gaps) {
  assert(gaps.size() == placed.size() * plan_.pairs.size() && boxes.size() == placed.size());
  placed_ = placed;
  boxes_ = &boxes;
  gaps_ = gaps;
  stage_ = Stage::kBegin;
  in_round_ = false;
  next_ = 0;
  candidates_.clear();
  near_.clear();
  units_.clear();
  narrow_.clear();
  seeds_.clear();
  found_.clear();
}

bool BlockSearch::advance(WorkMeter& meter) {
  const auto run_rounds = [&] {
    while (in_round_ || ask_round()) {
      in_round_ = true;
      const bool answered = batch_.advance(
          meter,
          [&](const PieceTask& task, const LaneAnswer& lane, const LaneWitness& witness) {
            narrow_[candidates_[task.id].answer] = batch_.settled_answer(task, lane, witness);
            candidates_[task.id].by_lanes = true;
          },
          [&](const PieceTask& task, const NarrowAnswer& answer) { narrow_[candidates_[task.id].answer] = answer; });
      if (!answered) return false;
      in_round_ = false;
      take_round();
      if (meter.is_over()) return false;
    }
    return true;
  };
  if (stage_ == Stage::kBegin) {
    look_for_unplaced();
    if (plan_.query.reduce == Reduce::kMin) find_seeds();
    stage_ = plan_.query.reduce == Reduce::kMin ? Stage::kSeeds : Stage::kFilter;
  }
  if (stage_ == Stage::kSeeds) {
    if (!run_rounds()) return false;
    end_seeds();
    stage_ = Stage::kFilter;
  }
  if (stage_ == Stage::kFilter) {
    if (!filter(meter)) return false;
    make_units();
    stage_ = Stage::kRest;
  }
  if (stage_ == Stage::kRest) {
    if (!run_rounds()) return false;
    sort_units();
    stage_ = Stage::kFinish;
  }
  if (stage_ == Stage::kFinish) {
    if (!finish_all(meter)) return false;
    stage_ = Stage::kDone;
  }
  return true;
}

// A body without a usable pose has no box, and its pairs no finite gap.
void BlockSearch::look_for_unplaced() {
  const std::size_t count = placed_.size();
  cut_.assign(count, 0);
  for (std::size_t p = 0; p < plan_.pairs.size(); ++p) {
    const double* const row = gaps_.data() + p * count;
    for (std::size_t k = 0; k < count; ++k) cut_[k] = std::max(cut_[k], row[k]);
  }
  searched_.resize(count);
  for (std::size_t k = 0; k < count; ++k) searched_[k] = cut_[k] < kInf;
  const double most = any() ? plan_.margins.most() : plan_.query.max_distance;
  for (std::size_t k = 0; k < count; ++k) cut_[k] = searched_[k] ? most : kNever;
  last_.assign(count, kNone);
}

// Of all pieces of a body.
void BlockSearch::list_boxes(std::uint32_t body, std::vector<PieceSide>& sides) {
  const std::vector<PiecePtr>& pieces = scene_.bodies()[body].pieces;
  sides.resize(pieces.size());
  const bool moves = boxes_->moves(body);
  const PlacedPose& pose = placed_[0][body].pose;
  for (std::uint32_t i = 0; i < pieces.size(); ++i)
    sides[i] = moves ? PieceSide{kEmptyBox, true, boxes_->piece(body, i)}
                     : PieceSide{certify_box(*pieces[i], pose.R_wb, pose.t_w), false, {}};
}

// Of each configuration the nearest pieces of the pair whose boxes are the nearest: what they are apart says how far
// others matter.
void BlockSearch::find_seeds() {
  const std::size_t count = placed_.size();
  least_.assign(count, kInf);
  where_.assign(count, kNone);
  for (std::size_t p = 0; p < plan_.pairs.size(); ++p) {
    const double* const row = gaps_.data() + p * count;
    for (std::size_t k = 0; k < count; ++k) {
      const bool nearer = row[k] < least_[k];
      least_[k] = nearer ? row[k] : least_[k];
      where_[k] = nearer ? static_cast<std::uint32_t>(p) : where_[k];
    }
  }
  std::uint32_t listed = kNone;
  for (std::uint32_t k = 0; k < count; ++k) {
    if (!searched_[k]) continue;
    const std::uint32_t position = where_[k];
    Candidate nearest{kInf, position, kNone, kNone, kNotAsked, false};
    if (position != kNone) {
      const BodyPair pair = plan_.pairs.at(position);
      if (position != listed) {
        list_boxes(pair.a, sides_a_);
        list_boxes(pair.b, sides_b_);
        listed = position;
      }
      for (std::uint32_t i = 0; i < sides_a_.size(); ++i)
        for (std::uint32_t j = 0; j < sides_b_.size(); ++j) {
          const Candidate c{certify_box_gap(sides_a_[i].at(k), sides_b_[j].at(k)), position, i, j, kNotAsked, false};
          if (goes_before(c, nearest)) nearest = c;
        }
    }
    if (!(nearest.gap <= plan_.query.max_distance) || nearest.a == kNone) {
      searched_[k] = 0;
      cut_[k] = kNever;
      continue;
    }
    const auto at = static_cast<std::uint32_t>(candidates_.size());
    candidates_.push_back(nearest);
    units_.push_back({k, at, at, at + 1, 0, 1, false, kInf});
  }
}

void BlockSearch::end_seeds() {
  seeds_.assign(placed_.size(), {kInf, kNone, kNone, kNone, kNotAsked, false});
  for (const Unit& unit : units_) {
    const std::uint32_t k = unit.configuration;
    const Candidate& seed = candidates_[unit.begin];
    if (!(unit.upper <= plan_.query.max_distance)) {  // nothing is near enough, or nothing was proved
      searched_[k] = 0;
      cut_[k] = kNever;
      continue;
    }
    cut_[k] = cut_off(unit, seed);
    if (unit.upper <= 0) last_[k] = seed.position;
    seeds_[k] = seed;
  }
  units_.clear();
  candidates_.clear();
}

bool BlockSearch::filter(WorkMeter& meter) {
  const std::size_t count = placed_.size();
  where_.resize(count);
  while (next_ < plan_.pairs.size()) {
    const auto p = static_cast<std::uint32_t>(next_++);
    const std::size_t near = near_in_row(gaps_.data() + p * count, cut_.data(), count, where_.data());
    if (near > 0) filter_pair(p, std::span(where_).first(near), meter);
    if (meter.is_over()) return false;
  }
  next_ = 0;
  return true;
}

// The pieces of a pair of bodies that may matter, in the configurations where the bodies' boxes are near.
void BlockSearch::filter_pair(std::uint32_t position, std::span<const std::uint32_t> where, WorkMeter& meter) {
  const BodyPair pair = plan_.pairs.at(position);
  const double margin = any() ? plan_.margins.of(position) : kInf;
  list_boxes(pair.a, sides_a_);
  list_boxes(pair.b, sides_b_);
  std::uint64_t compared = 0;
  for (const std::uint32_t k : where) {
    if (position >= last_[k]) continue;  // behind one that overlaps
    const double cut = std::min(cut_[k], margin), limit = squared_limit(cut);
    if (gaps_[position * placed_.size() + k] > cut) continue;
    // A gap between these two is asked of the nearest alone, where no other pieces are near.
    const double far_cut = plan_.query.reduce == Reduce::kMin ? cut : loser_beyond(cut, options_.limits);
    const double far_limit = squared_limit(far_cut);
    Candidate far{kInf, position, kNone, kNone, kNotAsked, false};
    const auto begin = static_cast<std::uint32_t>(candidates_.size());
    const Candidate* const seed = seeds_.empty() || seeds_[k].position != position ? nullptr : &seeds_[k];
    for (std::uint32_t i = 0; i < sides_a_.size(); ++i) {
      const Aabb box_a = sides_a_[i].at(k);
      for (std::uint32_t j = 0; j < sides_b_.size(); ++j) {
        const Aabb box_b = sides_b_[j].at(k);
        const double squared = squared_gap(box_a, box_b);
        if (squared > limit && squared > far_limit) continue;
        if (seed && seed->a == i && seed->b == j) continue;
        const Candidate c{certify_box_gap(box_a, box_b), position, i, j, kNotAsked, false};
        if (!(c.gap > cut))
          candidates_.push_back(c);
        else if (!(c.gap > far_cut) && goes_before(c, far))
          far = c;
      }
    }
    compared += sides_a_.size() * sides_b_.size();
    if (candidates_.size() == begin && far.a != kNone) candidates_.push_back(far);
    if (candidates_.size() > begin) near_.push_back({k, begin, static_cast<std::uint32_t>(candidates_.size())});
  }
  meter.count(compared / kBoxesPerUnit);
}

// Reduce::kAny asks in the query's order, the others the nearest first.
bool BlockSearch::goes_before(const Candidate& p, const Candidate& q) const {
  if (any() && p.position != q.position) return p.position < q.position;
  if (p.gap != q.gap) return p.gap < q.gap;
  if (p.position != q.position) return p.position < q.position;
  return p.a != q.a ? p.a < q.a : p.b < q.b;
}

void BlockSearch::make_units() {
  const auto in_order = [&](const Candidate& p, const Candidate& q) { return goes_before(p, q); };
  const auto at = [&](std::uint32_t i) { return candidates_.begin() + i; };
  if (within()) {
    for (const Near& n : near_) {
      if (n.end - n.begin > 1) std::sort(at(n.begin), at(n.end), in_order);
      units_.push_back({n.configuration, n.begin, n.begin, n.end, 0, 1, false, kInf});
    }
    return;
  }
  begins_.assign(placed_.size() + 1, 0);
  for (const Near& n : near_) begins_[n.configuration + 1] += n.end - n.begin;
  for (std::size_t k = 0; k < placed_.size(); ++k) begins_[k + 1] += begins_[k];
  sorted_.resize(candidates_.size());
  where_.assign(begins_.begin(), begins_.end() - 1);
  for (const Near& n : near_)
    for (std::uint32_t i = n.begin; i < n.end; ++i) sorted_[where_[n.configuration]++] = candidates_[i];
  candidates_.swap(sorted_);
  for (std::uint32_t k = 0; k < placed_.size(); ++k) {
    const std::uint32_t begin = begins_[k], end = begins_[k + 1];
    std::sort(at(begin), at(end), in_order);
    double upper = kInf;
    if (!seeds_.empty() && seeds_[k].answer != kNotAsked) upper = narrow_[seeds_[k].answer].bounds.upper;
    units_.push_back({k, begin, begin, end, 0, kFirstRound, begin == end, upper});
  }
}

// Beyond which a pair of pieces need not be refined.
double BlockSearch::cut_off(const Unit& unit, const Candidate& c) const {
  if (any()) return plan_.margins.of(c.position);
  const double most = plan_.query.max_distance;
  return std::min(most, within() ? std::max(unit.upper, 0.0) : loser_beyond(unit.upper, options_.limits));
}

// The next pairs of pieces of all units, in tasks_; false: there are none.
bool BlockSearch::ask_round() {
  tasks_.clear();
  for (Unit& unit : units_) {
    if (unit.over) continue;
    unit.asked = 0;
    const Placement& here = placed_[unit.configuration];
    for (std::uint32_t i = unit.next; i < unit.end && unit.asked < unit.round; ++i, ++unit.asked) {
      Candidate& c = candidates_[i];
      const double cut = cut_off(unit, c);
      if (!any() && unit.round > 1 && c.gap > cut) break;
      const BodyPair pair = plan_.pairs.at(c.position);
      c.answer = static_cast<std::uint32_t>(narrow_.size() + tasks_.size());
      tasks_.push_back({scene_.bodies()[pair.a].pieces[c.a].get(), scene_.bodies()[pair.b].pieces[c.b].get(),
                        &here[pair.a].pose, &here[pair.b].pose, cut, i, nullptr, 0, any() ? cut : -kInf});
    }
    unit.over = unit.asked == 0;
  }
  if (tasks_.empty()) return false;
  narrow_.resize(narrow_.size() + tasks_.size());
  batch_.begin(tasks_);
  return true;
}

void BlockSearch::take_round() {
  for (Unit& unit : units_) {
    if (unit.over) continue;
    bool decided = false;
    for (; unit.asked > 0; --unit.asked, ++unit.next) {
      const Candidate& c = candidates_[unit.next];
      const double upper = narrow_[c.answer].bounds.upper;
      unit.upper = std::min(unit.upper, upper);
      decided |= upper <= 0 || (any() && upper <= plan_.margins.of(c.position));
    }
    unit.over = decided || unit.next == unit.end;
    unit.round *= 2;
  }
}

// By configuration; those of one stay in the order of the query.
void BlockSearch::sort_units() {
  begins_.assign(placed_.size() + 1, 0);
  for (const Unit& unit : units_) ++begins_[unit.configuration + 1];
  for (std::size_t k = 0; k < placed_.size(); ++k) begins_[k + 1] += begins_[k];
  where_.assign(begins_.begin(), begins_.end() - 1);
  unit_order_.resize(units_.size());
  for (std::uint32_t i = 0; i < units_.size(); ++i) unit_order_[where_[units_[i].configuration]++] = i;
  found_begin_.assign(1, 0);
}

// Of a unit's candidates those that were not asked count as left out: not for a minimum, which they are proved to be
// no part of, and for a decision only those of the pair that made it.
std::uint32_t BlockSearch::end_that_counts(const Unit& unit) const {
  if (within()) return unit.end;
  std::uint32_t end = unit.next;
  while (any() && end > unit.begin && end < unit.end && candidates_[end].position == candidates_[end - 1].position)
    ++end;
  return end;
}

// Puts together what was found of each pair of bodies, configuration by configuration.
bool BlockSearch::finish_all(WorkMeter& meter) {
  const auto by_position = [&](const Candidate& p, const Candidate& q) {
    if (p.position != q.position) return p.position < q.position;
    return goes_before(p, q);
  };
  while (next_ < placed_.size()) {
    const std::size_t k = next_++;
    sorted_.clear();
    if (!seeds_.empty() && seeds_[k].answer != kNotAsked) sorted_.push_back(seeds_[k]);
    for (std::uint32_t i = begins_[k]; i < begins_[k + 1]; ++i) {
      const Unit& unit = units_[unit_order_[i]];
      sorted_.insert(sorted_.end(), candidates_.begin() + unit.begin, candidates_.begin() + end_that_counts(unit));
    }
    if (!seeds_.empty()) std::sort(sorted_.begin(), sorted_.end(), by_position);
    for (std::size_t begin = 0, end; begin < sorted_.size(); begin = end) {
      end = begin + 1;
      while (end < sorted_.size() && sorted_[end].position == sorted_[begin].position) ++end;
      if (sorted_[begin].answer != kNotAsked) finish_pair(k, std::span(sorted_).subspan(begin, end - begin));
    }
    found_begin_.push_back(found_.size());
    meter.count(sorted_.size() / kBoxesPerUnit);
    if (meter.is_over()) return false;
  }
  return true;
}

// \param all candidates of a pair of bodies, in their order
void BlockSearch::finish_pair(std::size_t configuration, std::span<const Candidate> all) {
  const std::uint64_t position = all[0].position;
  const PlacedBodies bodies{plan_.pairs.at(position), &placed_[configuration],
                            any() ? plan_.margins.of(position) : plan_.query.max_distance};
  PairAnswer& answer = found_
                           .emplace_back(FoundPair{position, bodies.pair,
                                                   gaps_[position * placed_.size() + configuration], unproved_answer()})
                           .answer;
  if (options_.want_flags) answer.flags = pose_flags(*bodies.placement, bodies.pair, options_.stale);
  const Body &a = scene_.bodies()[bodies.pair.a], &b = scene_.bodies()[bodies.pair.b];
  if (a.pieces.size() == 1 && b.pieces.size() == 1) {
    const NarrowAnswer& one = narrow_[all[0].answer];
    if (!all[0].by_lanes) return finish(scene_, bodies, options_, {one, one.bounds.lower}, rooms_, answer);
    decide_settled(bodies, options_, one.bounds.lower, one.bounds.upper, answer);
    if (!options_.want_points) return;
    answer.point_a = one.point_a;
    answer.point_b = one.point_b;
    answer.normal = one.normal;
    return finish_settled(*a.pieces[0], (*bodies.placement)[bodies.pair.a].pose.R_wb, *b.pieces[0],
                          (*bodies.placement)[bodies.pair.b].pose.R_wb, options_, answer);
  }
  PieceSearch state;
  BodiesAnswer found;
  for (const Candidate& c : all) {
    if (c.answer == kNotAsked || state.ends_before(c.gap)) {
      state.leave_out(c.gap);
      break;
    }
    const NarrowAnswer& one = narrow_[c.answer];
    if (state.take(c.gap, one.bounds.lower, one.bounds.upper)) {
      found.best = one;
      found.a = {c.a, kNone};
      found.b = {c.b, kNone};
    }
    if (state.upper <= 0) break;
    if (any() && state.upper <= bodies.max_distance && &c != &all.back()) {
      state.leave_out(c.gap);
      break;
    }
  }
  found.lower = state.lower;
  finish(scene_, bodies, options_, found, rooms_, answer);
}

}  // namespace clearance
