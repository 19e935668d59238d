// Places bodies from the poses of configurations.
#pragma once

#include "engine/cuda/place/link_frames.cuh"
#include "engine/hull/box.h"
#include "engine/narrow/certify.h"

namespace clearance::cuda {

__device__ inline OuterBox outer_box(const Aabb& box) {
  return {__double2float_rd(box.low.x),
          __double2float_rd(box.low.y),
          __double2float_rd(box.low.z),
          __double2float_ru(box.high.x),
          __double2float_ru(box.high.y),
          __double2float_ru(box.high.z),
          {0, 0}};
}
__device__ inline OuterBox no_outer_box() {
  constexpr float kInf = __builtin_inff();
  return {kInf, kInf, kInf, -kInf, -kInf, -kInf, {0, 0}};
}
__device__ inline Aabb box_of(const HullHead& h, const Mat3d& R_wb, const Vec3d& t_w) {
  return certify_box(h.centre, h.half, h.spread, h.rho, h.radius, R_wb, t_w);
}

// Whether a body is on the device and has a convex part. Frames have no convex part, and their box would be written
// into the next body's.
__device__ inline bool has_box(const HullsView& hulls, std::uint32_t body) {
  return hulls.of_body[body] != kNone && hulls.part_begin[body] < hulls.part_begin[body + 1];
}

// The box of a placed body on the device, as by body_box().
// \param inner of its slack
// \param put called as `put(i, box)` with the boxes of its convex parts
template <class Put>
__device__ inline Aabb box_of_body(const HullsView& hulls, std::uint32_t body, const Mat3d& R_wb, const Vec3d& t_w,
                                   double inner, const Put& put) {
  const std::uint32_t first = hulls.part_begin[body], count = hulls.part_begin[body + 1] - first;
  Aabb all = box_of(hulls.heads[hulls.part_hull[first]], R_wb, t_w);
  put(0, all);
  for (std::uint32_t i = 1; i < count; ++i) {
    const Aabb box = box_of(hulls.heads[hulls.part_hull[first + i]], R_wb, t_w);
    put(i, box);
    all = joined(all, box);
  }
  return grown(all, inner);
}

// Uncertainty of a moved body in configuration k, as by uncertainty_of().
// \param follows whether it has a parent, whose uncertainty is `parent`
__device__ inline PlacedUncertainty uncertainty_of_moved(const MovesView& moves, std::uint32_t link, std::uint32_t k,
                                                         const Pose& local, const BodyPlacement& here, bool follows,
                                                         const PlacedUncertainty& parent, bool composed,
                                                         double& travel) {
  const UncertaintyStep& m = moves.uncertainties[link];
  const bool slides = m.robot != kNone && m.joint_per_travel > 0;
  travel = slides ? travel_to(moves.frames, m.robot, moves.source[link] - moves.given_count, k) : m.travel;
  const FrameUncertainty joints{placement_error(m.joint_fixed, m.joint_per_travel, travel), m.joint_turn};
  if (!follows) return uncertainty_below(m.source, local.translation, here.pose.t_w, m.age_s, nullptr, false, joints);
  return uncertainty_below(m.source, local.translation, here.pose.t_w, m.age_s, &parent, composed, joints);
}

// Pose of a moved body relative to its parent, with LinkFact bits.
struct LocalPose {
  Pose pose;
  std::uint8_t facts = 0;
};
__device__ inline LocalPose local_pose(const MovesView& moves, std::uint32_t slot, std::uint32_t k,
                                       std::uint32_t configurations) {
  const std::uint32_t source = moves.source[slot];
  if (source == kNone) return {moves.own[slot]};
  if (source < moves.given_count) return {moves.given[std::uint64_t{k} * moves.given_count + source]};
  const std::uint32_t frame = source - moves.given_count;
  const std::uint8_t facts = moves.frames.facts[std::size_t{frame} * configurations + k];
  const auto [q, t] = load_frame(moves.frames, frame, k, configurations);
  const double bad = __builtin_nan("");
  return {facts & kLinkBad ? Pose{{bad, bad, bad}, bad, bad, bad, bad} : Pose{t, q.w, q.x, q.y, q.z}, facts};
}

// Stores three components of a moved body in configuration k, from component c on.
__device__ __forceinline__ void store_components(const BodiesView& bodies, std::uint32_t slot, std::uint32_t k,
                                                 std::uint32_t configurations, std::uint32_t c, const Vec3d& v) {
  double* const out = bodies.moved + std::size_t{slot} * bodies.components * configurations + k;
  out[std::size_t{c} * configurations] = v.x;
  out[std::size_t{c + 1} * configurations] = v.y;
  out[std::size_t{c + 2} * configurations] = v.z;
}

// Stores the boxes of a moved body in configuration k, and those of its parts.
// \param growth of the boxes, in metres
__device__ __forceinline__ void store_boxes(const HullsView& hulls, const BodiesView& bodies, std::uint32_t slot,
                                            std::uint32_t k, std::uint32_t configurations, const BodyPlacement& here,
                                            double growth) {
  const bool want_box = bodies.components > kPoseComponents;
  const std::uint32_t body = bodies.moved_body[slot];
  OuterBox* const outer = bodies.moved_box + std::size_t{slot} * configurations + k;
  if (want_box) *outer = no_outer_box();
  if (!has_box(hulls, body) || here.status != Status::kOk) return;
  const auto put_part = [&](std::uint32_t i, const Aabb& of_part) {
    if (!bodies.moved_part_box) return;
    double* p = bodies.moved_part_box + std::size_t{bodies.moved_part_begin[slot] + i} * 6 * configurations + k;
    for (int c = 0; c < 3; ++c) {
      p[std::size_t(c) * configurations] = of_part.low[c];
      p[std::size_t(3 + c) * configurations] = of_part.high[c];
    }
  };
  const Aabb box = box_of_body(hulls, body, here.pose.R_wb, here.pose.t_w, growth, put_part);
  if (!want_box) return;
  store_components(bodies, slot, k, configurations, 12, box.low);
  store_components(bodies, slot, k, configurations, 15, box.high);
  *outer = outer_box(box);
}

// rotation_of() for the few bodies whose followers need it. Not inlined, so that it takes no registers from the others.
__device__ __noinline__ inline Mat3d rotation_of_parent(const Pose X_wb) {
  return rotation_of(X_wb);
}

// Places a moved body in configuration k, with its boxes. `position_error`, in metres, comes in addition to the
// uncertainty of its frames.
// \returns its uncertainty, without `position_error`
// \tparam kUncertain whether any body is uncertain
template <bool kUncertain>
__device__ inline PlacedUncertainty place_body(const HullsView& hulls, const BodiesView& bodies, const MovesView& moves,
                                               std::uint32_t slot, std::uint32_t k, std::uint32_t configurations,
                                               double position_error = 0) {
  // Parents are placed again for each follower: chains are short, and threads need no synchronization.
  BodyPlacement parent, here;
  bool follows = moves.has_base[slot] != 0;
  if (follows) parent = moves.base[slot];
  PlacedUncertainty uncertainty;
  double travel = 0;
  if (kUncertain && follows) uncertainty = moves.base_uncertainty[slot];
  for (std::uint32_t i = moves.chain_begin[slot]; i < moves.chain_begin[slot + 1]; ++i) {
    const std::uint32_t link = moves.chain[i];
    const auto [local, facts] = local_pose(moves, link, k, configurations);
    const std::uint8_t state = moves.slot_state[link];
    const bool is_first = i == moves.chain_begin[slot];
    const auto parent_rotation = [&] {
      return is_first ? moves.base[slot].pose.R_wb : rotation_of_parent(parent.pose.X_wb);
    };
    // A pointer that may be null would keep its target out of registers.
    here = {};
    if ((state & kSlotUnplaced) == 0 && (facts & kLinkUnplaced) == 0)
      here = follows ? place_unrotated(&local, &parent, parent_rotation)
                     : place_unrotated(&local, nullptr, parent_rotation);
    if ((state & kSlotBeyondLimits) || (facts & kLinkBeyondLimits)) here.beyond_limits = true;
    if ((state & kSlotStale) && here.status == Status::kOk) here.status = Status::kStalePose;
    if (kUncertain && here.status == Status::kOk)
      uncertainty = uncertainty_of_moved(moves, link, k, local, here, follows, uncertainty,
                                         follows && is_composed(parent), travel);
    parent = here;
    follows = true;
  }
  bodies.moved_state[std::size_t{slot} * configurations + k] = static_cast<std::uint8_t>(here.status) |
                                                               (here.renormalised ? kStateRenormalised : 0) |
                                                               (here.beyond_limits ? kStateBeyondLimits : 0);
  const bool is_placed = here.status == Status::kOk;
  const Vec3d zero{0, 0, 0};
  if (is_placed) here.pose.R_wb = rotation_of(here.pose.X_wb);
  for (std::uint32_t r = 0; r < 3; ++r)
    store_components(bodies, slot, k, configurations, 3 * r, is_placed ? here.pose.R_wb.row[r] : zero);
  store_components(bodies, slot, k, configurations, 9, is_placed ? here.pose.t_w : zero);
  if (kUncertain) {
    const Slack more{position_error, position_error};
    bodies.uncertainties.moved[std::size_t{slot} * configurations + k] = {uncertainty.slack + more,
                                                                          uncertainty.relative + more, travel};
  }
  const bool has_boxes = bodies.components > kPoseComponents || bodies.moved_part_box;
  if (has_boxes)
    store_boxes(hulls, bodies, slot, k, configurations, here,
                kUncertain ? sum_above(uncertainty.slack.inner, position_error) : 0);
  return uncertainty;
}

}  // namespace clearance::cuda
