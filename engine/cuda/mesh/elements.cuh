// Clouds and meshes in device memory, and launches of their kernels, which are compiled separately.
#pragma once

#include <vector>

#include "engine/cuda/memory/memory.cuh"
#include "engine/device/device.h"

namespace clearance::cuda {

/// A surface's tree and elements in device memory.
class CudaElements final : public ResidentElements {
 public:
  explicit CudaElements(MemoryCounters& counters) : memory_(counters) {}
  /// Replaces the contents. Returns when they are on the calling thread's device.
  void take(const Surface& surface);

  /// Complete except for the body and its hull.
  const ElementSet& set() const { return set_; }

 private:
  Upload memory_;  // its pinned memory is kept for the next points
  ElementSet set_{};
};

/// Bodies with elements of a query.
class QueryElements {
 public:
  explicit QueryElements(MemoryCounters& counters) : memory_(counters) {}
  /// \param bodies of the scene
  void begin(const QuerySetup& s, std::size_t bodies, cudaStream_t stream);
  /// Its pointers are null if there are none.
  const ElementsView& view() const { return view_; }

 private:
  Upload memory_;
  std::vector<ElementSet> sets_;
  std::vector<std::uint32_t> of_body_;
  ElementsView view_{};
};

/// Boxes of fixed bodies with elements, written where those of other bodies are.
void start_element_boxes(const ElementsView& elements, const BodiesView& bodies, cudaStream_t stream);
/// The same for bodies moved by a chunk, after placing.
void start_moved_element_boxes(const ChunkView& chunk, const ElementsView& elements, cudaStream_t stream);
/// Cutoffs by the seeds that are pairs with elements.
void start_element_seeds(const ReducedView& r, cudaStream_t stream);
/// Evaluates the candidates with elements.
void start_elements(const ReducedView& r, cudaStream_t stream);

}  // namespace clearance::cuda
