#include "engine/certificate/pair_prover.h"

#include <algorithm>
#include <limits>

#include "engine/hull/primitive.h"

namespace clearance {

namespace {

// Shortest half of a span. A search ends at 2^-40 (motion_search.cpp), where the speed over so short a time may use up
// almost all of the bound; spans cut at other times than the search's must be shorter.
constexpr double kLeastHalf = 0x1p-46;
constexpr std::uint32_t kMostSpans = 1u << 14;
constexpr std::uint64_t kUnitsPerMoment = 64, kUnitsPerSpanProof = 64;

}  // namespace

void MotionMoment::begin(MovingBodies& moving) {
  poses_.find_end_facts(moving);
  moving_ = &moving;
  time_ = -1;
}

void MotionMoment::move_to(double begin, double time, double end) {
  if (moving_->curves.empty()) begin = end = time;  // all spans have the same velocities
  if (begin == begin_ && time == time_ && end == end_) return;
  begin_ = begin, time_ = time, end_ = end;
  const Instant instant{moving_, begin, time, end};
  ConfigurationPoses::PoseBlock given = poses_.at({&instant, 1});
  given.errors = moving_->errors;
  rotations_.resize(plan_.bodies.size());
  rotations_of(given.poses, rotations_);
  placed_.configure(moments_++, given, rotations_);
  for (int side = 0; side < 2; ++side) {
    twists_[side].resize(plan_.moved.size());
    poses_.twists(0, side, placed_, twists_[side]);
  }
}

PairProver::PairProver(const engine::Scene& scene, const MotionBounds& bounds, const EvaluateOptions& options,
                       MotionMoment& moment, std::uint64_t position, BodyPair pair, double lower, double until,
                       CertificateText& text)
    : scene_(scene),
      bounds_(bounds),
      moment_(moment),
      position_(position),
      pair_(pair),
      a_(scene.bodies()[pair.a]),
      b_(scene.bodies()[pair.b]),
      lower_(lower),
      text_(text),
      limits_(options.limits),
      left_{{0, until}} {
  limits_.max_distance = std::numeric_limits<double>::infinity();
  if (surface_of(a_) || surface_of(b_)) cover_.emplace(a_, b_);
}

// Starts the current span.
void PairProver::begin_span() {
  Span& span = left_.back();
  span.at =
      is_curved() ? middle_of_length(moment_.moving().curves, span.begin, span.end) : 0.5 * span.begin + 0.5 * span.end;
  moment_.move_to(span.begin, span.at, span.end);
  take_rates();
  slack_ = pair_slack(moment_.placed(), pair_);
  slack_.inner = sum_above(slack_.inner, growth_.most);
  i_ = j_ = 0;
  halves_ = {};
  claims_.clear();
  has_begun_span_ = true;
}

void PairProver::take_rates() {
  const Span& span = left_.back();
  bounds_.take_sides(span.begin, span.at, span.end, moment_.moving());
  rates_ = bounds_.rates(position_, pair_, moment_.moving(), moment_.placed());
  rest_ = bounds_.rest(position_, pair_, moment_.moving(), rates_.seer);
  growth_ = bounds_.growth(pair_, moment_.moving(), span.at);
  reach_ = is_curved() ? 1 : span.half();
  way_ = way_of_pair(rates_, reach_);
}

// Processes one more pair of convex parts. Returns true once a span is proved and can be written.
bool PairProver::step(WorkMeter& meter) {
  if (!has_begun_span_) {
    begin_span();
    meter.count(kUnitsPerMoment * (1 + a_.parts.size() * b_.parts.size() / 16));
    if (try_boxes()) {
      end_span({});
      return true;
    }
    if (cover_) {
      cover_->begin();
      if (is_too_near_somewhere(meter)) {
        end_span({false, false});
        return false;
      }
    }
  }
  if (cover_) return step_cover(meter);
  meter.count(kUnitsPerSpanProof + WorkMeter::units_of(*a_.parts[i_], *b_.parts[j_]));
  const Halves now = try_parts(*a_.parts[i_], *b_.parts[j_], {i_, j_, {}}, true);
  halves_.before &= now.before;
  halves_.after &= now.after;
  if (halves_.any()) {
    if (++j_ == b_.parts.size()) j_ = 0, ++i_;
    if (i_ < a_.parts.size()) return false;
  }
  const bool proved = halves_.any();
  end_span(halves_);
  return proved;
}

// Returns true if nothing is proved of the nearest elements: then the span cannot be proved either.
bool PairProver::is_too_near_somewhere(WorkMeter& meter) {
  const BodyPoses& here = moment_.placed();
  nearest_.begin(a_, here[pair_.a].pose, b_, here[pair_.b].pose);
  ElementPair near;
  nearest_.take_near(std::numeric_limits<double>::infinity(), near);
  ConvexPart storage_a, storage_b;
  const ConvexPart &p = part_of(a_, near.a, storage_a), &q = part_of(b_, near.b, storage_b);
  meter.count(kUnitsPerSpanProof + WorkMeter::units_of(p, q));
  const bool is_proved = try_parts(p, q, {0, 0, {}}, true).any();
  claims_.clear();
  return !is_proved;
}

// Processes two parts of non-convex bodies.
bool PairProver::step_cover(WorkMeter& meter) {
  const PairCover::Parts parts = cover_->parts();
  meter.count(kUnitsPerSpanProof);
  Halves now{false, false};
  const std::size_t claims = claims_.size();
  if (parts.are_parts()) {
    meter.count(WorkMeter::units_of(*parts.a, *parts.b));
    now = try_parts(*parts.a, *parts.b, parts.claim, parts.are_elements);
  }
  if (parts.are_elements || (now.before && now.after)) {
    cover_->pop();
    halves_.before &= now.before;
    halves_.after &= now.after;
  } else {  // smaller parts may be provable in both halves
    claims_.resize(claims);
    cover_->halve();
  }
  if (halves_.any() && !cover_->is_done()) return false;
  const bool proved = halves_.any();
  end_span(halves_);
  return proved;
}

// Queues the unproved half or halves next.
void PairProver::end_span(const Halves& proved) {
  const Span span = left_.back();
  const double middle = span.at;
  left_.pop_back();
  has_begun_span_ = false;
  if (!proved.after) left_.push_back({middle, span.end});
  if (!proved.before) left_.push_back({span.begin, middle});
  has_failed_ = !left_.empty() && (++spans_ > kMostSpans || span.half() <= kLeastHalf || way_ == 0);
  proved_.begin = proved.before ? span.begin : middle;
  proved_.end = proved.after ? span.end : middle;
  proved_.at = middle;
}

void PairProver::write(SpanPlace place) {
  place.begin = proved_.begin;
  place.end = proved_.end;
  place.at = proved_.at;
  const bool is_along = std::any_of(claims_.begin(), claims_.end(), [](const PartProof& p) { return p.order == 2; });
  if (is_curved() && is_along)
    for (int side = 0; side < 2; ++side) place.progress[side] = moment_.moving().sides.progress(side);
  text_.begin_span(pair_, place);
  for (const PartProof& claim : claims_) text_.add_lower(claim);
  text_.end_span();
}

// Direction between the bodies' boxes, or the normal of a half-space, in world axes.
Vec3d PairProver::towards_b() const {
  const BodyPoses& here = moment_.placed();
  const auto normal = [&](std::uint32_t body) { return here[body].pose.R_wb * Vec3d{0, 0, 1}; };
  if (is_half_space(*a_.parts[0])) return normal(pair_.a);
  if (is_half_space(*b_.parts[0])) return -normal(pair_.b);
  return between(here.box(pair_.a), here.box(pair_.b));
}

// Tries this direction for all parts.
bool PairProver::try_boxes() {
  const BodyPoses& here = moment_.placed();
  const Vec3d n = towards_b();
  if (n.x == 0 && n.y == 0 && n.z == 0) return false;
  PartProof all{kNone, kNone, {}, 1, rates_.speed_seer};
  const PoseMatrix &pose_a = here[pair_.a].pose, &pose_b = here[pair_.b].pose;
  double least = std::numeric_limits<double>::infinity();
  for (const ConvexPartPtr& p : a_.parts)
    for (const ConvexPartPtr& q : b_.parts) least = std::min(least, lower_along(*p, pose_a, *q, pose_b, n, all.proof));
  if (!by_speed(least)) {
    const Halves along = by_direction(n, nullptr, nullptr);
    if (way_ == 0 || !along.before || !along.after) return false;
    all.order = 2;
    all.seer = rates_.seer;
  }
  claims_ = {all};
  return true;
}

// \param claim the parts that it is about
// \param in_all_ways tries all attempts, and not only the first that may suffice
PairProver::Halves PairProver::try_parts(const ConvexPart& p, const ConvexPart& q, PartProof claim, bool in_all_ways) {
  const PoseMatrix &pose_a = moment_.placed()[pair_.a].pose, &pose_b = moment_.placed()[pair_.b].pose;
  claim.seer = rates_.speed_seer;
  NarrowLimits limits = limits_;
  limits.min_penetration = slack_.outer;
  const std::array<NarrowLimits, 4> attempts = proof_attempts(limits);
  // Spans of moving parts are halved until only the distance itself is uncertain, so it is computed to full accuracy
  // first.
  for (std::size_t k = way_ > 0 ? 2 : 0; k < (in_all_ways ? attempts.size() : 3); ++k) {
    const NarrowAnswer found = narrow_phase_proved(p, pose_a, q, pose_b, attempts[k], claim.proof);
    if (by_speed(found.bounds.lower)) {
      claims_.push_back(claim);
      return {};
    }
    if (way_ == 0) continue;
    const auto& n_a = claim.proof.direction;
    Halves halves{false, false};
    if (found.bounds.lower > 0) halves = by_direction(pose_a.R_wb * Vec3d{n_a.x.hi, n_a.y.hi, n_a.z.hi}, &p, &q);
    claim.order = 2;
    claim.seer = rates_.seer;
    if (halves.any()) claims_.push_back(claim);
    return halves;
  }
  return {false, false};
}

// Whether a direction in world axes proves the span until either end.
// \param p, q null for all parts
PairProver::Halves PairProver::by_direction(const Vec3d& n, const ConvexPart* p, const ConvexPart* q) const {
  return {is_proved_along(n, p, q, 0), is_proved_along(n, p, q, 1)};
}

bool PairProver::is_proved_along(const Vec3d& n, const ConvexPart* p, const ConvexPart* q, int side) const {
  const BodyPoses& here = moment_.placed();
  const auto moving_body = [&](std::uint32_t body, const ConvexPart* part) {
    return MovingBody{scene_.bodies()[body], here[body].pose,
                      bounds_.twist_before(rates_.seer, body, moment_.twists(side), here), nullptr, part};
  };
  MovingBody b = moving_body(pair_.b, q);
  // Growth brings the bodies nearer along every direction.
  if (growth_.any()) b.twist.shift = b.twist.shift - n * (growth_.slope[side] / norm(n));
  const HalfSpans gaps = gaps_along(n, moving_body(pair_.a, p), b, reach_, bend_of_pair(rates_, reach_) - rest_);
  const double less = (slack_.inner + rest_ + rates_.drift * reach_) * (1 + 0x1p-40);
  // The progress of a curve is positive on both sides.
  return difference_below(side == 0 && !is_curved() ? gaps.before : gaps.after, less) >= lower_;
}

}  // namespace clearance
