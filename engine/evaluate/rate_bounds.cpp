#include "engine/evaluate/rate_bounds.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/evaluate/part_gap.h"
#include "engine/hull/primitive.h"
#include "engine/hull/support.h"

namespace clearance {

namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();
constexpr double kRounding = 0x1p-44;     // of the sums below, relative to the lengths in them
constexpr double kUp = 1 + 0x1p-48;       // covers products and roots of positive numbers
constexpr double kLengthError = 0x1p-50;  // of a computed unit vector's square
constexpr double kRelTol = 1e-12;         // of the distances that bound the nearest points
constexpr double kNarrow = 1e-11;         // of answers that need no better one
constexpr double kMostSteps = 1024;       // sizes that the parts move by within the time of the bounds
constexpr std::uint64_t kPairsPerUnit = 16;

double core_size(const ConvexPart& part) {
  return is_half_space(part) ? 0 : part.rho;
}

// Upper bound on the speed of a point up to `size` from the body's origin.
double speed_of(const Vec3d& shift, const Vec3d& turn, double size) {
  return (norm(shift) + (size > 0 ? norm(turn) * size : 0)) * kUp;
}

}  // namespace

// Directions of the supports: unit times the velocity's part of the normal, and its proposed change.
struct PartRate::Lean {
  Vec3d a, b;    // normal x turn
  Vec3d normal;  // change of the normal
};

PartRate::PartRate(const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b, const PoseMatrix& pose_b,
                   const Vec3d& normal, std::optional<FeaturePair> features, double upper, double inner)
    : a_(a),
      b_(b),
      pose_a_(pose_a),
      pose_b_(pose_b),
      normal_(normal * (1 / norm(normal))),
      away_(pose_b.t_w - pose_a.t_w),
      features_(std::move(features)),
      upper_(sum_above(sum_above(upper, a.radius), b.radius)),
      inner_(inner),
      size_a_(core_size(a)),
      size_b_(core_size(b)) {
  gap_ = gap_at(0, {}, {});
  if (!(gap_ > 0) || !(upper_ > 0)) return;
  const double cosine = std::min(gap_ / upper_ * (1 - 0x1p-50), 1.0);
  normal_error_ = std::sqrt(2 * (1 - cosine) + kLengthError) * kUp;
}

// Lower bound on d . (p_b - p_a) + time * normal . (v_b - v_a) over all points of the true cores, d being the normal
// with its change.
double PartRate::gap_at(double time, const PairMotion& motion, const Lean& lean) const {
  const Vec3d shift = motion.shift_b - motion.shift_a, d = normal_ + lean.normal * time;
  const Vec3d along_a = d + lean.a * time, along_b = d + lean.b * time;
  const double reach_a = reach_of_core(a_, pose_a_.R_wb.transpose_times(along_a)),
               reach_b = reach_of_core(b_, pose_b_.R_wb.transpose_times(-along_b));
  const double longest = std::max({norm(d), norm(along_a), norm(along_b)});
  const double error = kRounding * (longest * (size_a_ + size_b_ + norm(away_)) +
                                    std::abs(time) * (norm(motion.shift_a) + norm(motion.shift_b)));
  const double gap = (dot(d, away_) + time * dot(normal_, shift)) - reach_a - reach_b;
  return difference_below(difference_below(gap, error), longest * inner_ * kUp);
}

// Upper bound on the relative speed of any two points of the true cores.
double PartRate::fastest(const PairMotion& motion) const {
  const auto turns = [](const ConvexPart& part, const Vec3d& turn) { return is_half_space(part) && norm(turn) > 0; };
  if (turns(a_, motion.turn_a) || turns(b_, motion.turn_b)) return kInfinite;
  return speed_of(motion.shift_b - motion.shift_a, {0, 0, 0}, 0) * kUp +
         speed_of({0, 0, 0}, motion.turn_a, size_a_ + inner_) + speed_of({0, 0, 0}, motion.turn_b, size_b_ + inner_);
}

// Bounds by one proposal of how the normal changes.
Interval PartRate::by(const Lean& lean, const PairMotion& motion, double most) const {
  const double sizes = size_a_ + size_b_ + norm(away_), bend = norm(lean.a) + norm(lean.b) + norm(lean.normal);
  const double excess = std::max(upper_ - gap_, kRounding * sizes);
  const double time = std::min(std::sqrt(excess / (upper_ + size_a_ + size_b_)) / bend, kMostSteps * sizes / most);
  if (!(time > 0) || !std::isfinite(time)) return within(most);
  const auto slowest = [&](double t) {  // of +- normal . (v_b - v_a), by the sign of t
    const double longest = norm(normal_ + lean.normal * t) * upper_ * kUp;
    return difference_below(gap_at(t, motion, lean), longest) / time;
  };
  const double error = (normal_error_ * most + kRounding * most) * kUp;
  const Interval found{difference_below(slowest(time), error), sum_above(-slowest(-time), error)};
  return found.is_possible() ? found : within(most);
}

