// Places and movements of the bodies in spans of a motion.
#include <algorithm>

#include "engine/decision/motion_decider.h"

namespace clearance {

namespace {

constexpr double kUp = 1 + 0x1p-20, kDown = 1 - 0x1p-20;  // more than the rounding of these sums to float32

Vec3d turned_by(const Pose& X, const Vec3d& v) {
  return turned(Quaternion<double>{X.qw, X.qx, X.qy, X.qz}, v);
}

SpanTwist within_half(const Twist& twist, double half) {
  const auto number = [&](double x) { return static_cast<float>(x * half); };
  return {{number(twist.turn.x), number(twist.turn.y), number(twist.turn.z)},
          {number(twist.shift.x), number(twist.shift.y), number(twist.shift.z)}};
}

}  // namespace

// Takes the positions in the middles of spans.
void MotionDecider::place(std::span<const Span> spans) {
  const std::size_t joints = plan_.joints.size();
  rows_.resize(spans.size() * joints);
  middles_.clear();
  for (std::size_t k = 0; k < spans.size(); ++k) {
    middles_.push_back(spans[k].middle);
    if (!curves_.empty()) {
      take_middle(spans[k], &rows_[k * joints]);
      continue;
    }
    for (std::size_t j = 0; j < joints; ++j)
      rows_[k * joints + j] = start_[j] + spans[k].middle * (end_[j] - start_[j]);
  }
  for (std::size_t m = 0; m < plan_.motions.size(); ++m)
    for (const LinkMotion::Moving& moving : plan_.motions[m].moving())
      for (std::size_t k = 0; k < spans.size(); ++k)
        positions_[m][moving.column].lane[k] = rows_[k * joints + moving.at];
  are_links_placed_ = false;
}

// Velocity and place of a body in the middle of a span, in the common frame.
void MotionDecider::take_twist(std::uint32_t b) {
  const DecidedBody& body = covers_.view().bodies[b];
  if (body.carrier != kNone) {  // fixed to its carrier
    const Vec3d offset = turned_by(in_frame_[body.carrier], body.constant.translation);
    const Twist& carrier = twists_[body.carrier];
    twists_[b] = {carrier.turn, carrier.shift + cross(carrier.turn, offset)};
    origins_[b] = origins_[body.carrier] + offset;
  } else if (body.pose != kNone) {
    const Pose& X = poses_[body.pose];
    const CoverPlan::LinkOf& of = covers_.link_of(b);
    const Twist own = of.robot == kNone ? given_.twist(body.pose, X) : link_twists_[links_begin_[of.robot] + of.link];
    twists_[b] = body.is_direct ? own : Twist{turned_by(body.constant, own.turn), turned_by(body.constant, own.shift)};
    in_frame_[b] = body.is_direct ? X : compose(body.constant, X);
    origins_[b] = in_frame_[b].translation;
  }
}

// Velocities of the bodies in the middle of a span.
void MotionDecider::take_twists(double middle) {
  for (std::size_t m = 0; m < robots_.size(); ++m) {
    const std::size_t links = plan_.motions[m].robot().kinematics.links();
    robots_[m].at(std::span(links_).subspan(links_begin_[m], links), along_[m],
                  std::span(link_twists_).subspan(links_begin_[m], links));
  }
  const DecisionView& view = covers_.view();
  for (std::uint32_t b = 0; b < view.body_count; ++b) {
    const DecidedBody& body = view.bodies[b];
    if (!body.packets && (body.pose == kNone || body.carrier != kNone)) continue;  // it is not decided, nor carries any
    take_twist(b);
    if (!body.packets) continue;
    bound_body(b, given_.growth(body.pose, middle, half_));
    bodies_[b].twist = within_half(twists_[b], half_);
    bodies_[b].grown = static_cast<float>(given_.least_growth(body.pose, middle) * kDown);
  }
}

// Bounds a body's movement within half a span.
// \param growth of the body, metres
void MotionDecider::bound_body(std::uint32_t b, double growth) {
  const SpanRates::Rates& rates = rates_[b];
  const double bend = rates.motion.acceleration * (0.5 * half_ * half_) + rates.twist_error * half_;
  growths_[b] = growth;
  bodies_[b].way = static_cast<float>((rates.motion.speed * half_ + growth) * kUp);
  bodies_[b].bend = static_cast<float>((bend + growth) * kUp);
}

Twist MotionDecider::twist_of(std::uint32_t body, std::size_t k) const {
  if (!all_in_lanes_) return twists_[body];
  const CoverPlan::LinkOf& of = covers_.link_of(body);
  return lanes_[of.robot].twist(of.link, k);
}

Vec3d MotionDecider::origin_of(std::uint32_t body, std::size_t k) const {
  if (!all_in_lanes_) return origins_[body];
  const CoverPlan::LinkOf& of = covers_.link_of(body);
  return lanes_[of.robot].pose(of.link, k).translation;
}

PairSpan MotionDecider::pair_span(void* self, std::size_t k, std::uint32_t pair) {
  return static_cast<MotionDecider*>(self)->pair_span(k, pair);
}

// Movement of a pair in a span that is placed.
PairSpan MotionDecider::pair_span(std::size_t k, std::uint32_t index) {
  const MovedPair& pair = covers_.view().moved_pairs[index];
  std::optional<SpanRates::PairRates>& known = pair_rates_[index];
  std::vector<SpanRates::View>& views = views_[index];
  if (views.empty()) views = covers_.rates()->views_of(pair);
  if (!known) known = covers_.rates()->of_pair(views, changes_);
  const SpanRates::PairRates rates = *known;
  const auto seen = [&](std::uint32_t body) -> Twist {
    if (rates.seer == kNone) return twist_of(body, k);
    if (rates.seer == body) return {};
    const Twist own = twist_of(body, k), seer = twist_of(rates.seer, k);
    const Vec3d apart = origin_of(body, k) - origin_of(rates.seer, k);
    return {own.turn - seer.turn, own.shift - (seer.shift + cross(seer.turn, apart))};
  };
  const double error = (rates_[pair.a].twist_error + rates_[pair.b].twist_error) * 2,
               growth = growths_[pair.a] + growths_[pair.b],
               grown = double{bodies_[pair.a].grown} + bodies_[pair.b].grown;
  return {within_half(seen(pair.a), half_), within_half(seen(pair.b), half_),
          static_cast<float>((rates.speed * half_ + growth) * kUp),
          static_cast<float>((rates.acceleration * (0.5 * half_ * half_) + error * half_ + growth) * kUp),
          static_cast<float>(grown * kDown)};
}

}  // namespace clearance
