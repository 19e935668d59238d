// Mesh files, read by a child process that may crash, hang or run out of memory without harm to this one.
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

/// A mesh of the file at one node of its scene graph; transforms of the nodes applied. Metres, if the file's unit is.
struct Submesh {
  std::vector<Vec3d> vertices;        ///< every position of the mesh, exact duplicates merged
  std::vector<Triangle> triangles;    ///< empty for points and lines
  std::uint64_t loaded_vertices = 0;  ///< before exact duplicates were merged
  double rounding = 0;                ///< metres: how far a vertex may lie from the position that the file means
};

/// What a mesh file holds.
///
/// Positions of OBJ, PLY, OFF and STL are the float64 nearest to each decimal of the file, or its float32 or float64 as
/// it is; those of glTF too, moved by the transforms of its nodes in float64. DAE is read in float32 (assimp). What
/// that rounds is bounded by Submesh::rounding; 0: nothing is. Positions that no face uses are kept in PLY and OFF;
/// those of OBJ, DAE and glTF belong to no mesh of the file and do not arrive.
struct Mesh {
  std::vector<Submesh> submeshes;  ///< at least one, each with at least one vertex
  Sha256Digest digest{};           ///< of the file's bytes, those that were read
  bool alone = false;              ///< nothing else was read: the reader has asked for no other file
};

/// A mesh file that cannot be used: the text names the cause, not the file.
struct MeshError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// What the reading process may use.
struct MeshLimits {
  std::chrono::milliseconds time{60'000};               ///< wall clock, and the same of processor time
  std::uint64_t memory_bytes = std::uint64_t{4} << 30;  ///< address space
  std::uint64_t file_bytes = std::uint64_t{2} << 30;
};

/// The digest of a file's bytes, which Mesh::digest would be. Throws MeshError, as load_mesh() would without reading
/// it.
Sha256Digest mesh_file_digest(const std::string& path, const MeshLimits& limits = {});

/// Reads a file of a format that mesh_formats.h lists. Other files that it names are opened only inside its folder.
/// Throws MeshError.
Mesh load_mesh(const std::string& path, const MeshLimits& limits = {});

/// The points of a PLY (with or without faces), XYZ, NPY or PCD file, in the file's order, equal ones once. Throws
/// MeshError.
std::vector<Vec3d> load_points(const std::string& path, const MeshLimits& limits = {});
/// The grid of heights of an NPY file: (column, row, height) of each height that is a number. Throws MeshError.
std::vector<Vec3d> load_heights(const std::string& path, const MeshLimits& limits = {});

/// The occupied space of an octomap.
struct Octomap {
  double edge = 0;             ///< of a voxel, metres
  std::vector<Vec3d> centres;  ///< of the occupied ones, each coordinate rounded once; there may be none
};
/// Reads a BT or OT file. Throws MeshError.
Octomap load_octomap(const std::string& path, const MeshLimits& limits = {});

/// What is missing from the limits of the loaders that have run in this process so far; empty if nothing is.
std::string mesh_loader_warning();

/// The program that reads meshes: $CLEARANCE_MESH_LOADER, or `clearance-mesh-loader` beside this library or program, in
/// the libexec folder next to it, or where this library was built. Throws MeshError if there is none.
std::string mesh_loader_program();
/// Of that program's bytes: what it makes of a file may change with it. Throws MeshError.
Sha256Digest mesh_loader_digest();

}  // namespace clearance
