#include "engine/joint_table/block_bounds.h"

#include <algorithm>
#include <limits>

namespace clearance {

namespace {

constexpr double kUnbounded = std::numeric_limits<double>::infinity();

}  // namespace

BlockBounds::BlockBounds(const TablePair& pair, double travel)
    : pair_(pair),
      robot_(pair.robot->kinematics),
      error_(robot_.error_between(pair.a.link, pair.a.extent, pair.b.link, pair.b.extent).at(travel, 0)),
      planes_(pair, travel) {
  for (const TableLink* link : {&pair.a, &pair.b}) {
    Body& body = bodies_.emplace_back();
    body.parts = link->parts;
    body.reach = link->extent;
    has_mesh_ |= has_surface(body);
  }
}

std::span<const BlockBounds::Bounds> BlockBounds::of(std::span<const double> positions) {
  const std::size_t count = positions.size() / robot_.columns(), links = robot_.links();
  poses_.resize(count * links);
  status_.resize(count);
  robot_.place(positions, std::vector<Pose>(robot_.roots().size()), poses_, status_);
  places_.clear();
  for (std::size_t k = 0; k < count; ++k)
    for (const std::uint32_t link : {pair_.a.link, pair_.b.link}) {
      const Pose& X = poses_[k * links + link];
      places_.push_back({rotation_of(X), X.translation, X});
    }
  bounds_.assign(count, {kUnbounded, kUnbounded, kUnbounded, kUnbounded});
  if (has_mesh_)
    evaluate_meshes();
  else
    evaluate_parts();
  for (std::size_t k = 0; k < count; ++k)
    if (status_[k] != Status::kOk) bounds_[k] = {-kUnbounded, kUnbounded, -kUnbounded, kUnbounded};
  return bounds_;
}

void BlockBounds::evaluate_meshes() {
  for (std::size_t k = 0; k < bounds_.size(); ++k) {
    const MeshGap gap =
        mesh_gaps_.of(bodies_[0], places_[2 * k], bodies_[1], places_[2 * k + 1], way_ / 4, kFar + way_ + error_);
    bounds_[k] = around(gap.lower, gap.upper);
  }
}

void BlockBounds::evaluate_parts() {
  const double deep = std::min(kDeep + way_ + error_, way_ * kPrecision + error_);
  tasks_.clear();
  for (std::size_t k = 0; k < bounds_.size(); ++k)
    for (const ConvexPartPtr& a : pair_.a.parts)
      for (const ConvexPartPtr& b : pair_.b.parts)
        tasks_.push_back({a.get(), b.get(), &places_[2 * k], &places_[2 * k + 1], kFar + way_ + error_,
                          static_cast<std::uint32_t>(k), deep});
  const auto take = [&](const PartTask& task, Bounds of_parts, const Vec3d& normal, const Vec3d& middle) {
    if (is_last_) narrow(task, normal, middle, of_parts);
    Bounds& bounds = bounds_[task.id];
    bounds = {std::min(bounds.lower, of_parts.lower), std::min(bounds.upper, of_parts.upper),
              std::min(bounds.least, of_parts.least), std::min(bounds.most, of_parts.most)};
  };
  PartBatch batch({.limits = {.abs_tol = way_ / 16}, .lanes = &lane_kernels()[0], .f32 = true});
  batch.run(
      tasks_,
      [&](const PartTask& task, const LaneAnswer& lane, const LaneWitness& witness) {
        take(task, around(lane.lower, lane.upper), witness.n * (1 / witness.n_length), {0, 0, 0});
      },
      [&](const PartTask& task, const NarrowAnswer& answer) {
        const Vec3d middle = (task.pose_a->t_w + answer.point_a + task.pose_b->t_w + answer.point_b) * 0.5;
        take(task, around(answer.bounds.lower, answer.bounds.upper), answer.normal, middle);
      });
}

// Narrows the bounds of two parts throughout a block.
// \param normal, middle of the parts in its middle; the latter for parts that overlap
void BlockBounds::narrow(const PartTask& task, const Vec3d& normal, const Vec3d& middle, Bounds& bounds) {
  const bool is_apart = bounds.lower > 0 && bounds.least < kFar, overlaps = bounds.upper <= 0 && bounds.most >= 0;
  if (!is_apart && !overlaps) return;
  planes_.take_middle(std::span(poses_).subspan(task.id * robot_.links(), robot_.links()));
  if (is_apart)
    bounds.least = std::max(bounds.least, planes_.gap(*task.a, *task.pose_a, *task.b, *task.pose_b, normal));
  if (!overlaps) return;
  const std::size_t count_b = pair_.b.parts.size(),
                    number = static_cast<std::size_t>(&task - tasks_.data()) % (pair_.a.parts.size() * count_b);
  const double held = planes_.shared(number / count_b, *task.pose_a, number % count_b, *task.pose_b, middle);
  if (held > 0) bounds.most = std::min(bounds.most, -held);
}

}  // namespace clearance
