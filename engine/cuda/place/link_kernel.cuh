// Link frames from joint positions: one thread per robot and configuration, which walks its steps.
#pragma once

#include "engine/cuda/place/link_frames.cuh"

namespace clearance::cuda {

inline constexpr std::uint32_t kLinkThreads = 32;  // per block: configurations are few, and each takes long

__global__ void __launch_bounds__(kLinkThreads) place_links(FramesView f, std::uint32_t configurations) {
  const std::uint64_t item = std::uint64_t{blockIdx.x} * blockDim.x + threadIdx.x;
  const auto which = static_cast<std::uint32_t>(item / configurations),
             k = static_cast<std::uint32_t>(item % configurations);
  if (which < f.robot_count) place_links_of(f, which, k, configurations);
}

}  // namespace clearance::cuda
