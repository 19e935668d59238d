#include "engine/evaluate/evaluate.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "engine/hull/primitive.h"
#include "engine/narrow/witness.h"

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
// Tolerances of elements and parts where bodies have many. If each were only known to a wider one, many would be rivals
// of the nearest, and a wide tolerance would cost more than a narrow one; it only ends the search sooner (gather()).
// Besides, no distance becomes a contact because of a wide tolerance.
constexpr double kMostAbsTol = 1e-6, kMostRelTol = 0x1p-6;

}  // namespace

// Computes points whenever there are surfaces: normals guide their search, and bounds must not depend on the columns.
NarrowOptions Evaluator::narrow_options(const engine::Scene& scene, NarrowOptions options) {
  if (!scene.has_surfaces()) return options;
  options.want_points = true;
  options.limits.abs_tol = std::min(options.limits.abs_tol, kMostAbsTol);
  options.limits.rel_tol = std::min(options.limits.rel_tol, kMostRelTol);
  return options;
}

bool is_unusable(const engine::Scene& scene, const BodyPoses& placement, BodyPair pair) {
  for (const std::uint32_t body : {pair.a, pair.b})
    if (body >= scene.bodies().size() || placement[body].status != Status::kOk) return true;
  return false;
}

std::uint16_t pose_flags(const BodyPoses& placement, BodyPair pair) {
  std::uint16_t flags = placement[pair.a].renormalised || placement[pair.b].renormalised ? kFlagRenormalised : 0;
  if (placement[pair.a].beyond_limits || placement[pair.b].beyond_limits) flags |= kFlagBeyondLimits;
  return flags;
}

double box_gap(const engine::Scene& scene, const BodyPoses& placement, BodyPair pair) {
  const std::size_t n = scene.bodies().size();
  if (pair.a >= n || pair.b >= n) return kInf;
  const Aabb *a = placement.known_box(pair.a), *b = placement.known_box(pair.b);
  if (a && b) return certify_box_gap(*a, *b);
  return certify_box_gap(placement.box(pair.a), placement.box(pair.b));
}

namespace {

// Writes the flags of a pair's bodies, and its answer if that does not depend on the parts.
bool answer_without_parts(const engine::Scene& scene, const PlacedBodies& bodies, const EvaluateOptions& options,
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
  return answer_without_parts(
      placement[pair.a].status, placement[pair.b].status, flags, options.cull, bodies.max_distance,
      [&] { return box_gap(scene, placement, pair); }, answer);
}

}  // namespace

PairAnswer unusable_answer(const engine::Scene& scene, const BodyPoses& placement, BodyPair pair,
                           const EvaluateOptions& options) {
  assert(is_unusable(scene, placement, pair));
  PairAnswer answer;
  answer_without_parts(scene, {pair, &placement, kInf}, options, answer);
  return answer;
}

namespace {

// Writes the answer of single parts that converged in lanes: apart, and within tolerance or beyond max_distance.
void take_lane(const EvaluateOptions& options, const PartTask& task, const LaneAnswer& lane, const CoreWitness& witness,
               const PlacedBodies& bodies, PairAnswer& answer) {
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
  answer.part_a = answer.part_b = 0;
  take_lane_witness(*task.a, R_wa, *task.b, R_wb, witness, answer.point_a, answer.point_b, answer.normal);
  if (answer.status == Status::kBeyond)
    answer.point_a = answer.point_b = no_point();
  else if (options.want_flags && is_nonsmooth(answer.lower, *task.a, R_wa, *task.b, R_wb, answer.normal,
                                              normal_angle(*task.a, *task.b, lane.lower, lane.upper)))
    answer.flags |= kFlagNonsmooth;
}

// Bound on the number of bodies in pairs; a body in two configurations counts twice.
std::size_t most_bodies(const engine::Scene& scene, std::span<const PlacedBodies> pairs) {
  const bool one_placement =
      std::all_of(pairs.begin(), pairs.end(), [&](const PlacedBodies& p) { return p.placement == pairs[0].placement; });
  return one_placement ? std::min(2 * pairs.size(), scene.bodies().size()) : 2 * pairs.size();
}

}  // namespace

// The answer holds the flags of the bodies already.
void Evaluator::finish(const PlacedBodies& bodies, double max_distance, const BodiesAnswer& found, PairAnswer& answer) {
  NarrowLimits limits = options_.limits;
  limits.max_distance = max_distance;
  const NarrowAnswer& best = found.best;
  const double lower = found.lower;
  const Body &a = scene_.bodies()[bodies.pair.a], &b = scene_.bodies()[bodies.pair.b];
  const PoseMatrix &pose_a = (*bodies.placement)[bodies.pair.a].pose, &pose_b = (*bodies.placement)[bodies.pair.b].pose;

  if (best.bounds.upper == kInf && lower == -kInf) return replace_answer(answer, unproved_answer());
  if (options_.want_points) {
    answer.part_a = found.a.part;
    answer.part_b = found.b.part;
    answer.point_a = best.point_a;
    answer.point_b = best.point_b;
    answer.normal = best.normal;
  }
  const auto rounding = [&] {
    if (found.best.rounding > 0) return found.best.rounding;
    return rounding_of(*a.parts[found.a.part], pose_a, *b.parts[found.b.part], pose_b);
  };
  const Slack slack = pair_slack(*bodies.placement, bodies.pair);
  const double upper = best.bounds.upper;
  assert(lower <= upper);
  assert(found.a.part < a.parts.size() && found.b.part < b.parts.size());
  decide(limits, lower, upper, rounding, answer, slack);
  const bool of_several = a.parts.size() > 1 || b.parts.size() > 1;
  if (limits.signed_distance && of_several && upper <= 0) answer.flags |= kFlagPieces;
  if (!options_.want_flags || answer.status == Status::kBeyond) return;
  const ConvexPart &part_a = part_of(a, found.a, scratch_[0]), &part_b = part_of(b, found.b, scratch_[1]);
  if (is_nonsmooth(answer.lower, part_a, pose_a.R_wb, part_b, pose_b.R_wb, best.normal,
                   normal_angle(part_a, part_b, best.bounds.lower, best.bounds.upper)))
    answer.flags |= kFlagNonsmooth;
}

