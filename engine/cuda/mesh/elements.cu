#include <algorithm>

#include "engine/cuda/mesh/element_arrays.h"
#include "engine/cuda/mesh/element_kernel.cuh"
#include "engine/cuda/mesh/elements.cuh"

namespace clearance::cuda {

namespace {

// Visits the kinds of pairs that exist.
template <class Visit>
void for_kinds(const ElementKinds& kinds, const Visit& visit) {
  if (kinds.points_and_hull) visit(ElementsAndHull<Points>());
  if (kinds.mesh_and_hull) visit(ElementsAndHull<Triangles>());
  if (kinds.meshes) visit(Meshes());
}

}  // namespace

void CudaElements::take(const Surface& surface) {
  const ElementArrays arrays(surface);
  set_ = arrays.set;
  memory_.clear();
  memory_.add(arrays.nodes, set_.nodes);
  memory_.add(arrays.points, set_.points);
  memory_.add(arrays.slabs, set_.slabs);
  if (!surface.is_cloud()) memory_.add(arrays.corners, set_.corners);
  memory_.add(arrays.parts, set_.parts);
  memory_.send(nullptr);
  check(cudaStreamSynchronize(nullptr), "copying elements to the device");
  if (!surface.is_cloud()) memory_.forget_host();
}

void QueryElements::begin(const QuerySetup& s, std::size_t bodies, cudaStream_t stream) {
  view_ = {};
  if (s.elements.empty()) return;
  sets_.clear();
  of_body_.assign(bodies, kNone);
  for (const ElementBody& of : s.elements) {
    of_body_[of.body] = static_cast<std::uint32_t>(sets_.size());
    ElementSet& set = sets_.emplace_back();
    if (of.resident) set = static_cast<const CudaElements&>(*of.resident).set();
    set.hull = of.hull;
    set.is_empty = of.is_empty;
    set.body = of.body;
  }
  memory_.clear();
  memory_.add(sets_, view_.sets);
  memory_.add(of_body_, view_.of_body);
  memory_.send(stream);
  view_.count = static_cast<std::uint32_t>(sets_.size());
  view_.kinds = s.element_kinds;
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
  for_kinds(r.elements.kinds, [&]<class Kind>(Kind) { seed_elements<Kind><<<blocks, kItemThreads, 0, stream>>>(r); });
  check(cudaGetLastError(), "starting a kernel");
}

void start_elements(const ReducedView& r, cudaStream_t stream) {
  const unsigned blocks =
      std::min(blocks_of(r.capacity, kElementsAtOnce * kElementThreads / 32), blocks_for_device(kElementBlocks));
  const auto evaluate = [&]<class Kind>(Kind) {
    const auto kernel = r.reduce == Reduce::kAny ? evaluate_elements<true, Kind> : evaluate_elements<false, Kind>;
    kernel<<<blocks, kElementThreads, 0, stream>>>(r);
  };
  for_kinds(r.elements.kinds, evaluate);
  check(cudaGetLastError(), "starting a kernel");
}

}  // namespace clearance::cuda
