#include "engine/decision/motion_decider.h"

#include <algorithm>
#include <cmath>

#include "engine/decision/state_lanes.h"

namespace clearance {

MotionDecider::MotionDecider(const CoverPlan& covers, const Plan& plan)
    : covers_(covers), plan_(plan), kernel_(decision_kernels()[0]), given_(plan) {
  const std::size_t columns = covers.view().columns;
  for (const LinkMotion& motion : plan.motions) {
    is_placed_ &= are_placed(motion);
    robots_.emplace_back(motion.robot().kinematics);
    std::vector<DoubleInLanes>& positions = positions_.emplace_back();
    for (const double position : motion.positions()) std::fill_n(positions.emplace_back().lane, kMostLanes, position);
    lanes_.emplace_back(motion.robot().kinematics);
    along_.emplace_back(motion.robot().model.columns.size());
    changes_.change.emplace_back(motion.robot().model.columns.size());
    links_begin_.push_back(links_of_span_);
    links_of_span_ += motion.robot().kinematics.links();
  }
  if (plan.query.control_points > 2) changes_.bend = changes_.change;
  all_in_lanes_ = plan.query.control_points <= 2 && plan.given_bodies == 0;
  rates_.resize(columns);
  twists_.resize(columns);
  origins_.resize(columns);
  in_frame_.resize(columns);
  growths_.resize(columns);
  bodies_.resize(columns);
  reach_.resize(plan.joints.size());
  is_left_.resize(covers.view().moved_pair_count);
  pair_rates_.resize(covers.view().moved_pair_count);
  views_.resize(covers.view().moved_pair_count);
  link_twists_.resize(links_of_span_);
  links_.resize(links_of_span_);
  poses_.resize(plan.bodies.size());
  for (std::uint32_t b = 0; b < covers.view().body_count; ++b) {
    const CoverPlan::LinkOf& of = covers.link_of(b);
    const bool moves = of.robot != kNone;
    body_frames_.push_back(moves ? lanes_[of.robot].frames()[of.link].part[0].lane : nullptr);
    body_twists_.push_back(moves ? lanes_[of.robot].twists()[of.link].part[0].lane : nullptr);
    all_in_lanes_ &= moves && covers.view().bodies[b].is_direct;
  }
  open_.resize(std::size_t{covers.view().obstacle_count} * columns + covers.view().moved_pair_count);
}

// Takes the motion's positions. Returns false if the bounds do not hold for them.
bool MotionDecider::begin(std::uint64_t motion) {
  if (!is_placed_) return false;
  const std::size_t joints = plan_.joints.size(), points = plan_.query.control_points;
  const std::span<const double> all = plan_.positions.subspan(points * motion * joints, points * joints);
  start_ = all.first(joints);
  end_ = all.last(joints);
  const auto is_small = [](double q) { return std::abs(q) <= SpanRates::kMostPosition; };
  if (!std::all_of(all.begin(), all.end(), is_small)) return false;
  for (std::size_t p = 0; p < points; ++p)
    if (!covers_.holds_for(all.subspan(p * joints, joints))) return false;
  if (plan_.given_bodies > 0 && !given_.begin(covers_, motion)) return false;
  total_ = points > 2 ? 0 : given_.length();
  if (points > 2) {
    begin_curves();
    return true;
  }
  for (std::size_t m = 0; m < plan_.motions.size(); ++m)
    for (const LinkMotion::Moving& moving : plan_.motions[m].moving()) {
      const double by = end_[moving.at] - start_[moving.at];
      along_[m][moving.column] = by;
      changes_.change[m][moving.column] = std::abs(by) * kMotionSlack;
      total_ += std::abs(by);
    }
  given_.take_span({}, changes_.given);
  has_rates_ = false;
  return true;
}

// Takes the rates of the motion, or of a span that changes_ are of.
void MotionDecider::take_rates() {
  for (std::uint32_t b = 0; b < covers_.view().body_count; ++b)
    if (covers_.view().bodies[b].packets) rates_[b] = covers_.rates()->of(b, changes_);
  std::fill(pair_rates_.begin(), pair_rates_.end(), std::nullopt);
  has_rates_ = true;
}

Verdict MotionDecider::decide(std::uint64_t motion) {
  left_.clear();
  if (!begin(motion)) return Verdict::kUnresolved;
  const double half = begin_spans();
  if (hits_again()) return Verdict::kHit;
  const Verdict verdict = decide_spans(half);
  return verdict == Verdict::kUnresolved && is_hit_at_first() ? Verdict::kHit : verdict;
}

// Lists the first spans, and places their middles and some states more. Returns half the length of the spans.
double MotionDecider::begin_spans() {
  std::size_t count = 1;
  double half = 0.5;
  for (; count < kTogether && half * total_ > kRootSpan; count *= 2) half *= 0.5;
  spans_.clear();
  items_.clear();
  for (std::size_t i = 0; i < count; ++i) spans_.push_back({static_cast<double>(2 * i + 1) * half, 0, 0});
  if (!curves_.empty()) cut_curves();
  std::reverse(spans_.begin(), spans_.end());  // most motions begin free, so that the last span hits most often
  first_ = spans_;
  for (std::size_t i = 1; curves_.empty() && i <= count && first_.size() < kTogether; ++i)
    first_.push_back({static_cast<double>(i) / static_cast<double>(count), 0, 0});
  place(first_);
  return half;
}

Verdict MotionDecider::decide_spans(double half) {
  std::fill(is_left_.begin(), is_left_.end(), 0);
  divided_ = 0;
  bool is_first = true;
  for (half_ = half; !spans_.empty(); half_ *= 0.5) {
    for (std::size_t j = 0; j < reach_.size(); ++j) reach_[j] = std::abs(end_[j] - start_[j]) * half_ * kMotionSlack;
    next_.clear();
    next_items_.clear();
    is_undecided_ = has_lanes_ = false;
    for (std::size_t first = 0; first < spans_.size(); first += kTogether) {
      const auto together = std::span(spans_).subspan(first, std::min(kTogether, spans_.size() - first));
      if (!is_first) place(together);
      is_first = false;
      if (decide_placed(together)) return Verdict::kHit;
    }
    if (is_undecided_) {
      left_.clear();
      return Verdict::kUnresolved;
    }
    std::swap(spans_, next_);
    std::swap(items_, next_items_);
  }
  return leave_pairs();
}

// Decides the spans that were placed last, or the first of those. Returns whether one hits.
bool MotionDecider::decide_placed(std::span<const Span> spans) {
  const double* const rows = rows_.data();
  const std::size_t joints = plan_.joints.size();
  SpanBatch batch{&covers_.view(), nullptr,         0,          bodies_.data(), nullptr,      nullptr,
                  half_,           poses_.data(),   &pair_span, &take,          this,         open_.data(),
                  open_.size(),    is_left_.data(), rows,       joints,         reach_.data()};
  inputs_.clear();
  for (const Span& span : spans)
    inputs_.push_back({span.begin == span.end ? nullptr : &items_[span.begin], span.end - span.begin});
  is_hit_ = false;
  placed_ = spans;
  if (all_in_lanes_) {
    decide_in_lanes(batch);
    return is_hit_;
  }
  batch.count = 1;
  for (std::size_t k = 0; k < spans.size() && !is_hit_; ++k) {
    if (!curves_.empty())
      take_curves(spans[k], half_);
    else if (!has_rates_)
      take_rates();
    take_poses(k);
    take_twists(middles_[k]);
    placed_ = spans.subspan(k, 1);
    batch.spans = &inputs_[k];
    batch.positions = rows + k * joints;
    first_placed_ = k;
    kernel_.run_spans(batch);
  }
  return is_hit_;
}

// Decides all spans that are placed, which are lanes.
void MotionDecider::decide_in_lanes(SpanBatch& batch) {
  if (!has_rates_) take_rates();
  place_links();
  for (std::size_t m = 0; m < lanes_.size(); ++m) lanes_[m].take_twists(along_[m]);
  if (!has_lanes_)
    for (std::uint32_t b = 0; b < covers_.view().body_count; ++b) bound_body(b, 0);
  has_lanes_ = true;
  batch.spans = inputs_.data();
  batch.count = inputs_.size();
  batch.frames = body_frames_.data();
  batch.twists = body_twists_.data();
  kernel_.run_spans(batch);
}

bool MotionDecider::take(void* self, std::size_t k, const SpanDecision& decision) {
  return static_cast<MotionDecider*>(self)->take(k, decision);
}

// Takes the decision on a span that is placed. Returns false after a hit.
bool MotionDecider::take(std::size_t k, const SpanDecision& decision) {
  is_hit_ = decision.verdict == Verdict::kHit;
  if (is_hit_)
    remember(decision.hit, first_placed_ + k);
  else if (decision.verdict == Verdict::kUnresolved && decision.open == 0)
    is_undecided_ = true;
  else if (decision.verdict == Verdict::kUnresolved)
    divide(placed_[k], decision.open, half_ > kLeastSpan && ++divided_ <= kMostSpans);
  return !is_hit_;
}

// Passes the open items of a span on to both halves. Leaves those to the exact engine for which that is useless.
void MotionDecider::divide(const Span& span, std::size_t open, bool may_divide) {
  const DecisionView& view = covers_.view();
  const std::size_t begin = next_items_.size();
  for (const SpanItem& item : std::span(open_).first(open)) {
    if (may_divide && !item.is_near) {
      next_items_.push_back(item);
      continue;
    }
    if (item.obstacle == kNone) is_left_[item.at] = 1;
    const std::uint64_t position = item.obstacle == kNone
                                       ? view.moved_pairs[item.at].position
                                       : view.position[std::size_t{item.obstacle} * view.columns + item.at];
    left_.push_back({position, span.middle - half_, span.middle + half_});
  }
  if (next_items_.size() == begin) return;
  for (const double side : {-0.5, 0.5}) next_.push_back({span.middle + side * half_, begin, next_items_.size()});
  if (!curves_.empty()) keep_halves();
}

// Lists each open pair once, with the time from its first open span to its last.
Verdict MotionDecider::leave_pairs() {
  for (const std::uint64_t position : covers_.unknown()) left_.push_back({position, 0, 1});
  std::sort(left_.begin(), left_.end(), [](const OpenPair& a, const OpenPair& b) { return a.position < b.position; });
  std::size_t kept = 0;
  for (const OpenPair& open : left_) {
    if (kept > 0 && left_[kept - 1].position == open.position) {
      OpenPair& same = left_[kept - 1];
      same.begin = std::min(same.begin, open.begin);
      same.end = std::max(same.end, open.end);
    } else {
      left_[kept++] = open;
    }
  }
  left_.resize(kept);
  return left_.empty() ? Verdict::kFree : Verdict::kUnresolved;
}

}  // namespace clearance