void Evaluator::begin(std::span<const PlacedBodies> pairs, std::span<PairAnswer> answers) {
  assert(answers.size() >= pairs.size());
  pairs_ = pairs;
  answers_ = answers;
  next_ = singles_ = 0;
  in_round_ = gathering_ = false;
  tasks_.clear();
  searches_.clear();
  again_.clear();
}

bool Evaluator::advance(WorkMeter& meter) {
  while (in_round_ || begin_round(meter)) {
    in_round_ = true;
    const auto is_single = [&](const PartTask& task) {
      return static_cast<std::size_t>(&task - tasks_.data()) < singles_;
    };
    const bool answered = batch_.advance(
        meter,
        [&](const PartTask& task, const LaneAnswer& lane, const CoreWitness& witness) {
          if (is_single(task))
            take_lane(options_, task, lane, witness, pairs_[task.id], answers_[task.id]);
          else
            found_[task.id] = batch_.converged_answer(task, lane, witness);
        },
        [&](const PartTask& task, const NarrowAnswer& answer) {
          if (is_single(task))
            finish(pairs_[task.id], pairs_[task.id].max_distance, {answer, answer.bounds.lower}, answers_[task.id]);
          else
            found_[task.id] = answer;
        });
    if (!answered) return false;
    in_round_ = false;
    std::size_t taken = 0;
    for (PairSearch& s : searches_) {
      take_round(s, stop_below(pairs_[s.index], s.slack), std::span(found_).subspan(taken, s.task_count));
      taken += s.task_count;
    }
    assert(taken == found_.size());
    if ((!searches_.empty() || next_ < pairs_.size()) && meter.is_over()) return false;
  }
  return !gathering_;
}

// Puts the next part pairs into tasks_. Returns false without any: all pairs are answered, or the slice is over
// (gathering_).
bool Evaluator::begin_round(WorkMeter& meter) {
  if (!gathering_) {
    tasks_.clear();
    singles_ = 0;
  }
  do {
    if (!gathering_ && searches_.empty()) take_in(meter);
    gathering_ = true;
    for (PairSearch& s : searches_)
      if (s.elements && !gather(s, meter)) return false;
    gathering_ = false;
    std::erase_if(searches_, [&](PairSearch& s) {
      if (add_tasks(s)) return false;
      finish_search(s, meter);
      return true;
    });
  } while (tasks_.empty() && (next_ < pairs_.size() || !again_.empty()));
  if (tasks_.empty()) return false;
  found_.resize(tasks_.size() - singles_);
  batch_.begin(tasks_);
  return true;
}

// Takes in pairs: single parts become tasks, other pairs searches, and some are answered at once.
void Evaluator::take_in(WorkMeter& meter) {
  part_pairs_.clear();
  std::size_t elements = 0;
  for (; !again_.empty() && elements < kMostElementSearches; again_.pop_back(), ++elements)
    begin_element_search(again_.back(), pairs_[again_.back()].max_distance_alone);
  for (; next_ < pairs_.size() && part_pairs_.size() < kMostPartPairs; ++next_) {
    const auto i = static_cast<std::uint32_t>(next_);
    const BodyPair pair = pairs_[i].pair;
    const BodyPoses& placement = *pairs_[i].placement;
    if (answer_without_parts(scene_, pairs_[i], options_, answers_[i])) continue;
    const std::vector<ConvexPartPtr>&a = scene_.bodies()[pair.a].parts, &b = scene_.bodies()[pair.b].parts;
    assert(!a.empty() && !b.empty());
    // A half-space's distance depends on the body's hull alone, which every body but a cloud has.
    const bool by_hulls = (is_half_space(*a[0]) && !is_cloud(scene_.bodies()[pair.b])) ||
                          (is_half_space(*b[0]) && !is_cloud(scene_.bodies()[pair.a]));
    if (a.size() == 1 && b.size() == 1 && (by_hulls || (!a[0]->surface && !b[0]->surface))) {
      const Slack slack = pair_slack(placement, pair);
      tasks_.push_back({a[0].get(), b[0].get(), &placement[pair.a].pose, &placement[pair.b].pose,
                        slack.cut_off(pairs_[i].max_distance), i, slack.outer, stop_below(pairs_[i], slack)});
    } else if (!by_hulls && scene_.has_surfaces() &&
               (has_surface(scene_.bodies()[pair.a]) || has_surface(scene_.bodies()[pair.b]))) {
      if (elements++ == kMostElementSearches) break;
      begin_element_search(i, pairs_[i].max_distance);
    } else {
      if (searches_.empty()) boxes_.expect(most_bodies(scene_, pairs_));
      begin_search(pairs_[i], i, meter);
    }
  }
  singles_ = tasks_.size();
}

}  // namespace clearance
