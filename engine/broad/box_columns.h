// Boxes one coordinate after another, so that one box meets many at once.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/hull/box.h"

namespace clearance {

/// Where the six coordinates of boxes begin: low x, y, z, then high x, y, z; each (count,).
struct BoxColumnsView {
  const double* column[6];

  Aabb at(std::size_t i) const {
    return {{column[0][i], column[1][i], column[2][i]}, {column[3][i], column[4][i], column[5][i]}};
  }
  BoxColumnsView from(std::size_t first) const {
    BoxColumnsView v = *this;
    for (const double*& c : v.column) c += first;
    return v;
  }
};

/// Room for boxes in that form.
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
  double* column(std::size_t k) { return memory_.data() + k * count_; }

 private:
  std::size_t count_ = 0;
  std::vector<double> memory_;
};

/// certify_box_gap() of one box and many, bit for bit. \param gaps (count,)
void box_gaps(const Aabb& a, const BoxColumnsView& b, std::size_t count, double* gaps);
/// The same of box i of one and box i of the other.
void box_gaps(const BoxColumnsView& a, const BoxColumnsView& b, std::size_t count, double* gaps);
/// Where the numbers of poses begin: rotations row by row, then origins in the world; each (count,).
struct PoseColumnsView {
  const double* column[12];
};
/// certify_box() of a piece in many poses, bit for bit. \param boxes of as many
void certify_boxes(const Piece& piece, const PoseColumnsView& at, BoxColumns& boxes);
/// joined() of box i of one and box i of the other, bit for bit, in place of the latter.
void join_boxes(const BoxColumns& boxes, BoxColumns& wholes);
/// Which of many gaps are not beyond `max_distance`, or infinite, as those of bodies without a place: ascending.
/// \param near (count,) room. Returns how many there are.
std::size_t gaps_within(const double* gaps, std::size_t count, double max_distance, std::uint32_t* near);

}  // namespace clearance
