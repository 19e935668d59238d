#include "engine/decision/cover_plan.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "engine/decision/slack_bounds.h"
#include "engine/pose/pose.h"

namespace clearance {

namespace {

constexpr double kUnit = 0x1p-24;           // unit roundoff of float32
constexpr std::uint64_t kMostPairs = 4096;  // more have a tree of boxes, which finds the near ones sooner
constexpr float kNever = -BallPacket::kNoRadius;

float up(double value) {
  const float rounded = static_cast<float>(value);
  return rounded < value ? std::nextafterf(rounded, std::numeric_limits<float>::infinity()) : rounded;
}
float down(double value) {
  return -up(-value);
}

/// Bound on the distance of a ball's centre, placed in float32, from its place. A rounded quaternion turns by 2 units
/// and stretches by 2; each entry of its rotation has 5 more, so that the rotation is off by less than 22 units in the
/// Frobenius norm. Each coordinate of the centre is a sum of three products and one more term: 9 units of the reach and
/// 4 of the translation, which is rounded by one.
double centre_error(double reach, double farthest) {
  return kUnit * (40 * reach + 8 * farthest);
}

/// A ball that holds the body's points and the centres of all balls.
LinkBall ball_of_centres(const Cover& cover) {
  const auto& c = cover.root.centre;
  LinkBall ball{{c[0], c[1], c[2]}, cover.root.outer};
  for (const BallPacket& packet : cover.packets)
    for (std::uint32_t i = 0; i < packet.count; ++i)
      ball.radius =
          std::max(ball.radius, norm(Vec3d{packet.x[i], packet.y[i], packet.z[i]} - ball.centre) * (1 + 0x1p-48));
  return ball;
}

}  // namespace

/// Collects the parts of a CoverPlan.
class CoverPlanBuilder {
 public:
  CoverPlanBuilder(const engine::Scene& scene, const Plan& plan, const CoverStore& store, const JointTableStore* tables)
      : scene_(scene),
        plan_(plan),
        snapshot_(*plan.snapshot),
        store_(store),
        slack_(scene, plan),
        slot_(scene.bodies().size(), kNone),
        obstacle_of_(scene.bodies().size(), kUnseen) {
    out_->tables_ = TablePlan(scene, plan, slack_, tables);
  }

  std::unique_ptr<const CoverPlan> build() {
    if (!take_slides() || !take_bodies()) return nullptr;
    find_reach();
    take_errors();
    if (plan_.query.max_evaluations > 0 && !take_sources()) return nullptr;
    for (std::uint64_t p = 0; p < plan_.pairs.size(); ++p) take(p);
    if (2 * out_->unknown_.size() > plan_.pairs.size()) return nullptr;
    if (plan_.query.max_evaluations > 0)
      out_->rates_ = std::make_unique<const SpanRates>(
          plan_, sources_, static_cast<std::uint32_t>(out_->bodies_.size()), out_->moved_pairs_);
    finish();
    return std::move(out_);
  }

 private:
  static constexpr std::uint32_t kUnseen = kNone - 1;
  /// A pair of a moved body and an obstacle, which is one part of a body.
  struct ObstaclePair {
    std::uint32_t obstacle, body;
    std::uint64_t position;
    double margin;
    Slack slack;
  };

  bool take_slides();
  bool take_bodies();
  void take_link(std::uint32_t body, DecidedBody& decided);
  void find_reach();
  bool take_sources();
  void take_errors();
  std::uint32_t obstacles_of(std::uint32_t body);
  void take(std::uint64_t position);
  void take_moved(std::uint64_t position, std::uint32_t a, std::uint32_t b);
  void finish();
  const Cover* cover(std::uint32_t slot) const { return out_->covers_[slot].get(); }

