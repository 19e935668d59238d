#include "engine/motion/motion_block.h"

#include <algorithm>
#include <cassert>
#include <utility>

namespace clearance {

namespace {

constexpr double kRough = 0.02;   // relative to a distance
constexpr double kFiner = 0.125;  // share of the tolerance that a single pair must meet
constexpr std::uint64_t kMostMotions = 64;
constexpr std::uint64_t kMostPairs = 1u << 16;  // pairs times motions of a block
constexpr std::uint64_t kMostPlaces = 64;       // configurations that are placed together
constexpr std::uint64_t kTogether = 2;          // spans of one motion
constexpr std::uint64_t kBlocksPerWorker = 4;   // minimum, if there are several workers
constexpr std::uint64_t kBodiesPerUnit = 2;     // bodies placed per unit of work
constexpr std::uint64_t kPairsPerUnit = 32;     // pairs bounded per unit of work

}  // namespace

void set_motion_options(const Plan& plan, EvaluateOptions& options) {
  options.cull = !options.reference;
  options.want_points = true;  // for the separating directions
  if (plan.query.reduce != Reduce::kAny) {
    options.limits.abs_tol *= kFiner;
    options.limits.rel_tol *= kFiner;
  }
  options.limits.max_distance = std::numeric_limits<double>::infinity();
}

std::uint64_t MotionBlock::most(const Plan& plan, int workers) {
  const std::uint64_t shares = workers > 1 ? kBlocksPerWorker * static_cast<std::uint64_t>(workers) : 1;
  return std::clamp<std::uint64_t>(
      std::min(kMostPairs / std::max<std::uint64_t>(plan.size.pairs, 1), plan.size.configurations / shares), 1,
      kMostMotions);
}

MotionBlock::MotionBlock(const MotionQuery& motion_query, const EvaluateOptions& options, std::span<const Aabb> boxes,
                         std::uint64_t most)
    : motion_query_(motion_query), evaluator_(motion_query.scene, options), boxes_(boxes), poses_(motion_query.plan) {
  if (motion_query.plan.query.reduce == Reduce::kAny && !options.reference) {
    EvaluateOptions rough = options;
    rough.limits.rel_tol = std::max(rough.limits.rel_tol, kRough);
    rough_.emplace(motion_query.scene, rough);
  }
  searches_.reserve(most);
  const std::uint64_t places =
      std::min({kMostPlaces, kTogether * most, BodyPoses::most(motion_query.scene, motion_query.plan)});
  placements_.reserve(places);
  places_.resize(places);
}

void MotionBlock::begin_searches(std::uint64_t count) {
  assert(count > 0 && count <= searches_.capacity());
  while (searches_.size() < count) searches_.emplace_back(motion_query_);
  count_ = count;
  is_evaluating_ = false;
}

void MotionBlock::begin_search(std::uint64_t i, const OpenMotion& motion) {
  motion_query_.bounds.take(motion.motion, searches_[i].moving);
  poses_.find_end_facts(searches_[i].moving);
  searches_[i].begin(motion.open);
}

void MotionBlock::count_begun(WorkMeter& meter) const {
  meter.count(count_ *
              (motion_query_.plan.moved.size() / kBodiesPerUnit + motion_query_.plan.size.pairs / kPairsPerUnit + 1));
}

bool MotionBlock::advance(WorkMeter& meter) {
  while (true) {
    if (!is_evaluating_) {
      if (!collect_pairs(meter)) return true;
      answers_.resize(std::max(answers_.size(), to_evaluate_.size()));
      is_rough_ = rough_.has_value();
      (is_rough_ ? *rough_ : evaluator_).begin(to_evaluate_, answers_);
      is_evaluating_ = true;
    }
    if (!(is_rough_ ? *rough_ : evaluator_).advance(meter)) return false;
    if (std::exchange(is_rough_, false) && refine()) continue;
    for (std::size_t i = 0; i < undecided_at_.size(); ++i) answers_[undecided_at_[i]] = fine_answers_[i];
    undecided_at_.clear();
    is_evaluating_ = false;
    take();
    if (meter.is_over()) return false;
  }
}

// Selects pairs that the coarse pass could not place on either side of their targets. Returns false if there are none.
bool MotionBlock::refine() {
  undecided_.clear();
  for (std::size_t i = 0; i < to_evaluate_.size(); ++i) {
    const PairAnswer answer = grown_answer(answers_[i], requests_[i].growth);
    if (!(answer.lower <= requests_[i].target && answer.upper > requests_[i].target)) continue;
    undecided_.push_back(to_evaluate_[i]);
    undecided_at_.push_back(i);
  }
  if (undecided_.empty()) return false;
  fine_answers_.resize(undecided_.size());
  evaluator_.begin(undecided_, fine_answers_);
  return true;
}

// Collects the next spans of as many searches as fit, in turn. The number for each search is fixed, so that a motion's
// rows do not depend on the other motions. Returns false once all searches are done.
bool MotionBlock::collect_pairs(WorkMeter& meter) {
  used_ = 0;
  instants_.clear();
  const std::size_t together = std::min<std::size_t>(kTogether, places_.size());
  for (std::size_t i = 0; i < count_ && used_ + together <= places_.size(); ++i, ++turn_) {
    MotionSearch& search = searches_[turn_ % count_];
    for (std::size_t k = 0; k < together && !search.is_done() && search.next(places_[used_].node); ++k) {
      places_[used_].search = &search;
      const MotionSearch::Node& node = places_[used_].node;
      instants_.push_back({&search.moving, node.begin, node.at, node.end});
      ++used_;
    }
  }
  if (used_ == 0) return false;
  place(meter);
  to_evaluate_.clear();
  requests_.clear();
  for (std::size_t k = 0; k < used_; ++k) {
    places_[k].search->collect_pairs(places_[k].node, places_[k].moment(placements_[k]), to_evaluate_, requests_);
    places_[k].end = to_evaluate_.size();
  }
  meter.count(to_evaluate_.size() / kPairsPerUnit);
  return true;
}

void MotionBlock::place(WorkMeter& meter) {
  const std::size_t bodies = motion_query_.plan.bodies.size();
  const ConfigurationPoses::PoseBlock given = poses_.at(instants_);
  rotations_.resize(used_ * bodies);
  rotations_of(given.poses, rotations_);
  while (placements_.size() < used_) placements_.emplace_back(motion_query_.scene, motion_query_.plan, boxes_);
  for (std::size_t k = 0; k < used_; ++k) {
    ConfigurationPoses::PoseBlock own = given.of(k, bodies);
    own.errors = instants_[k].moving->errors;
    placements_[k].configure(placed_++, own, std::span(rotations_).subspan(k * bodies, bodies));
    for (int side = 0; side < poses_.sides(); ++side) {
      places_[k].twists[side].resize(motion_query_.plan.moved.size());
      poses_.twists(k, side, placements_[k], places_[k].twists[side]);
    }
  }
  meter.count(used_ * motion_query_.plan.moved.size() / kBodiesPerUnit + used_);
}

void MotionBlock::take() {
  std::size_t begin = 0;
  for (std::size_t k = 0; k < used_; ++k) {
    const std::size_t count = places_[k].end - begin;
    places_[k].search->take(places_[k].node, places_[k].moment(placements_[k]),
                            std::span(requests_).subspan(begin, count), std::span(answers_).subspan(begin, count));
    begin = places_[k].end;
  }
}

std::uint64_t MotionBlock::end(std::vector<MotionRow>& rows) {
  std::uint64_t evaluated = 0;
  for (std::size_t i = 0; i < count_; ++i) {
    searches_[i].append_rows(rows);
    evaluated += searches_[i].evaluated();
  }
  count_ = 0;
  return evaluated;
}

}  // namespace clearance
