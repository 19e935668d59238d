#include "engine/cuda/element_kernel.cuh"
#include "engine/cuda/elements.cuh"
#include "engine/surface/surface.h"

namespace clearance::cuda {

static_assert(sizeof(ElementNode) == sizeof(Surface::Node) && Surface::kLeafElements == 4);

void CudaCloud::take(const Surface& cloud) {
  memory_.clear();
  const std::span<const Surface::Node> nodes = cloud.nodes();
  nodes_ = memory_.add(nodes);
  points_ = memory_.add(cloud.points());
  half_ = 0.5 * double{cloud.edge()};
  reach_ = half_ + cloud.rounding();
  memory_.send(nullptr);
  check(cudaStreamSynchronize(nullptr), "copying a cloud to the device");
}

void QueryElements::begin(std::span<const ElementBody> elements, std::size_t bodies, cudaStream_t stream) {
  view_ = {};
  if (elements.empty()) return;
  sets_.clear();
  of_body_.assign(bodies, kNone);
  for (const ElementBody& of : elements) {
    const auto& cloud = static_cast<const CudaCloud&>(*of.cloud);
    of_body_[of.body] = static_cast<std::uint32_t>(sets_.size());
    sets_.push_back({of.piece->extents(), cloud.nodes(), cloud.points(), cloud.half(), cloud.reach(), of.body});
  }
  memory_.clear();
  const std::size_t sets = memory_.add(std::span<const ElementSet>(sets_)),
                    of_body = memory_.add(std::span<const std::uint32_t>(of_body_));
  memory_.send(stream);
  view_ = {memory_.at<ElementSet>(sets), memory_.at<std::uint32_t>(of_body), static_cast<std::uint32_t>(sets_.size())};
}

void start_element_boxes(const ElementsView& elements, const BodiesView& bodies, cudaStream_t stream) {
  box_elements<<<blocks_of(elements.count, kItemThreads), kItemThreads, 0, stream>>>(
      elements, bodies, const_cast<double*>(bodies.fixed) + std::size_t{kPoseComponents} * bodies.bodies,
      const_cast<OuterBox*>(bodies.fixed_box));
  check(cudaGetLastError(), "starting a kernel");
}

void start_element_seeds(const ReducedView& r, cudaStream_t stream) {
  const std::uint64_t groups = std::uint64_t{r.chunk.configurations} * r.groups;
  seed_elements<<<blocks_of(groups, kItemThreads), kItemThreads, 0, stream>>>(r);
  check(cudaGetLastError(), "starting a kernel");
}

void start_elements(const ReducedView& r, cudaStream_t stream) {
  const auto kernel = r.reduce == Reduce::kAny ? look_at_elements<true> : look_at_elements<false>;
  const unsigned blocks = std::min(blocks_of(r.capacity, kElementsAtOnce * kElementThreads / 32), kElementBlocks);
  kernel<<<blocks, kElementThreads, 0, stream>>>(r);
  check(cudaGetLastError(), "starting a kernel");
}

}  // namespace clearance::cuda
