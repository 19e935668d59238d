// Clouds in device memory, and what starts the kernels that look at them, which are compiled by themselves.
#pragma once

#include <span>
#include <vector>

#include "engine/cuda/memory.cuh"
#include "engine/device/device.h"

namespace clearance::cuda {

/// A cloud's tree and points in device memory.
class CudaCloud final : public ResidentCloud {
 public:
  explicit CudaCloud(MemoryCounters& counters) : memory_(counters) {}
  /// In the place of what was there. Waits until it is on the calling thread's device.
  void take(const Surface& cloud);

  const ElementNode* nodes() const { return memory_.at<ElementNode>(nodes_); }
  const float* points() const { return memory_.at<float>(points_); }
  double half() const { return half_; }
  double reach() const { return reach_; }

 private:
  Upload memory_;  // its pinned memory stays, for the next points
  std::size_t nodes_ = 0, points_ = 0;
  double half_ = 0, reach_ = 0;
};

/// The clouds of a query.
class QueryElements {
 public:
  explicit QueryElements(MemoryCounters& counters) : memory_(counters) {}
  /// \param bodies of the scene
  void begin(std::span<const ElementBody> elements, std::size_t bodies, cudaStream_t stream);
  /// Null where there are none.
  const ElementsView& view() const { return view_; }

 private:
  Upload memory_;
  std::vector<ElementSet> sets_;
  std::vector<std::uint32_t> of_body_;
  ElementsView view_{};
};

/// Boxes of the clouds, where those of other bodies are.
void start_element_boxes(const ElementsView& elements, const BodiesView& bodies, cudaStream_t stream);
/// What the seeds that are pairs of clouds cut off.
void start_element_seeds(const ReducedView& r, cudaStream_t stream);
/// Looks at those of the listed pairs that are of clouds.
void start_elements(const ReducedView& r, cudaStream_t stream);

}  // namespace clearance::cuda