  const engine::Scene& scene_;
  const Plan& plan_;
  const PoseSnapshot& snapshot_;
  const CoverStore& store_;
  const SlackBounds slack_;
  std::unique_ptr<CoverPlan> out_{new CoverPlan};
  std::uint32_t frame_body_ = kNone;        // carries the common frame, or kNone for the world's
  std::vector<std::uint32_t> slot_;         // by body: index in bodies_, or kNone
  std::vector<std::uint32_t> obstacle_of_;  // by body: first obstacle, kNone if it is none
  std::vector<std::uint32_t> parts_of_;     // by obstacle: count of the body's obstacles, at its first one
  std::vector<double> errors_;              // by moved body: centre_error()
  std::vector<SpanRates::Source> sources_;  // of motions
  std::vector<ObstaclePair> obstacle_pairs_;
  double reach_ = 0;      // of all moved bodies in the common frame
  Pose frame_inverse_{};  // the world in the common frame
};

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

bool CoverPlanBuilder::take_bodies() {
  frame_body_ = snapshot_.parent[plan_.bodies[0]];
  if (frame_body_ != kNone) {
    if (snapshot_.placed[frame_body_].status != Status::kOk) return false;
    frame_inverse_ = inverse(snapshot_.placed[frame_body_].pose.X_wb);
  }
  bool any = false;
  for (const std::uint32_t b : plan_.moved) {
    const Body& body = scene_.bodies()[b];
    const auto given = std::find(plan_.bodies.begin(), plan_.bodies.end(), b);
    DecidedBody decided{};
    decided.pose = given == plan_.bodies.end() ? kNone : static_cast<std::uint32_t>(given - plan_.bodies.begin());
    slot_[b] = static_cast<std::uint32_t>(out_->bodies_.size());
    take_link(b, decided);
    const bool is_usable = snapshot_.placed[b].status != Status::kStalePose && !is_cloud(body) && !body.parts.empty() &&
                           (decided.pose != kNone || snapshot_.given[b]);
    out_->covers_.push_back(is_usable ? store_.find(body.parts) : nullptr);
    const Cover* const cover = out_->covers_.back().get();
    any |= cover != nullptr;
    decided.packets = cover ? cover->packets.data() : nullptr;
    decided.root_packets = cover ? cover->level_begin[2] : 0;
    out_->bodies_.push_back(decided);
  }
  return any;
}

// How a body is placed in the common frame.
void CoverPlanBuilder::take_link(std::uint32_t b, DecidedBody& decided) {
  const std::uint32_t parent = snapshot_.parent[b];
  const bool is_carried = parent != kNone && slot_[parent] != kNone;
  decided.carrier = is_carried ? slot_[parent] : kNone;
  Pose constant = decided.pose == kNone ? snapshot_.local[b] : Pose{};
  double before = 0;
  if (!is_carried && parent != frame_body_) {  // another robot's frame
    const Pose X_wp = parent == kNone ? Pose{} : snapshot_.placed[parent].pose.X_wb;
    const Pose frame = frame_body_ == kNone ? X_wp : compose(frame_inverse_, X_wp);
    constant = decided.pose == kNone ? compose(frame, constant) : frame;
    before = norm(frame.translation);
  }
  if (const double length = detail::quaternion_norm(constant); length > 0)
    for (double* q : {&constant.qw, &constant.qx, &constant.qy, &constant.qz}) *q /= length;
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
    errors_.push_back(c ? centre_error(c->reach, std::sqrt(3.0) * out_->bodies_[i].farthest) : 0);
  }
}

// What moves the bodies during motions. Returns false for a body that is neither a link nor fixed to one.
bool CoverPlanBuilder::take_sources() {
  for (std::uint32_t i = 0; i < out_->bodies_.size(); ++i) {
    const DecidedBody& decided = out_->bodies_[i];
    const bool is_fixed = decided.carrier != kNone && decided.pose == kNone;
    const std::uint32_t of = is_fixed ? decided.carrier : i;
    CoverPlan::LinkOf& link = out_->links_.emplace_back();
    if (!cover(i) && !out_->bodies_[i].is_direct) continue;
    if (!out_->bodies_[of].is_direct) return false;
    const Body& body = scene_.bodies()[plan_.moved[of]];
    for (std::uint32_t m = 0; m < plan_.motions.size(); ++m)
      if (body.robot != kNone && &plan_.motions[m].robot() == scene_.robots()[body.robot].get()) link = {m, body.link};
    if (link.robot == kNone) return false;
    if (!cover(i)) continue;
    LinkBall ball = ball_of_centres(*cover(i));
    if (is_fixed) {
      ball.centre = rotation_of(decided.constant) * ball.centre + decided.constant.translation;
      ball.radius = ball.radius * (1 + 0x1p-40) + 0x1p-40 * (cover(i)->reach + norm(decided.constant.translation));
    }
    sources_.push_back({i, link.robot, link.link, ball});
    errors_[i] += SpanRates::rounding(plan_, sources_.back());
  }
  return true;
}

