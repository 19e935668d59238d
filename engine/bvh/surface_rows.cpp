#include "engine/bvh/surface_rows.h"

namespace clearance {

SurfaceLister::SurfaceLister(const Surface& surface)
    : surface_(surface),
      part_(surface.is_cloud() ? Part::kCloud : Part::kNumbers),
      positions_(surface.vertices().size()) {
  rows_.loaded = surface.is_cloud() ? surface.size() : surface.vertices().size();
  rows_.corners_each = 3;
  number_.reserve(surface.vertices().size());
  if (!surface.is_cloud()) rows_.corners.reserve(3 * std::size_t{surface.size()});
}

bool SurfaceLister::advance(std::size_t steps) {
  while (steps-- > 0)
    if (step()) return true;
  return false;
}

// Whether the current step has more to process; otherwise the next one begins.
bool SurfaceLister::goes_on(std::size_t count, Part next) {
  if (at_ < count) return true;
  at_ = 0;
  part_ = next;
  return false;
}

bool SurfaceLister::step() {
  const std::size_t corners = 3 * std::size_t{surface_.size()};
  switch (part_) {
    case Part::kCloud:
      if (goes_on(surface_.size(), Part::kOver)) list_element(static_cast<std::uint32_t>(at_++));
      return false;
    case Part::kNumbers:
      if (goes_on(surface_.vertices().size(), Part::kCorners)) {
        number_.push_back(positions_.number(surface_.vertices()[at_++]));
        return false;
      }
      begin_.assign(positions_.positions().size() + 1, 0);
      return false;
    case Part::kCorners:
      if (goes_on(corners, Part::kStarts)) {
        rows_.corners.push_back(number_[surface_.triangles()[at_ / 3][at_ % 3]]);
        ++begin_[rows_.corners.back()];  // counts, at first
        ++at_;
      }
      return false;
    case Part::kStarts:
      if (goes_on(begin_.size(), Part::kTriangles)) {
        begin_[at_] += at_ > 0 ? begin_[at_ - 1] : 0;  // ends of the lists; kTriangles fills them from behind
        ++at_;
        return false;
      }
      triangle_.resize(corners);
      met_.assign(positions_.positions().size(), kNew);
      return false;
    case Part::kTriangles:
      if (goes_on(corners, Part::kWalk)) {
        ++at_;
        triangle_[--begin_[rows_.corners[corners - at_]]] = static_cast<std::uint32_t>((corners - at_) / 3);
      }
      return false;
    case Part::kWalk:
      if (!walk()) part_ = Part::kRename;
      return false;
    case Part::kRename:
      if (goes_on(corners, Part::kOver)) {
        rows_.corners[at_] = met_[rows_.corners[at_]];
        ++at_;
      }
      return false;
    case Part::kOver:
      break;
  }
  return true;
}

// Takes one triangle of the current vertex, or the next corner after all of a connected component.
bool SurfaceLister::walk() {
  if (done_ < order_.size()) {
    if (next_ < begin_[order_[done_] + 1]) {
      const std::size_t triangle = triangle_[next_++];
      for (std::size_t k = 0; k < 3; ++k) add_vertex(rows_.corners[3 * triangle + k]);
    } else if (++done_ < order_.size()) {
      next_ = begin_[order_[done_]];
    }
    return true;
  }
  if (!goes_on(rows_.corners.size(), Part::kRename)) return false;
  add_vertex(rows_.corners[at_++]);
  if (done_ < order_.size()) next_ = begin_[order_[done_]];
  return true;
}

void SurfaceLister::add_vertex(std::uint32_t number) {
  if (met_[number] != kNew) return;
  met_[number] = static_cast<std::uint32_t>(order_.size());
  order_.push_back(number);
  rows_.vertices.push_back(positions_.positions()[number]);
}

void SurfaceLister::list_element(std::uint32_t element) {
  const ElementCorners corners = surface_.element(element);
  rows_.corners_each = corners.count;
  for (const Vec3d& v : corners.span()) {
    rows_.corners.push_back(static_cast<std::uint32_t>(rows_.vertices.size()));
    rows_.vertices.push_back(v);
  }
}

}  // namespace clearance
