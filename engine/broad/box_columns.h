// Boxes as structure of arrays, to compare one box with many at once.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/hull/box.h"

namespace clearance {

/// Pointers to the six coordinates of boxes: low x, y, z, then high x, y, z; each (count,).
struct BoxColumnsView {
  const double* column[6];

  BoxColumnsView from(std::size_t first) const {
    BoxColumnsView v = *this;
    for (const double*& c : v.column) c += first;
    return v;
  }
};

/// Storage for boxes in that form.
class BoxColumns {
 public:
  void resize(std::size_t count) {
    count_ = count;
    memory_.resize(6 * count);
  }
  void assign(std::span<const Aabb> boxes) {
    resize(boxes.size());
    for (std::size_t i = 0; i < boxes.size(); ++i) set(i, boxes[i]);
  }
  std::size_t size() const { return count_; }
  void set(std::size_t i, const Aabb& box) {
    for (std::size_t k = 0; k < 3; ++k) {
      memory_[k * count_ + i] = box.low[k];
      memory_[(3 + k) * count_ + i] = box.high[k];
    }
  }
  BoxColumnsView view() const {
    BoxColumnsView v;
    for (std::size_t k = 0; k < 6; ++k) v.column[k] = memory_.data() + k * count_;
    return v;
  }

 private:
  std::size_t count_ = 0;
  std::vector<double> memory_;
};

/// certify_box_gap() of one box and many, bit for bit.
/// \param gaps (count,)
void box_gaps(const Aabb& a, const BoxColumnsView& b, std::size_t count, double* gaps);
/// The same for box i of one and box i of the other.
void box_gaps(const BoxColumnsView& a, const BoxColumnsView& b, std::size_t count, double* gaps);
/// Lists the gaps that are not beyond `max_distance`, or that are infinite, as for bodies without a pose: ascending
/// indices. Returns their number.
/// \param near (count,) scratch
std::size_t gaps_within(const double* gaps, std::size_t count, double max_distance, std::uint32_t* near);

}  // namespace clearance
