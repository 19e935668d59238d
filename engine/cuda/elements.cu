#include <algorithm>

#include "engine/cuda/element_arrays.h"
#include "engine/cuda/element_kernel.cuh"
#include "engine/cuda/elements.cuh"

namespace clearance::cuda {

void CudaElements::take(const Surface& surface) {
  const ElementArrays arrays(surface);
  memory_.clear();
  const std::size_t nodes = memory_.add(arrays.nodes), points = memory_.add(arrays.points),
                    slabs = memory_.add(arrays.slabs), corners = memory_.add(std::span<const double>(arrays.corners));
  memory_.send(nullptr);
  check(cudaStreamSynchronize(nullptr), "copying elements to the device");
  set_ = arrays.set;
  set_.nodes = memory_.at<ElementNode>(nodes);
  set_.points = memory_.at<float>(points);
  set_.slabs = memory_.at<ElementSlab>(slabs);
  set_.corners = surface.is_cloud() ? nullptr : memory_.at<double>(corners);
  if (!surface.is_cloud()) memory_.forget_host();
}

void QueryElements::begin(std::span<const ElementBody> elements, std::size_t bodies, cudaStream_t stream) {
  view_ = {};
  if (elements.empty()) return;
  sets_.clear();
  of_body_.assign(bodies, kNone);
  for (const ElementBody& of : elements) {
    of_body_[of.body] = static_cast<std::uint32_t>(sets_.size());
    ElementSet& set = sets_.emplace_back(static_cast<const CudaElements&>(*of.resident).set());
    set.hull = of.piece->extents();
    set.body = of.body;
  }
  memory_.clear();
  const std::size_t sets = memory_.add(std::span<const ElementSet>(sets_)),
                    of_body = memory_.add(std::span<const std::uint32_t>(of_body_));
  memory_.send(stream);
  const auto has = [&](bool mesh) {
    return std::ranges::any_of(sets_, [&](const ElementSet& set) { return set.is_mesh() == mesh; });
  };
  view_ = {memory_.at<ElementSet>(sets), memory_.at<std::uint32_t>(of_body), static_cast<std::uint32_t>(sets_.size()),
           has(false), has(true)};
}

void start_element_boxes(const ElementsView& elements, const BodiesView& bodies, cudaStream_t stream) {
  box_elements<<<blocks_of(elements.count, kItemThreads), kItemThreads, 0, stream>>>(
      elements, bodies, const_cast<double*>(bodies.fixed) + std::size_t{kPoseComponents} * bodies.bodies,
      const_cast<OuterBox*>(bodies.fixed_box));
  check(cudaGetLastError(), "starting a kernel");
}

void start_moved_element_boxes(const ChunkView& chunk, const ElementsView& elements, cudaStream_t stream) {
  const std::uint64_t all = std::uint64_t{chunk.bodies.moved_count} * chunk.configurations;
  if (all == 0) return;
  box_moved_elements<<<blocks_of(all, kItemThreads), kItemThreads, 0, stream>>>(elements, chunk.bodies,
                                                                                chunk.configurations);
  check(cudaGetLastError(), "starting a kernel");
}

void start_element_seeds(const ReducedView& r, cudaStream_t stream) {
  const unsigned blocks = blocks_of(std::uint64_t{r.chunk.configurations} * r.groups, kItemThreads);
  if (r.elements.has_points) seed_elements<Points><<<blocks, kItemThreads, 0, stream>>>(r);
  if (r.elements.has_triangles) seed_elements<Triangles><<<blocks, kItemThreads, 0, stream>>>(r);
  check(cudaGetLastError(), "starting a kernel");
}

void start_elements(const ReducedView& r, cudaStream_t stream) {
  const bool any = r.reduce == Reduce::kAny;
  const auto of_points = any ? look_at_elements<true, Points> : look_at_elements<false, Points>,
             of_triangles = any ? look_at_elements<true, Triangles> : look_at_elements<false, Triangles>;
  const unsigned blocks = std::min(blocks_of(r.capacity, kElementsAtOnce * kElementThreads / 32), kElementBlocks);
  if (r.elements.has_points) of_points<<<blocks, kElementThreads, 0, stream>>>(r);
  if (r.elements.has_triangles) of_triangles<<<blocks, kElementThreads, 0, stream>>>(r);
  check(cudaGetLastError(), "starting a kernel");
}

}  // namespace clearance::cuda
