// Meshes as readers return them, one part at a time.
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

/// A mesh at one node of a file's scene graph, with transforms applied. Faces may repeat a vertex.
struct MeshPart {
  std::vector<Vec3d> positions;
  std::vector<Triangle> triangles;  ///< indices among `positions`
  double rounding = 0;              ///< bound on the error of a position, in metres
};
/// Receives the parts of a file in order.
using PartSink = std::function<void(MeshPart)>;

/// Extracts the positions that a part uses, in the order of their first use.
class UsedPositions {
 public:
  explicit UsedPositions(std::span<const Vec3d> positions)
      : positions_(positions), part_(positions.size(), 0), index_(positions.size(), 0) {}

  /// \param used indices of positions, including those of `triangles`
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
  std::vector<std::uint32_t> part_, index_;  // last part that used a position, and its index there
  std::uint32_t parts_ = 0;
};

/// Readers of whole files. Positions are float64, each decimal rounded once to nearest. They throw LoadError
/// (mesh_text.h), which names the line of a text file.
///
/// An object, a group or a material begins a part in OBJ, a solid in STL. PLY and OFF are one part, with positions that
/// no face uses; OBJ drops those.
void read_obj(std::string_view content, const PartSink& sink);
void read_off(std::string_view content, const PartSink& sink);
void read_ply(std::string_view content, const PartSink& sink);
void read_stl(std::string_view content, const PartSink& sink);

/// Files of points: one part without triangles. Further columns and fields are ignored; an NPY may be (N, 3) to (N,
/// 16), float32 or float64. NaN pixels of a PCD are dropped.
void read_xyz(std::string_view content, const PartSink& sink);
void read_npy(std::string_view content, const PartSink& sink);
/// An NPY as a grid of heights, as (column, row, height) without NaN.
void read_npy_heights(std::string_view content, const PartSink& sink);
void read_pcd(std::string_view content, const PartSink& sink);
/// An octomap (.bt, .ot): a part of one point whose x is a voxel's edge, then a part of the centres of occupied voxels,
/// if any. Leaves above the last level are split into voxels.
void read_octomap(std::string_view content, const PartSink& sink);
inline constexpr std::uint64_t kMostPoints = 100'000'000;  ///< numbers of an NPY

}  // namespace clearance
