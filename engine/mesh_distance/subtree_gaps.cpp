#include "engine/mesh_distance/subtree_gaps.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/base/arithmetic.h"
#include "engine/hull/primitive.h"
#include "engine/hull/support.h"

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
// Rounding units of a gap: of the rotation, its products and the sums (docs/trust/bounds_bodies.md, surfaces).
constexpr double kGapUnits = 256 * 0x1p-53;
// Levels that known_reach() descends: at most 4096 nodes, and 64 of a cloud, whose boxes are less tight.
constexpr int kLevels = 12, kLevelsOfCloud = 6;

// The box in other axes.
BoxBounds converted(const BoxBounds& box, const Mat3d& R, const Vec3d& D) {
  BoxBounds result{R * box.centre + D, {}};
  for (int k = 0; k < 3; ++k) result.half[k] = dot(absolute_of(R.row[k]), box.half);
  return result;
}

}  // namespace

void SubtreeGaps::begin(const Body& a, const PoseMatrix& pose_a, const Body& b, const PoseMatrix& pose_b) {
  a_ = &a;
  b_ = &b;
  R_wa_ = pose_a.R_wb;
  R_ = pose_a.R_wb.transpose_times(pose_b.R_wb);
  D_ = pose_a.R_wb.transpose_times(pose_b.t_w - pose_a.t_w);
  for (int k = 0; k < 3; ++k) R_ba_.row[k] = {R_.row[0][k], R_.row[1][k], R_.row[2][k]};
  D_ba_ = -(R_ba_ * D_);
  error_ = kGapUnits * (norm(D_) + a.reach + b.reach) + Arithmetic<double>::kUnderflowLength;
  plane_ = is_half_space(*a.parts[0]) ? Plane::kA : is_half_space(*b.parts[0]) ? Plane::kB : Plane::kNeither;
  looks_ = 0;
  looks_deep_ = false;
  reached_ = 0;
}

BoxBounds SubtreeGaps::before_a(const BoxBounds& of_b) const {
  return converted(of_b, R_, D_);
}

BoxBounds SubtreeGaps::before_b(const BoxBounds& of_a) const {
  return converted(of_a, R_ba_, D_ba_);
}

double SubtreeGaps::margin(const SubtreePair& e) const {
  return a_->parts[e.a.part]->radius + b_->parts[e.b.part]->radius + error_;
}

double SubtreeGaps::gap_of(const SubtreePair& e, const BoxBounds& a, const BoxBounds& b) const {
  if (plane_ != Plane::kNeither) {  // it has no box, and its plane's normal is the only direction
    const Vec3d z{0, 0, 1};
    if (plane_ == Plane::kA) return std::max(e.gap, gap_along(e, a, b, z, R_.transpose_times(z)));
    return std::max(e.gap, gap_along(e, a, b, R_ * -z, -z));
  }
  const BoxBounds turned = before_a(b);
  const Vec3d d = turned.centre - a.centre;
  Vec3d apart;
  for (int k = 0; k < 3; ++k) apart[k] = above_zero(std::abs(d[k]) - (a.half[k] + turned.half[k]));
  const double gap = above_zero(norm(apart) - margin(e)), length = norm(d);
  if (!(length > 0 && length < kInf)) return gap;
  const Vec3d n = d * (1 / length);
  return std::max(gap, gap_along(e, a, b, n, R_.transpose_times(n)));
}

// \param n_a,n_b the direction in the axes of both, of length 1 up to rounding
double SubtreeGaps::gap_along(const SubtreePair& e, const BoxBounds& a, const BoxBounds& b, const Vec3d& n_a,
                              const Vec3d& n_b) const {
  const double far_a = reach_of(*a_, e.a, a, n_a), far_b = reach_of(*b_, e.b, b, -n_b);
  return above_zero(((dot(n_a, D_) - far_b) - far_a) * (1 - 0x1p-45) - margin(e));
}

double SubtreeGaps::known_reach(bool of_a, Subtree subtree, const BoxBounds& box) const {
  if (subtree.at != kNone) return known_reach(of_a, subtree, reach_of(body(of_a), subtree, box, direction(of_a)));
  Reach& known = reaches_[(subtree.part * 2 + of_a) % kReaches];
  if (!known.is_of(directions_, subtree, of_a))
    known = {directions_, subtree.part, subtree.at, of_a,
             support(*body(of_a).parts[subtree.part], direction(of_a)).value};
  return known.reach;
}

double SubtreeGaps::deep_reach(bool of_a, Subtree subtree, double by_bounds) const {
  const bool is_cloud = body(of_a).parts[subtree.part]->surface->is_cloud();
  return reach_below(of_a, subtree, by_bounds, is_cloud ? kLevelsOfCloud : kLevels);
}

// Descends by the farthest reach. Most subtrees are skipped, since their boxes reach less far than the result so far.
double SubtreeGaps::reach_below(bool of_a, Subtree subtree, double by_bounds, int levels) const {
  if (subtree.is_element() || levels <= 0) return by_bounds;
  Reach& known = reaches_[(subtree.at * 2654435761u + subtree.part * 40503u + of_a) % kReaches];
  if (known.is_of(directions_, subtree, of_a)) return known.reach;
  const Surface& surface = *body(of_a).parts[subtree.part]->surface;
  const Vec3d n = direction(of_a);
  double most = -kInf;
  if (surface.nodes()[subtree.at].is_leaf()) {
    most = reach_of(body(of_a), subtree, {}, n);
  } else {
    ++reached_;
    const NodesBelow below(surface, subtree.at);
    PartColumn far;
    part_reaches(below.columns, n, far);
    for (std::uint32_t left = below.count; left > 0; --left) {
      std::uint32_t farthest = 0;
      for (std::uint32_t k = 1; k < below.count; ++k)
        if (far[k] > far[farthest]) farthest = k;
      if (!(far[farthest] > most)) break;
      most = std::max(most, reach_below(of_a, {subtree.part, below.at[farthest]}, far[farthest], levels - 2));
      far[farthest] = -kInf;
    }
  }
  known = {directions_, subtree.part, subtree.at, of_a, most};
  return most;
}

double SubtreeGaps::gap_known(const SubtreePair& e) const {
  return gap_known(e, known_reach(true, e.a, bounds_a(e)), known_reach(false, e.b, bounds_b(e)));
}

void SubtreeGaps::look_along(const Vec3d& n_w) {
  if (have_half_space() || !(std::abs(norm(n_w) - 1) < 0x1p-46)) return;
  ++looks_;
  ++directions_;
  n_a_ = R_wa_.transpose_times(n_w);
  n_b_ = R_.transpose_times(n_a_);
}

}  // namespace clearance
