// A mesh file read by assimp: in float32, inside the file's folder, with what assimp only logs made an error.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "engine/mesh/mesh_folder.h"
#include "engine/mesh/mesh_part.h"
#include "engine/mesh/mesh_transform.h"

struct aiNode;
struct aiScene;
namespace Assimp {
class Importer;
}

namespace clearance {

struct AssimpSettings {
  std::string extension;         ///< lower case, without its dot: selects assimp's importer
  bool has_fans = false;         ///< faces of more than three corners are fans around their first one, not polygons
  double node_rounding = 0;      ///< bound on the relative error of each entry of a node's matrix
  double position_rounding = 0;  ///< bound on the error of a coordinate, relative to the largest one of its mesh
  bool inverts_nodes = false;    ///< assimp multiplies positions by the inverse of a matrix of theirs
};

class AssimpFile {
 public:
  /// Reads a file. Throws LoadError and std::bad_alloc.
  /// \param kept gets the importer, with its scene
  /// \param content must outlive the importer
  AssimpFile(std::unique_ptr<Assimp::Importer>* kept, const std::filesystem::path& path, std::string_view content,
             const MeshFolder& folder, AssimpSettings settings);

  const aiScene& scene() const { return *scene_; }

  /// Largest condition number of a node's matrix, at least 1.
  double worst_condition() const;

  /// Hands on a part for each mesh of each node that shows one, front to back. Throws LoadError.
  /// \param root is applied after the root node's own transform
  /// \param most_vertices of all parts together, if nodes repeat meshes
  void read(const MeshTransform& root, std::uint64_t most_vertices, const PartSink& sink) const;

 private:
  struct Shown {
    unsigned mesh;
    MeshTransform X;
  };
  MeshTransform transform_of_node(const aiNode& node) const;
  std::vector<Shown> walk(const MeshTransform& root, std::uint64_t most_vertices) const;
  MeshPart part(unsigned index) const;

  AssimpSettings settings_;
  const aiScene* scene_;
};

}  // namespace clearance