// The first of a body's obstacles; kNone for a body that balls cannot see.
std::uint32_t CoverPlanBuilder::obstacles_of(std::uint32_t b) {
  if (obstacle_of_[b] != kUnseen) return obstacle_of_[b];
  obstacle_of_[b] = kNone;
  const Body& body = scene_.bodies()[b];
  const BodyPlacement& placed = snapshot_.placed[b];
  if (placed.status != Status::kOk || is_cloud(body) || body.parts.empty()) return kNone;
  const Pose X = frame_body_ == kNone ? placed.pose.X_wb : compose(frame_inverse_, placed.pose.X_wb);
  if (check(X) == PoseQuality::kBad) return kNone;
  const Mat3d rotation = rotation_of(X);
  // The rounding of world coordinates, of which the common frame has differences.
  const double world_error = 0x1p-46 * (norm(frame_inverse_.translation) + norm(placed.pose.t_w));
  std::vector<Obstacle> obstacles;
  for (const ConvexPartPtr& part : body.parts) {
    const std::shared_ptr<const ObstacleShape> shape = store_.obstacle_shapes().of(part);
    if (!shape) return kNone;
    std::optional<Obstacle> obstacle = make_obstacle(*shape, rotation, X.translation, reach_);
    if (!obstacle) return kNone;
    obstacle->error = up(obstacle->error + world_error);
    obstacles.push_back(std::move(*obstacle));
  }
  obstacle_of_[b] = static_cast<std::uint32_t>(out_->obstacles_.size());
  parts_of_.resize(obstacle_of_[b] + obstacles.size());
  parts_of_[obstacle_of_[b]] = static_cast<std::uint32_t>(obstacles.size());
  for (Obstacle& obstacle : obstacles) out_->obstacles_.push_back(std::move(obstacle));
  return obstacle_of_[b];
}

void CoverPlanBuilder::take(std::uint64_t position) {
  const BodyPair pair = plan_.pairs.at(position);
  const auto slot_of = [&](std::uint32_t b) { return b < slot_.size() ? slot_[b] : kNone; };
  std::uint32_t a = slot_of(pair.a), b = slot_of(pair.b), other = pair.b;
  if (a != kNone && b != kNone) return take_moved(position, a, b);
  if (a == kNone) a = b, other = pair.a;
  const std::uint32_t first = a == kNone || other >= slot_.size() || !cover(a) ? kNone : obstacles_of(other);
  if (first == kNone) return out_->unknown_.push_back(position);
  const Slack slack = slack_.of(pair);
  for (std::uint32_t o = first; o < first + parts_of_[first]; ++o)
    obstacle_pairs_.push_back({o, a, position, plan_.margins.of(position), slack});
}

void CoverPlanBuilder::take_moved(std::uint64_t position, std::uint32_t a, std::uint32_t b) {
  if (!cover(a) || !cover(b)) return out_->unknown_.push_back(position);
  const BodyPair pair = plan_.pairs.at(position);
  const Slack slack = slack_.of(pair);
  const double margin = plan_.margins.of(position), sizes = double{cover(a)->root.outer} + cover(b)->root.outer;
  const double error = errors_[a] + errors_[b] + 8 * kUnit * (sizes + margin + 2 * reach_);
  out_->moved_pairs_.push_back({a, b, position, up((margin + slack.inner + error) * (1 + 0x1p-40)),
                                down(margin - (slack.outer + error) * (1 + 0x1p-40)), out_->tables_.at(position)});
}

