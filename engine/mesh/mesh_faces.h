// Faces of a mesh file, cut into triangles.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "engine/base/triangle.h"
#include "engine/base/vec.h"

namespace clearance {

/// Appends the triangles of a fan around the first corner; none for less than three corners.
inline void add_fan(std::vector<Triangle>* triangles, std::span<const std::uint32_t> corners) {
  for (std::size_t k = 1; k + 1 < corners.size(); ++k) triangles->push_back({corners[0], corners[k], corners[k + 1]});
}

/// Faces whose corners may have their positions later in the file.
///
/// A face is a fan around its first corner where that covers the face and nothing else, as it does if the face is
/// convex; otherwise its ears are cut. Both are checked exactly, as seen along the face's normal: no triangle is turned
/// over. A face that is not flat is the triangles that it is cut into.
class FaceList {
 public:
  /// Reports that a face cannot be cut: throws LoadError. \param place as add() was given it
  using Fail = std::function<void(std::size_t place, const std::string& what)>;

  /// \param corners less than three are no face. \param place names the face in an error
  void add(std::span<const std::uint32_t> corners, std::size_t place);

  /// Returns the triangles of all faces in their order, and leaves the list empty. Raises `rounding` (metres) where a
  /// face crosses itself by no more than float32 rounds its coordinates; calls `fail` where it does by more.
  std::vector<Triangle> take_triangles(std::span<const Vec3d> positions, double* rounding, const Fail& fail);

 private:
  struct Polygon {
    std::size_t before;  ///< triangles that come before it
    std::size_t place;
    std::uint32_t count;  ///< of its corners, which follow those of the polygon before
  };
  std::vector<Triangle> triangles_;  // of faces of three corners
  std::vector<Polygon> polygons_;
  std::vector<std::uint32_t> corners_;  // of the polygons
};

}  // namespace clearance
