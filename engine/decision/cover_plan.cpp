#include "engine/decision/cover_plan.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/decision/cover_plan_builder.h"

namespace clearance {

using namespace cover_plan;

namespace {

// Limits on pairs. Jobs of many are not kept for other configurations, and have a tree of boxes.
constexpr std::uint64_t kFewPairs = 4096, kMostPairs = 1u << 17;
// A plan takes 0.1 us a pair, and saves 1 to 5 us a state.
constexpr std::uint64_t kPairsPerState = 16, kManyPairsPerState = 4;

/// Bound on the distance of a ball's centre, placed in float32, from its place. A rounded quaternion turns by 2 units
/// and stretches by 2; each entry of its rotation has 5 more, so that the rotation is off by less than 22 units in the
/// Frobenius norm. Each coordinate of the centre is a sum of three products and one more term: 9 units of the reach and
/// 4 of the translation, which is rounded by one.
double centre_error(double reach, double farthest) {
  return kUnit * (40 * reach + 8 * farthest);
}

// Makes the quaternion a unit, but for 2^-51 of its length.
void normalize(Pose& X) {
  if (const double length = detail::quaternion_norm(X); length > 0)
    for (double* q : {&X.qw, &X.qx, &X.qy, &X.qz}) *q /= length;
}

}  // namespace

std::unique_ptr<const CoverPlan> CoverPlanBuilder::build() {
  if (!take_slides() || !take_frame() || !take_bodies()) return nullptr;
  find_reach();
  take_errors();
  if (plan_.query.max_evaluations > 0 && !take_sources()) return nullptr;
  for (std::uint64_t p = 0; p < plan_.pairs.size(); ++p)
    if (!is_known(p)) take(p);
  if (2 * out_->unknown_.size() > plan_.pairs.size()) return nullptr;
  if (obstacle_pairs_.empty() && out_->moved_pairs_.empty()) return nullptr;
  if (plan_.query.max_evaluations > 0)
    out_->rates_ = std::make_unique<const SpanRates>(plan_, sources_, static_cast<std::uint32_t>(out_->bodies_.size()));
  finish();
  return std::move(out_);
}

// Joints that slide have a limit; the others turn at most.
bool CoverPlanBuilder::take_slides() {
  for (const LinkMotion& motion : plan_.motions) {
    const SceneRobot& robot = motion.robot();
    for (const KinematicStep& step : robot.kinematics.steps()) {
      using Kind = KinematicStep::Kind;
      const std::uint32_t count = step.kind == Kind::kSliding ? 1 : step.kind == Kind::kPlanar ? 2 : 0;
      for (std::uint32_t c = step.column; c < step.column + count; ++c) {
        const double most = most_travel(robot.model.columns[c]);
        const auto& moving = motion.moving();
        const auto it = std::find_if(moving.begin(), moving.end(), [&](const auto& m) { return m.column == c; });
        if (it != moving.end())
          out_->slides_.push_back({it->at, most});
        else if (!(std::abs(motion.positions()[c]) <= most))
          return false;
      }
    }
  }
  return true;
}

// The common frame is that of the body, not moved itself, that carries the first link, or the first body without links.
bool CoverPlanBuilder::take_frame() {
  const auto moves = [&](std::uint32_t b) {
    return std::find(plan_.moved.begin(), plan_.moved.end(), b) != plan_.moved.end();
  };
  frame_body_ = snapshot_.parent[plan_.bodies[plan_.motions.empty() ? 0 : plan_.given_bodies]];
  while (frame_body_ != kNone && moves(frame_body_)) frame_body_ = snapshot_.parent[frame_body_];
  if (frame_body_ == kNone) return true;
  if (snapshot_.placed[frame_body_].status != Status::kOk) return false;
  const PoseMatrix& frame = snapshot_.placed[frame_body_].pose;
  frame_inverse_ = inverse(frame.X_wb);
  frame_inverse_rotation_ = rotation_of(frame_inverse_);
  R_wf_ = frame.R_wb;
  return true;
}

bool CoverPlanBuilder::has_pose(std::uint32_t b, const DecidedBody& decided) const {
  const std::uint32_t parent = snapshot_.parent[b];
  if (decided.carrier != kNone ? !has_pose_[decided.carrier]
                               : parent != kNone && snapshot_.placed[parent].status != Status::kOk)
    return false;
  return snapshot_.placed[b].status != Status::kStalePose &&
         (decided.pose != kNone || (snapshot_.given[b] && check(snapshot_.local[b]) != PoseQuality::kBad));
}

bool CoverPlanBuilder::take_bodies() {
  for (const std::uint32_t b : std::span(plan_.bodies).first(plan_.given_bodies))
    out_->most_distance_.push_back(SlackBounds::most_distance(snapshot_.local[b]));
  bool any = false;
  for (const std::uint32_t b : plan_.moved) {
    const Body& body = scene_.bodies()[b];
    const auto given = std::find(plan_.bodies.begin(), plan_.bodies.end(), b);
    DecidedBody decided{};
    decided.pose = given == plan_.bodies.end() ? kNone : static_cast<std::uint32_t>(given - plan_.bodies.begin());
    slot_[b] = static_cast<std::uint32_t>(out_->bodies_.size());
    take_link(b, decided);
    has_pose_.push_back(has_pose(b, decided));
    const bool has_shape = !body.parts.empty() && (!is_cloud(body) || body.cloud == CloudState::kPoints);
    const bool is_usable = has_pose_.back() && has_shape;
    out_->covers_.push_back(is_usable ? store_.find(body.parts) : nullptr);
    any |= out_->covers_.back() != nullptr;
    add(decided);
  }
  if (any) take_still_meshes();
  return any;
}

// Adds a decided body, whose cover is the last one.
void CoverPlanBuilder::add(DecidedBody& decided) {
  const Cover* const cover = out_->covers_.back().get();
  decided.packets = cover ? cover->packets.data() : nullptr;
  decided.root_packets = cover ? cover->level_begin[2] : 0;
  out_->bodies_.push_back(decided);
}

// Meshes that stay where they are are bodies with covers, too. They are no obstacles, which are convex.
void CoverPlanBuilder::take_still_meshes() {
  if (!scene_.has_surfaces()) return;
  for (std::uint64_t p = 0; p < plan_.pairs.size(); ++p) {
    if (is_known(p)) continue;
    const BodyPair pair = plan_.pairs.at(p);
    for (const std::uint32_t b : {pair.a, pair.b})
      if (b < slot_.size() && slot_[b] == kNone && out_->bodies_.size() < kMostDecidedBodies) take_still_mesh(b);
  }
}

void CoverPlanBuilder::take_still_mesh(std::uint32_t b) {
  const Body& body = scene_.bodies()[b];
  const BodyPlacement& placed = snapshot_.placed[b];
  if (placed.status != Status::kOk || is_cloud(body) || !has_surface(body)) return;
  std::shared_ptr<const Cover> cover = store_.find(body.parts);
  if (!cover) return;
  DecidedBody decided{};
  decided.pose = decided.carrier = kNone;
  decided.constant = in_frame(placed.pose.X_wb);
  if (check(decided.constant) == PoseQuality::kBad) return;
  normalize(decided.constant);
  decided.farthest = norm(decided.constant.translation) * (1 + 0x1p-40);
  slot_[b] = static_cast<std::uint32_t>(out_->bodies_.size());
  world_.push_back(norm(frame_inverse_.translation) + norm(placed.pose.t_w));
  out_->covers_.push_back(std::move(cover));
  add(decided);
}

// How a body is placed in the common frame.
void CoverPlanBuilder::take_link(std::uint32_t b, DecidedBody& decided) {
  const std::uint32_t parent = snapshot_.parent[b];
  const bool is_carried = parent != kNone && slot_[parent] != kNone;
  decided.carrier = is_carried ? slot_[parent] : kNone;
  Pose constant = decided.pose == kNone ? snapshot_.local[b] : Pose{};
  double before = 0, world = is_carried ? world_[decided.carrier] : 0;
  if (!is_carried && parent != frame_body_) {  // another robot's frame
    const Pose X_wp = parent == kNone ? Pose{} : snapshot_.placed[parent].pose.X_wb;
    const Pose frame = in_frame(X_wp);
    constant = decided.pose == kNone ? compose(frame, constant) : frame;
    before = norm(frame.translation);
    world = norm(frame_inverse_.translation) + norm(X_wp.translation);
  }
  normalize(constant);
  world_.push_back(world);
  decided.constant = constant;
  decided.is_direct = decided.pose != kNone && !is_carried && parent == frame_body_;
  decided.farthest = (slack_.farthest(slot_[b]) + before) * (1 + 0x1p-40);
  if (is_carried) decided.farthest += out_->bodies_[decided.carrier].farthest;
}

void CoverPlanBuilder::find_reach() {
  for (std::size_t i = 0; i < out_->bodies_.size(); ++i)
    if (cover(static_cast<std::uint32_t>(i)))
      reach_ = std::max(
          reach_, (out_->bodies_[i].farthest * std::sqrt(3.0) + cover(static_cast<std::uint32_t>(i))->reach) * 1.001);
}

void CoverPlanBuilder::take_errors() {
  for (std::size_t i = 0; i < out_->bodies_.size(); ++i) {
    const Cover* const c = cover(static_cast<std::uint32_t>(i));
    errors_.push_back(c ? centre_error(c->reach, std::sqrt(3.0) * out_->bodies_[i].farthest) + kWorldUnit * world_[i]
                        : 0);
  }
}

// What moves the bodies during motions. Returns false for a body that is neither a link of a robot that stays, nor given,
// nor fixed to one of these.
bool CoverPlanBuilder::take_sources() {
  const auto is_base = [](const DecidedBody& body) { return body.pose != kNone && body.carrier == kNone; };
  for (std::uint32_t i = 0; i < out_->bodies_.size(); ++i) {
    const DecidedBody& decided = out_->bodies_[i];
    const bool is_fixed = decided.carrier != kNone && decided.pose == kNone;
    const std::uint32_t of = is_fixed ? decided.carrier : i;
    CoverPlan::LinkOf& link = out_->links_.emplace_back();
    if (!cover(i) && !is_base(decided)) continue;
    if (decided.carrier == kNone && decided.pose == kNone) continue;  // it stays
    if (!is_base(out_->bodies_[of])) return false;
    const std::uint32_t pose = out_->bodies_[of].pose;
    const bool is_given = pose < plan_.given_bodies;
    const Body& body = scene_.bodies()[plan_.moved[of]];
    for (std::uint32_t m = 0; m < plan_.motions.size(); ++m)
      if (body.robot != kNone && &plan_.motions[m].robot() == scene_.robots()[body.robot].get()) link = {m, body.link};
    if (link.robot == kNone && !is_given) return false;
    if (!cover(i)) continue;
    const std::array<float, 3>& middle = cover(i)->root.centre;
    LinkBall ball{{middle[0], middle[1], middle[2]}, cover(i)->spread};
    if (is_fixed) {
      ball.centre = rotation_of(decided.constant) * ball.centre + decided.constant.translation;
      ball.radius = ball.radius * (1 + 0x1p-40) + 0x1p-40 * (cover(i)->reach + norm(decided.constant.translation));
    }
    SpanRates::Source source{i, link.robot, link.link, ball, {}};
    if (is_given)
      source.given = pose, source.farthest = out_->most_distance_[pose];
    else
      source.path = MotionPath(plan_.motions[link.robot].robot().kinematics, link.link, ball);
    sources_.push_back(std::move(source));
    errors_[i] += SpanRates::rounding(plan_, sources_.back());
  }
  return true;
}

std::unique_ptr<const CoverPlan> CoverPlan::make(const engine::Scene& scene, const Plan& plan, const CoverStore& covers,
                                                 const JointTableStore* tables, std::span<const std::uint64_t> known) {
  return CoverPlanBuilder(scene, plan, covers, tables, known).build();
}

bool CoverPlan::may_decide(const Plan& plan) {
  const QueryView& query = plan.query;
  const std::uint64_t pairs = plan.pairs.size();
  if (query.configuration_count == 0 || plan.bodies.empty() || pairs == 0) return false;
  if (plan.moved.size() > kMostDecidedBodies) return false;
  return pairs <= kFewPairs || (query.reduce == Reduce::kAny && pairs <= kMostPairs &&
                                pairs <= kManyPairsPerState * query.configuration_count);
}

bool CoverPlan::pays_at_once(const Plan& plan) {
  return plan.pairs.size() <= kPairsPerState * plan.query.configuration_count;
}

bool CoverPlan::take_given(std::span<Pose> poses) const {
  for (std::size_t m = 0; m < most_distance_.size(); ++m) {
    if (check(poses[m]) == PoseQuality::kBad || !(norm(poses[m].translation) <= most_distance_[m])) return false;
    normalize(poses[m]);
  }
  return true;
}

bool CoverPlan::holds_for(std::span<const double> positions) const {
  return std::all_of(slides_.begin(), slides_.end(),
                     [&](const SlideLimit& s) { return std::abs(positions[s.at]) <= s.most; });
}

}  // namespace clearance
