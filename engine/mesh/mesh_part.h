// A mesh as the readers of the formats hand it on, one at a time.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/base/triangle.h"
#include "engine/base/vec.h"

namespace clearance {

/// A mesh of a file at one node of its scene graph, the node's transforms applied. Faces may name a vertex twice.
struct MeshPart {
  std::vector<Vec3d> positions;
  std::vector<Triangle> triangles;  ///< indices among `positions`
  double rounding = 0;              ///< metres: how far a position may lie from the one that the file means
};
/// Takes the parts of a file in its order.
using PartSink = std::function<void(MeshPart)>;

/// The part of a list of positions that some corners use, in the order of their first use.
class UsedPositions {
 public:
  explicit UsedPositions(std::span<const Vec3d> positions)
      : positions_(positions), part_(positions.size(), 0), index_(positions.size(), 0) {}

  /// \param used indices of positions, those of `triangles` among them.
  MeshPart part(std::span<const std::uint32_t> used, std::vector<Triangle> triangles) {
    ++parts_;
    MeshPart out;
    for (const std::uint32_t i : used) {
      if (part_[i] == parts_) continue;
      part_[i] = parts_;
      index_[i] = static_cast<std::uint32_t>(out.positions.size());
      out.positions.push_back(positions_[i]);
    }
    out.triangles = std::move(triangles);
    for (Triangle& t : out.triangles)
      for (std::uint32_t& i : t) i = index_[i];
    return out;
  }

 private:
  std::span<const Vec3d> positions_;
  std::vector<std::uint32_t> part_, index_;  // that a position was last used by, and its place there
  std::uint32_t parts_ = 0;
};

/// Readers of whole files: positions in float64, each decimal rounded once, to the nearest. Throw LoadError
/// (mesh_text.h), which names the line of a text file.
///
/// An object, a group or a material begins a part in OBJ, a solid in STL. PLY and OFF are one part, with positions that
/// no face uses; those of OBJ belong to nothing.
void read_obj(std::string_view content, const PartSink& sink);
void read_off(std::string_view content, const PartSink& sink);
void read_ply(std::string_view content, const PartSink& sink);
void read_stl(std::string_view content, const PartSink& sink);

/// Files of points: one part without triangles. Columns and fields behind x, y and z are passed over: of an NPY (N, 3)
/// to (N, 16), of float32 or float64. Pixels of a PCD that are NaN are left out.
void read_xyz(std::string_view content, const PartSink& sink);
void read_npy(std::string_view content, const PartSink& sink);
/// An NPY as a grid of heights: those that are numbers come as (column, row, height).
void read_npy_heights(std::string_view content, const PartSink& sink);
void read_pcd(std::string_view content, const PartSink& sink);
/// An octomap (.bt, .ot): a part of one point, whose x is the edge of a voxel, then one of the centres of all that are
/// occupied, if there are any, where leaves above the last level are cut into voxels.
void read_octomap(std::string_view content, const PartSink& sink);
inline constexpr std::uint64_t kMostPoints = 100'000'000;  ///< numbers of an NPY

}  // namespace clearance
