#include "engine/motion/free_scale.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "engine/scene/body_ball.h"

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
// Rounding of the few sums and products below.
constexpr double kUp = 1 + 0x1p-40, kDown = 1 - 0x1p-40;
constexpr std::uint64_t kMostPairs = std::uint64_t{1} << 18;  // each stores a few numbers
constexpr std::uint64_t kPairsAtATime = 64;
constexpr std::uint64_t kUnitsPerPair = 2, kMoversPerUnit = 4;  // units of work

// Never +inf, which would claim that nothing moves.
double rounded_down(long double x) {
  if (x >= std::numeric_limits<double>::max()) return std::numeric_limits<double>::max();
  const auto near = static_cast<double>(x);
  return near > x ? std::nextafter(near, 0.0) : near;
}

[[noreturn]] void reject(const std::string& what) {
  throw engine::QueryError(QueryErrorCode::kBadQuery, "free_scale: " + what);
}

}  // namespace

FreeScale::FreeScale(const engine::Scene& scene, const Plan& plan)
    : scene_(scene), plan_(plan), moves_(scene.bodies().size(), 0), carried_(scene.bodies().size()) {
  for (const std::uint32_t body : plan.moved) moves_[body] = 1;
  check();
  take_weights();
}

bool FreeScale::advance(WorkMeter& meter) {
  std::vector<BodyPair> storage;
  const std::uint64_t count = plan_.pairs.size();
  while (next_ < count) {
    const auto pairs = plan_.pairs.slice(next_, std::min(kPairsAtATime, count - next_), storage);
    for (const BodyPair pair : pairs) {
      for (const std::uint32_t body : {pair.a, pair.b})
        if (body >= scene_.bodies().size()) reject("unknown body " + std::to_string(body));
      const std::size_t before = ways_.size();
      add_pair(carried(pair.a), carried(pair.b));
      meter.count(kUnitsPerPair + (ways_.size() - before) * plan_.joints.size() / kMoversPerUnit);
    }
    next_ += pairs.size();
    if (next_ < count && meter.is_over()) return false;
  }
  return true;
}

void FreeScale::check() const {
  const std::vector<double>& weights = plan_.weights;
  if (plan_.joints.empty() || plan_.query.configuration_count == 0) reject("expected joints, and their positions");
  if (plan_.given_bodies > 0) reject("bodies: only joints move");
  if (weights.size() != plan_.joints.size())
    reject("weights: expected " + std::to_string(plan_.joints.size()) + " numbers, one for each joint, got " +
           std::to_string(weights.size()));
  for (std::size_t i = 0; i < weights.size(); ++i)
    if (!(weights[i] >= 0) || std::isinf(weights[i]))
      reject("weights[" + std::to_string(i) + "]: expected a finite number >= 0, got " + std::to_string(weights[i]));
  if (plan_.pairs.size() > kMostPairs)
    throw engine::QueryError(QueryErrorCode::kTooLarge, "free_scale: " + std::to_string(plan_.pairs.size()) +
                                                            " pairs are more than the limit of " +
                                                            std::to_string(kMostPairs) + ": list the pairs explicitly");
  for (const auto& robot : scene_.robots())
    for (const std::uint32_t root : robot->kinematics.roots())
      if (const std::uint32_t body = robot->bodies[root]; moves_[body])
        reject("'" + scene_.bodies()[body].name +
               "' stands on a link that the joints move, which is not supported yet");
}

void FreeScale::take_weights() {
  for (const auto& robot : scene_.robots()) {
    const std::size_t count = robot->model.columns.size();
    const auto begin = plan_.snapshot->joints.position.begin() + robot->first_joint;
    positions_.emplace_back(begin, begin + static_cast<std::ptrdiff_t>(count));
    weights_.emplace_back(count, 0.0);
  }
  for (std::size_t i = 0; i < plan_.joints.size(); ++i) {
    const SceneJoint& joint = scene_.joints()[plan_.joints[i]];
    weights_[joint.robot][joint.column] = plan_.weights[i];
  }
  for (std::size_t r = 0; r < weights_.size(); ++r) {
    Wide most = 0;
    for (const KinematicStep& step : scene_.robots()[r]->kinematics.steps()) {
      const Wide scale = step.mimics ? std::abs(step.multiplier) : 1;
      if (step.kind == KinematicStep::Kind::kSliding) most = std::max(most, scale * weights_[r][step.column]);
      if (step.kind == KinematicStep::Kind::kPlanar)
        most = std::max<Wide>({most, weights_[r][step.column], weights_[r][step.column + 1]});
    }
    weight_travels_.push_back(most * kUp);
  }
}

