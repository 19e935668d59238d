#include "engine/joint_table/block_planes.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "engine/hull/support.h"
#include "engine/joint_table/joint_table.h"

namespace clearance {

namespace {

constexpr double kPlaneRounding = 0x1p-44;     // of supports and twists, relative to the lengths that enter
constexpr double kPlaneLonger = 1 + 0x1p-40;   // exceeds the length of a normal
constexpr double kVelocityRounding = 0x1p-40;  // of a twist, relative to the speed of points

// Reach of a placed part along a direction in world axes, from its origin.
double reach_of_part(const ConvexPart& part, const PoseMatrix& pose, const Vec3d& n) {
  return support(part, pose.R_wb.transpose_times(n)).value + part.radius * norm(n);
}

std::vector<HullPlanes> planes_of_parts(const TableLink& link) {
  constexpr std::size_t kMostCorners = 256;
  std::vector<HullPlanes> planes;
  for (const ConvexPartPtr& part : link.parts) {
    auto hull = part->primitive || part->surface ? std::nullopt : few_vertices(part->vertices, kMostCorners);
    planes.push_back(hull ? std::move(hull->planes) : HullPlanes());
  }
  return planes;
}

}  // namespace

BlockPlanes::BlockPlanes(const TablePair& pair, double travel)
    : pair_(pair),
      travel_(travel),
      twists_(pair.robot->kinematics),
      a_from_b_(pair.robot->kinematics, pair.b.link, pair.a.link, pair.a.ball),
      b_from_a_(pair.robot->kinematics, pair.a.link, pair.b.link, pair.b.ball),
      a_(pair.robot->kinematics, pair.a.link, pair.a.ball),
      b_(pair.robot->kinematics, pair.b.link, pair.b.ball),
      planes_a_(planes_of_parts(pair.a)),
      planes_b_(planes_of_parts(pair.b)),
      error_(
          pair.robot->kinematics.error_between(pair.a.link, pair.a.extent, pair.b.link, pair.b.extent).at(travel, 0)),
      change_(pair.robot->kinematics.columns(), 0),
      links_(pair.robot->kinematics.links()) {}

void BlockPlanes::take_size(std::span<const double> half) {
  const Kinematics& robot = pair_.robot->kinematics;
  half_.assign(half.begin(), half.end());
  std::fill(change_.begin(), change_.end(), 0);
  for (std::size_t c = 0; c < half_.size(); ++c) change_[pair_.columns[c]] = half_[c];
  const double of_a = a_from_b_.rates(change_, travel_).acceleration,
               of_b = b_from_a_.rates(change_, travel_).acceleration;
  moves_b_ = of_b < of_a;
  bend_ = 0.5 * std::min(of_a, of_b) + error_;
  double reach = 4 * travel_;  // of one link's points from the axes of the other
  for (const TableLink* link : {&pair_.a, &pair_.b}) reach += link->extent + robot.reach(link->link, link->extent);
  for (const auto& [path, link] : {std::pair(&a_, &pair_.a), std::pair(&b_, &pair_.b)}) {
    const MotionRates rates = path->rates(change_, travel_);
    const PlacementError error = robot.error(link->link, link->extent);
    bend_ += (kVelocityRounding + 4 * error.turn) * (rates.speed + rates.turn * reach) +
             4 * rates.turn * error.at(travel_, 0);
  }
  bend_ *= kPlaneLonger;
}

void BlockPlanes::take_middle(std::span<const Pose> poses) {
  const Vec3d apart = poses[pair_.b.link].translation - poses[pair_.a.link].translation;
  for (std::size_t c = 0; c < half_.size(); ++c) {
    std::fill(change_.begin(), change_.end(), 0);
    change_[pair_.columns[c]] = half_[c];
    twists_.at(poses, change_, links_);
    const Twist &a = links_[pair_.a.link], &b = links_[pair_.b.link];
    movement_[c] = moves_b_ ? Twist{b.turn - a.turn, b.shift - a.shift - cross(a.turn, apart)}
                            : Twist{a.turn - b.turn, a.shift - b.shift + cross(b.turn, apart)};
  }
}

double BlockPlanes::gap(const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b, const PoseMatrix& pose_b,
                        const Vec3d& n) const {
  if (!(norm(n) <= 1 + 0x1p-41)) return -std::numeric_limits<double>::infinity();
  // The moving part's reach towards the other one is convex in its movement, so it is greatest at a corner.
  const Vec3d towards = moves_b_ ? -n : n;
  double most = -std::numeric_limits<double>::infinity();
  for (unsigned corner = 0; corner < 1u << half_.size(); ++corner) {
    Vec3d turned = towards;
    double shift = 0;
    for (std::size_t c = 0; c < half_.size(); ++c) {
      const double side = corner >> c & 1 ? 1 : -1;
      turned += cross(towards, movement_[c].turn) * side;
      shift += dot(towards, movement_[c].shift) * side;
    }
    most = std::max(most, shift + (moves_b_ ? reach_of_part(b, pose_b, turned) : reach_of_part(a, pose_a, turned)));
  }
  const Vec3d apart = pose_b.t_w - pose_a.t_w;
  const double still = moves_b_ ? reach_of_part(a, pose_a, n) : reach_of_part(b, pose_b, -n),
               gap = dot(n, apart) - still - most;
  const double lengths = norm(pose_a.t_w) + norm(pose_b.t_w) + pair_.a.extent + pair_.b.extent;
  return (gap - bend_ - kPlaneRounding * lengths) / kPlaneLonger;
}

// A point fixed to the moving part moves by less than it may in each plane of the other one. It begins at `point`, and
// goes inward from the plane that it is closest to.
double BlockPlanes::shared(std::size_t index_a, const PoseMatrix& pose_a, std::size_t index_b, const PoseMatrix& pose_b,
                           const Vec3d& point) const {
  constexpr int kMostSteps = 24;
  constexpr double kFirstStep = 0.002, kShorter = 0.85;  // metres; of each step to the one before
  const PoseMatrix &moving = moves_b_ ? pose_b : pose_a, &still = moves_b_ ? pose_a : pose_b;
  const HullPlanes &of_moving = moves_b_ ? planes_b_[index_b] : planes_a_[index_a],
                   &of_still = moves_b_ ? planes_a_[index_a] : planes_b_[index_b];
  if (of_moving.empty() || of_still.empty()) return 0;
  const double lengths = norm(point) + norm(pose_a.t_w) + norm(pose_b.t_w) + pair_.a.extent + pair_.b.extent;
  Vec3d at = point;
  double step = kFirstStep, spare = 0;
  for (int k = 0; k < kMostSteps; ++k, step *= kShorter) {
    const Vec3d from_moving = at - moving.t_w, in_moving = moving.R_wb.transpose_times(from_moving),
                in_still = still.R_wb.transpose_times(at - still.t_w);
    Vec3d ways[2]{};  // in the still part's axes
    for (std::size_t c = 0; c < half_.size(); ++c)
      ways[c] = still.R_wb.transpose_times(movement_[c].shift + cross(movement_[c].turn, from_moving));
    const std::size_t worst = of_moving.highest(in_moving);
    spare = -of_moving.above(worst, in_moving);
    Vec3d inward = -(moving.R_wb * of_moving.normal(worst));
    for (std::size_t i = 0; i < of_still.count(); ++i) {
      const Vec3d n = of_still.normal(i);
      const double left = -of_still.above(i, in_still) - std::abs(dot(n, ways[0])) - std::abs(dot(n, ways[1])) - bend_;
      if (left < spare) spare = left, inward = -(still.R_wb * n);
    }
    spare -= kPlaneRounding * lengths;
    if (spare > 2 * JointTable::kUnit) break;
    at += inward * step;
  }
  return spare;
}

}  // namespace clearance
