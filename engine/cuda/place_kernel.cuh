// Poses of configurations to placed bodies: one thread for each moved body in each configuration.
#pragma once

#include "engine/certify.h"
#include "layout.h"

namespace clearance::cuda {

__global__ void __launch_bounds__(128)
    place_bodies(HullsView hulls, BodiesView bodies, MovesView moves, std::uint32_t configurations) {
  const std::uint64_t item = std::uint64_t{blockIdx.x} * blockDim.x + threadIdx.x;
  const auto slot = static_cast<std::uint32_t>(item / configurations),
             k = static_cast<std::uint32_t>(item % configurations);
  if (slot >= bodies.moved_count) return;

  // What a body follows is placed again for each follower: chains are short, and threads need not wait for each other.
  BodyPlacement parent, here;
  bool follows = moves.has_base[slot] != 0;
  if (follows) parent = moves.base[slot];
  for (std::uint32_t i = moves.chain_begin[slot]; i < moves.chain_begin[slot + 1]; ++i) {
    const std::uint32_t link = moves.chain[i], source = moves.source[link];
    const Pose local = source == kNone ? moves.own[link] : moves.given[std::uint64_t{k} * moves.given_count + source];
    here = place(&local, follows ? &parent : nullptr);
    parent = here;
    follows = true;
  }
  bodies.moved_state[std::size_t{slot} * configurations + k] =
      static_cast<std::uint8_t>(here.status) | (here.renormalised ? kStateRenormalised : 0);
  double* out = bodies.moved + std::size_t{slot} * bodies.components * configurations + k;
  const auto put = [&](std::uint32_t c, const Vec3d& v) {
    out[std::size_t{c} * configurations] = v.x;
    out[std::size_t{c + 1} * configurations] = v.y;
    out[std::size_t{c + 2} * configurations] = v.z;
  };
  const bool placed = here.status == Status::kOk;
  const Vec3d zero{0, 0, 0};
  for (int r = 0; r < 3; ++r) put(3 * r, placed ? here.pose.R_wb.row[r] : zero);
  put(9, placed ? here.pose.t_w : zero);
  if (bodies.components == kPoseComponents) return;
  const std::uint32_t hull = hulls.of_body[bodies.moved_body[slot]];
  if (hull == kNone || !placed) return;
  const HullHead& h = hulls.heads[hull];
  const Aabb box = certify_box(h.centre, h.half, h.spread, h.rho, h.radius, here.pose.R_wb, here.pose.t_w);
  put(12, box.low);
  put(15, box.high);
}

}  // namespace clearance::cuda