const FreeScale::Carried& FreeScale::carried(std::uint32_t body) {
  std::optional<Carried>& known = carried_[body];
  if (!known) known = carrier_of(body);
  return *known;
}

// The link that carries a body, and a ball around the body's points in the link's frame. For a body that follows a
// link, the ball is centred at the link's origin and includes the uncertainty of each attachment.
FreeScale::Carried FreeScale::carrier_of(std::uint32_t body) const {
  if (!moves_[body]) return {};
  const PoseSnapshot& snapshot = *plan_.snapshot;
  const Body* of = &scene_.bodies()[body];
  LinkBall points = ball_around(*of);
  if (of->robot == kNone) {
    points = {{0, 0, 0}, of->reach + of->model_inner};
    for (; of->robot == kNone; of = &scene_.bodies()[body]) {
      const Pose& X = snapshot.local[body];
      if (of->max_speed > 0) reject("'" + of->name + "' has a max_speed, which is not supported yet");
      points.radius += norm(X.translation) + of->uncertainty.position;
      body = snapshot.parent[body];
    }
    points.radius *= kUp;
  }
  return {of->robot, of->link, points};
}

FreeScale::Way FreeScale::way_of(std::uint32_t robot, const MotionPath& path) const {
  Way way{robot, 0, 0};
  for (const Mover& mover : path.movers()) {
    const Wide change = Wide{mover.scale} * weights_[robot][mover.column];
    way.fixed += mover.reach * change;
    way.per_travel += mover.reach_travel * change;
  }
  return way;
}

void FreeScale::add_pair(const Carried& a, const Carried& b) {
  const auto end_bound = [&] { bound_end_.push_back(static_cast<std::uint32_t>(ways_.size())); };
  if (a.robot != kNone && a.robot == b.robot) {
    const Kinematics& robot = scene_.robots()[a.robot]->kinematics;
    for (const MotionPath& path : paths_between(robot, a.link, a.points, b.link, b.points)) {
      ways_.push_back(way_of(a.robot, path));
      end_bound();
    }
  } else {
    for (const Carried& side : {a, b})
      if (side.robot != kNone)
        ways_.push_back(
            way_of(side.robot, MotionPath(scene_.robots()[side.robot]->kinematics, side.link, side.points)));
    end_bound();
  }
  pair_end_.push_back(static_cast<std::uint32_t>(bound_end_.size()));
}

std::vector<double> FreeScale::travels(std::span<const double> row) const {
  std::vector<std::vector<double>> positions = positions_;
  for (std::size_t i = 0; i < row.size(); ++i) {
    const SceneJoint& joint = scene_.joints()[plan_.joints[i]];
    positions[joint.robot][joint.column] = row[i];
  }
  std::vector<double> travels;
  for (std::size_t r = 0; r < positions.size(); ++r)
    travels.push_back(scene_.robots()[r]->kinematics.travel(positions[r]));
  return travels;
}

// The path length at s is at most s (fixed + per_travel (travel + s more)); the available distance yields s.
double FreeScale::of(std::uint64_t position, std::span<const double> travels, double lower, double margin) const {
  const double room = (lower - margin) - (std::abs(lower) + margin) * 0x1p-50;
  if (!(room > 0)) return 0;
  Wide scale = 0;
  for (std::uint32_t b = position ? pair_end_[position - 1] : 0; b < pair_end_[position]; ++b) {
    Wide linear = 0, square = 0;
    for (std::uint32_t w = b ? bound_end_[b - 1] : 0; w < bound_end_[b]; ++w) {
      linear += ways_[w].fixed + ways_[w].per_travel * travels[ways_[w].robot];
      square += ways_[w].per_travel * weight_travels_[ways_[w].robot];
    }
    linear *= kUp;
    square *= kUp;
    if (linear == 0 && square == 0) return kInf;
    scale = std::max(scale, 2 * room / ((linear + std::sqrt(linear * linear + 4 * square * room)) * kUp) * kDown);
  }
  return rounded_down(scale);
}

}  // namespace clearance