// Columns of the kernel.
void CoverPlanBuilder::finish() {
  CoverPlan& out = *out_;
  const std::size_t columns = (out.bodies_.size() + BallPacket::kBalls - 1) / BallPacket::kBalls * BallPacket::kBalls,
                    cells = columns * out.obstacles_.size();
  for (auto* of_columns : {&out.root_x_, &out.root_y_, &out.root_z_}) of_columns->assign(columns, 0);
  for (auto* radii : {&out.moved_root_outer_, &out.moved_root_inner_}) radii->assign(columns, -kNever);
  for (std::size_t i = 0; i < out.bodies_.size(); ++i)
    if (const Cover* const c = out.covers_[i].get()) {
      out.root_x_[i] = c->root.centre[0], out.root_y_[i] = c->root.centre[1], out.root_z_[i] = c->root.centre[2];
      out.moved_root_outer_[i] = c->root.outer, out.moved_root_inner_[i] = c->root.inner;
    }
  const std::size_t moved =
      (out.moved_pairs_.size() + BallPacket::kBalls - 1) / BallPacket::kBalls * BallPacket::kBalls;
  for (auto* bodies : {&out.moved_a_, &out.moved_b_}) bodies->assign(moved, 0);
  out.moved_reach_.assign(moved, -kNever);
  for (std::size_t k = 0; k < out.moved_pairs_.size(); ++k) {
    const MovedPair& pair = out.moved_pairs_[k];
    out.moved_a_[k] = static_cast<std::int32_t>(pair.a), out.moved_b_[k] = static_cast<std::int32_t>(pair.b);
    out.moved_reach_[k] = up(double{cover(pair.a)->root.outer} + cover(pair.b)->root.outer + pair.grow);
  }
  for (auto* radii : {&out.root_outer_, &out.root_inner_, &out.grow_, &out.shrink_}) radii->assign(cells, -kNever);
  out.position_.assign(cells, 0);
  out.table_of_cell_.assign(cells, kNoTable);
  for (const std::uint64_t position : out.unknown_) out.tables_.disable(position);
  for (const ObstaclePair& p : obstacle_pairs_) {
    const CoverBall& root = cover(p.body)->root;
    const std::size_t at = p.obstacle * columns + p.body;
    const double error = errors_[p.body] + out.obstacles_[p.obstacle].error +
                         4 * kUnit * (double{root.outer} + std::abs(root.inner) + p.margin + p.slack.inner);
    const double grow = (p.margin + p.slack.inner + error) * (1 + 0x1p-40),
                 shrink = p.margin - (p.slack.outer + error) * (1 + 0x1p-40);
    out.grow_[at] = up(grow);
    out.shrink_[at] = down(shrink);
    out.root_outer_[at] = up(root.outer + grow);
    out.root_inner_[at] = down(root.inner + shrink);
    out.position_[at] = p.position;
    out.table_of_cell_[at] = out.tables_.at(p.position);
  }
  out.view_ = {out.bodies_.data(),
               static_cast<std::uint32_t>(out.bodies_.size()),
               static_cast<std::uint32_t>(columns),
               out.root_x_.data(),
               out.root_y_.data(),
               out.root_z_.data(),
               out.moved_root_outer_.data(),
               out.moved_root_inner_.data(),
               out.obstacles_.data(),
               static_cast<std::uint32_t>(out.obstacles_.size()),
               out.root_outer_.data(),
               out.root_inner_.data(),
               out.grow_.data(),
               out.shrink_.data(),
               out.position_.data(),
               out.moved_pairs_.data(),
               out.moved_a_.data(),
               out.moved_b_.data(),
               out.moved_reach_.data(),
               static_cast<std::uint32_t>(out.moved_pairs_.size()),
               out.table_of_cell_.data(),
               out.tables_.pairs().data(),
               static_cast<std::uint32_t>(out.tables_.pairs().size())};
}

std::unique_ptr<const CoverPlan> CoverPlan::make(const engine::Scene& scene, const Plan& plan, const CoverStore& covers,
                                                 const JointTableStore* tables) {
  return CoverPlanBuilder(scene, plan, covers, tables).build();
}

bool CoverPlan::may_decide(const Plan& plan) {
  return !plan.motions.empty() && plan.given_bodies == 0 && plan.pairs.size() > 0 && plan.pairs.size() <= kMostPairs &&
         plan.moved.size() <= kMostDecidedBodies;
}

bool CoverPlan::holds_for(std::span<const double> positions) const {
  return std::all_of(slides_.begin(), slides_.end(),
                     [&](const SlideLimit& s) { return std::abs(positions[s.at]) <= s.most; });
}

}  // namespace clearance
