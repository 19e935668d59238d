#include "engine/cuda/memory/memory.cuh"
#include "engine/cuda/place/place.cuh"
#include "engine/cuda/place/place_kernel.cuh"

namespace clearance::cuda {

namespace {
constexpr std::uint32_t kThreads = 128;
}  // namespace

void start_fixed_boxes(const HullsView& hulls, const BodiesView& bodies, double* boxes, OuterBox* outer,
                       cudaStream_t stream) {
  box_fixed_bodies<<<blocks_of(bodies.bodies, kThreads), kThreads, 0, stream>>>(hulls, bodies, boxes, outer);
  check(cudaGetLastError(), "starting a kernel");
}

void start_links(const FramesView& frames, std::uint32_t configurations, cudaStream_t stream) {
  const std::uint64_t threads = std::uint64_t{frames.robot_count} * configurations;
  place_links<<<blocks_of(threads, kLinkThreads), kLinkThreads, 0, stream>>>(frames, configurations);
  check(cudaGetLastError(), "starting a kernel");
}

void start_bodies(const HullsView& hulls, const BodiesView& bodies, const MovesView& moves,
                  std::uint32_t configurations, cudaStream_t stream) {
  if (moves.placed_count == 0) return;
  const std::uint64_t threads = std::uint64_t{moves.placed_count} * configurations;
  const auto kernel = bodies.uncertainties.fixed ? place_bodies<true> : place_bodies<false>;
  kernel<<<blocks_of(threads, kThreads), kThreads, 0, stream>>>(hulls, bodies, moves, configurations);
  check(cudaGetLastError(), "starting a kernel");
}

}  // namespace clearance::cuda