Interval PartRate::of(const PairMotion& motion) const {
  const double most = fastest(motion) * kUp;
  Interval all = within(most);
  if (!(gap_ > 0) || !std::isfinite(most) || most == 0) return all;
  Lean lean{cross(normal_, motion.turn_a), cross(normal_, motion.turn_b), {0, 0, 0}};
  const bool can_lean = features_ && !is_half_space(a_) && !is_half_space(b_);
  for (const bool begin_with_a : {false, true}) {  // each is valid
    const Vec3d last = lean.normal;
    if (can_lean) lean.normal = features_->lean(lean.a, lean.b, begin_with_a);
    if (begin_with_a && norm(lean.normal - last) <= 1e-9 * norm(last)) break;
    const Interval one = by(lean, motion, most);
    all = {std::max(all.lower, one.lower), std::min(all.upper, one.upper)};
  }
  return all.is_possible() ? all : within(most);
}

RateBounds::RateBounds(const Body& a, const PoseMatrix& pose_a, const Body& b, const PoseMatrix& pose_b,
                       const PairAnswer& answer, const std::optional<FeaturePair>& features, const Slack& slack,
                       WorkMeter& meter)
    : a_(a), b_(b), pose_a_(pose_a), pose_b_(pose_b), inner_(slack.inner) {
  if (features) take_parts(answer, features, slack, meter);
}

// Keeps all pairs of parts that may have nearest points.
void RateBounds::take_parts(const PairAnswer& answer, const std::optional<FeaturePair>& features, const Slack& slack,
                            WorkMeter& meter) {
  WorkMeter narrow;
  const auto nearest = [&](std::uint32_t i, std::uint32_t j, double most) {
    const ConvexPart &part_a = *a_.parts[i], &part_b = *b_.parts[j];
    NarrowLimits limits;
    limits.rel_tol = kRelTol;
    limits.abs_tol = 4 * rounding_of(part_a, pose_a_, part_b, pose_b_);
    limits.max_distance = most;
    limits.signed_distance = answer.upper < 0;
    return narrow_phase(part_a, pose_a_, part_b, pose_b_, limits, nullptr, &narrow);
  };
  double upper = answer.upper;
  Vec3d normal = answer.normal;
  if (!std::isfinite(upper) || upper - answer.lower > kNarrow * upper + slack.inner + slack.outer) {
    const NarrowAnswer first = nearest(answer.part_a, answer.part_b, kInfinite);
    upper = std::min(upper, slack.true_upper(first.bounds.upper));
    normal = first.normal;
  }
  const auto add = [&](std::uint32_t i, std::uint32_t j, const Vec3d& toward, std::optional<FeaturePair> of) {
    PartRate part(*a_.parts[i], pose_a_, *b_.parts[j], pose_b_, toward, std::move(of), upper, slack.inner);
    if (!(part.gap() > part.upper())) parts_.push_back(std::move(part));
  };
  add(answer.part_a, answer.part_b, normal, features);
  meter.count(std::uint64_t{a_.parts.size()} * b_.parts.size() / kPairsPerUnit);
  for (std::uint32_t i = 0; i < a_.parts.size(); ++i)
    for (std::uint32_t j = 0; j < b_.parts.size(); ++j) {
      if (i == answer.part_a && j == answer.part_b) continue;
      if (part_gap(*a_.parts[i], pose_a_, *b_.parts[j], pose_b_) > slack.cut_off(upper)) continue;
      if (parts_.size() >= kMostParts || narrow.spent() > kMostUnits) {
        parts_.clear();
        meter.count(narrow.spent());
        return;
      }
      const NarrowAnswer other = nearest(i, j, slack.cut_off(upper));
      if (other.beyond) continue;
      const ConvexPart &part_a = *a_.parts[i], &part_b = *b_.parts[j];
      const WitnessPoints start{other.point_a - other.normal * part_a.radius,
                                other.point_b + other.normal * part_b.radius + (pose_b_.t_w - pose_a_.t_w)};
      narrow.count(FeaturePair::units_to_find(part_a, part_b));
      add(i, j, other.normal, FeaturePair::find(part_a, pose_a_, part_b, pose_b_, start, other.normal, false));
    }
  meter.count(narrow.spent());
}

Interval RateBounds::of(const PairMotion& motion, WorkMeter& meter) const {
  meter.count(1 + parts_.size());
  if (parts_.empty())
    return within((speed_of(motion.shift_a, motion.turn_a, a_.reach + inner_) +
                   speed_of(motion.shift_b, motion.turn_b, b_.reach + inner_)) *
                  kUp);
  Interval all{kInfinite, -kInfinite};
  for (const PartRate& part : parts_) {
    const Interval one = part.of(motion);
    if (!one.is_possible()) return within(kInfinite);
    all = {std::min(all.lower, one.lower), std::max(all.upper, one.upper)};
  }
  return all;
}

}  // namespace clearance
