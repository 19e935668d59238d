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

/// Faces whose positions may follow later in the file.
///
/// A face becomes a fan around its first corner if that covers exactly the face, as for a convex face, else its ears
/// are cut. Exact predicates check that no triangle is inverted along the face's normal.
class FaceList {
 public:
  /// Throws LoadError for a face that cannot be cut.
  /// \param place as passed to add()
  using Fail = std::function<void(std::size_t place, const std::string& what)>;

  /// Adds a face.
  /// \param corners fewer than three are ignored
  /// \param place names the face in an error
  void add(std::span<const std::uint32_t> corners, std::size_t place);

  /// Returns the triangles of all faces in their order, and leaves the list empty. Raises `rounding` (metres) where a
  /// face crosses itself by no more than the rounding of float32; calls `fail` for a larger crossing.
  std::vector<Triangle> take_triangles(std::span<const Vec3d> positions, double* rounding, const Fail& fail);

 private:
  struct Polygon {
    std::size_t before;  ///< triangles before it
    std::size_t place;
    std::uint32_t count;  ///< corners, which follow those of the previous polygon
  };
  std::vector<Triangle> triangles_;  // of faces of three corners
  std::vector<Polygon> polygons_;
  std::vector<std::uint32_t> corners_;  // of the polygons
};

}  // namespace clearance
