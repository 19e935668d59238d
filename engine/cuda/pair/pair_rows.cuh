// Columns of the rows of pairs (engine/selection/columns.h), written by one thread per row.
#pragma once

#include "engine/cuda/pair/hull.cuh"

namespace clearance::cuda {

__device__ inline std::uint16_t flags_of(const BodyPoseRef& a, const BodyPoseRef& b) {
  const std::uint8_t states = a.state | b.state;
  return (states & kStateRenormalised ? kFlagRenormalised : 0) | (states & kStateBeyondLimits ? kFlagBeyondLimits : 0);
}
// As three stores of 8 bytes.
__device__ inline void write_points32(float* points32, std::uint64_t row, const PairAnswer& answer) {
  const auto a = cast<float>(answer.point_a), b = cast<float>(answer.point_b);
  auto* pairs = reinterpret_cast<float2*>(points32 + 6 * row);
  pairs[0] = {a.x, a.y};
  pairs[1] = {a.z, b.x};
  pairs[2] = {b.y, b.z};
}
// Writes a row of the column gradient_joints. Not inlined, so that it takes no registers from other columns.
__device__ __noinline__ inline void write_gradient_joints(const ChunkView& c, std::uint64_t row, std::uint32_t k,
                                                          const BodyPoseRef& at_a, const BodyPoseRef& at_b,
                                                          const PairAnswer& answer) {
  const auto pose_of = [&](std::uint32_t ref) {
    const BodyPoseRef at(c.bodies, c.configurations, ref, k);
    return PlacedFrame{at.rotation(), at.translation()};
  };
  write_joint_gradient(c.movers.movers, c.movers.of_body[at_a.body], c.movers.of_body[at_b.body], answer,
                       at_a.translation(), at_b.translation(), pose_of, c.reply.joints,
                       c.reply.gradient_joints + row * c.reply.joints);
}
// Writes a row that belongs to no pair.
__device__ inline void write_no_pair(const ChunkView& c, std::uint64_t row, std::uint32_t k, BodyPair pair,
                                     const PairAnswer& answer) {
  write_row(c.reply, row, pair, static_cast<std::uint32_t>(c.first_configuration + k), answer, {0, 0, 0}, {0, 0, 0});
  for (std::uint32_t j = 0; c.reply.gradient_joints && j < c.reply.joints; ++j)
    c.reply.gradient_joints[row * c.reply.joints + j] = __builtin_nan("");
}
template <bool kLean = false>
__device__ inline void write_answer(const ChunkView& c, std::uint64_t row, std::uint32_t k, const BodyPoseRef& at_a,
                                    const BodyPoseRef& at_b, const PairAnswer& answer) {
  if (kLean) {
    write_interval(c.reply, row, answer);
    if (c.reply.pair) c.reply.pair[row] = {at_a.body, at_b.body};
    if (c.reply.configuration) c.reply.configuration[row] = static_cast<std::uint32_t>(c.first_configuration + k);
    if (c.reply.points32) write_points32(c.reply.points32, row, answer);
    return;
  }
  write_row(c.reply, row, {at_a.body, at_b.body}, static_cast<std::uint32_t>(c.first_configuration + k), answer,
            at_a.translation(), at_b.translation());
  if (c.reply.gradient_joints) write_gradient_joints(c, row, k, at_a, at_b, answer);
}

}  // namespace clearance::cuda
