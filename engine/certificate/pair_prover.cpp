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

void MotionMoment::move_to(double time) {
  if (time == time_) return;
  time_ = time;
  const Instant instant{moving_, time, time};
  ConfigurationPoses::PoseBlock given = poses_.at({&instant, 1});
  given.errors = moving_->errors;
  rotations_.resize(plan_.bodies.size());
  rotations_of(given.poses, rotations_);
  placed_.configure(moments_++, given, rotations_);
  twists_.resize(plan_.moved.size());
  poses_.twists(0, placed_, twists_);
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
  const Span& span = left_.back();
  moment_.move_to(span.middle());
  moment_.restrict_to(bounds_, span.begin, span.end);
  rates_ = bounds_.rates(position_, pair_, moment_.moving(), moment_.placed());
  growth_ = bounds_.growth(pair_, moment_.moving(), span.middle());
  slack_ = pair_slack(moment_.placed(), pair_);
  slack_.inner = sum_above(slack_.inner, growth_.most);
  way_ = way_of_pair(rates_, span.half());
  i_ = j_ = 0;
  halves_ = {};
  claims_.clear();
  has_begun_span_ = true;
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
  const double middle = span.middle();
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

// Lower bounds on the pair's distance in either half of the span, along a direction in world axes.
// \param p, q null for all parts
PairProver::Halves PairProver::by_direction(const Vec3d& n, const ConvexPart* p, const ConvexPart* q) const {
  const BodyPoses& here = moment_.placed();
  const double half = left_.back().half();
  const auto moving_body = [&](std::uint32_t body, const ConvexPart* part) {
    return MovingBody{scene_.bodies()[body], here[body].pose,
                      bounds_.twist_before(rates_.seer, body, moment_.twists(), here), nullptr, part};
  };
  MovingBody b = moving_body(pair_.b, q);
  // Growth brings the bodies nearer along every direction.
  if (growth_.any()) b.twist.shift = b.twist.shift - n * (growth_.slope / norm(n));
  const HalfSpans gaps = gaps_along(n, moving_body(pair_.a, p), b, half, bend_of_pair(rates_, half));
  const double less = (slack_.inner + rates_.drift * half) * (1 + 0x1p-40);
  return {difference_below(gaps.before, less) >= lower_, difference_below(gaps.after, less) >= lower_};
}

}  // namespace clearance
