// Clouds and meshes in device memory, and what starts the kernels that look at them, which are compiled by themselves.
#pragma once

#include <vector>

#include "engine/cuda/memory/memory.cuh"
#include "engine/device/device.h"

namespace clearance::cuda {

/// A surface's tree and elements in device memory.
class CudaElements final : public ResidentElements {
 public:
  explicit CudaElements(MemoryCounters& counters) : memory_(counters) {}
  /// In the place of what was there. Waits until it is on the calling thread's device.
  void take(const Surface& surface);

  /// But for the body and its hull.
  const ElementSet& set() const { return set_; }

 private:
  Upload memory_;  // its pinned memory stays, for the next points
  ElementSet set_{};
};

/// The bodies of elements of a query.
class QueryElements {
 public:
  explicit QueryElements(MemoryCounters& counters) : memory_(counters) {}
  /// \param bodies of the scene
  void begin(const QuerySetup& s, std::size_t bodies, cudaStream_t stream);
  /// Null where there are none.
  const ElementsView& view() const { return view_; }

 private:
  Upload memory_;
  std::vector<ElementSet> sets_;
  std::vector<std::uint32_t> of_body_;
  ElementsView view_{};
};

/// Boxes of those that stay, where those of other bodies are.
void start_element_boxes(const ElementsView& elements, const BodiesView& bodies, cudaStream_t stream);
/// The same of those that a chunk moves, once they are placed.
void start_moved_element_boxes(const ChunkView& chunk, const ElementsView& elements, cudaStream_t stream);
/// What the seeds that are pairs of elements cut off.
void start_element_seeds(const ReducedView& r, cudaStream_t stream);
/// Looks at those of the listed pairs that are of elements.
void start_elements(const ReducedView& r, cudaStream_t stream);

}  // namespace clearance::cuda
