// Mesh files, read by a child process that may crash, hang or run out of memory.
#pragma once

#include <chrono>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "engine/base/triangle.h"
#include "engine/base/vec.h"
#include "engine/cache/sha256.h"

namespace clearance {

/// A mesh at one node of a file's scene graph, with all transforms applied. In metres unless the file has other
/// numbers.
struct Submesh {
  std::vector<Vec3d> vertices;        ///< positions without exact duplicates
  std::vector<Triangle> triangles;    ///< empty for points and lines
  std::uint64_t loaded_vertices = 0;  ///< before exact duplicates were merged
  double rounding = 0;                ///< bound on the error of a vertex, in metres
};

/// Content of a mesh file.
///
/// Positions of OBJ, PLY, OFF, STL and glTF are the file's float32 or float64, or the float64 nearest to its decimal;
/// transforms of glTF nodes are float64. Other formats are read in float32 (assimp). Submesh::rounding bounds the
/// rounding and is 0 if there is none. Positions that no face uses are kept in PLY and OFF and dropped elsewhere.
struct Mesh {
  std::vector<Submesh> submeshes;  ///< at least one, each with at least one vertex
  Sha256Digest digest{};           ///< of the bytes that were read
  bool alone = false;              ///< no other file was requested
};

/// A mesh file that cannot be used. The text names the cause, not the file.
struct MeshError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Limits of the reading process.
struct MeshLimits {
  std::chrono::milliseconds time{60'000};               ///< wall clock; also the limit of processor time
  std::uint64_t memory_bytes = std::uint64_t{4} << 30;  ///< address space
  std::uint64_t file_bytes = std::uint64_t{2} << 30;
};

/// Returns Mesh::digest without importing the file. Throws MeshError.
Sha256Digest mesh_file_digest(const std::string& path, const MeshLimits& limits = {});

/// Reads a file of a format that mesh_formats.h lists. Other files that it names are opened only inside its folder.
/// Throws MeshError.
Mesh load_mesh(const std::string& path, const MeshLimits& limits = {});

/// Returns the points of a PLY (with or without faces), XYZ, NPY or PCD file, in the file's order, equal ones once.
/// Throws MeshError.
std::vector<Vec3d> load_points(const std::string& path, const MeshLimits& limits = {});
/// Returns the grid of heights of an NPY file: (column, row, height) of each height that is a number. Throws MeshError.
std::vector<Vec3d> load_heights(const std::string& path, const MeshLimits& limits = {});

/// The occupied space of an octomap.
struct Octomap {
  double edge = 0;             ///< of a voxel, metres
  std::vector<Vec3d> centres;  ///< of occupied voxels, each coordinate rounded once; may be empty
};
/// Reads a BT or OT file. Throws MeshError.
Octomap load_octomap(const std::string& path, const MeshLimits& limits = {});

/// Returns a warning if a loader of this process ran without all of its limits, else an empty text.
std::string mesh_loader_warning();

/// Path of the mesh loader: $CLEARANCE_MESH_LOADER, or `clearance-mesh-loader` in the folder of this library or
/// program, in the libexec folder next to it, or where this library was built. Throws MeshError if there is none.
std::string mesh_loader_program();
/// Digest of the mesh loader's bytes, since its results may change with the program. Throws MeshError.
Sha256Digest mesh_loader_digest();

}  // namespace clearance
