// Geometries of a scene file. Bodies with the same geometry share it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "engine/geometry/geometry.h"
#include "engine/geometry/mesh_geometry.h"
#include "engine/scene_io/yaml_document.h"

namespace clearance {

/// Three edge lengths, or one for a cube.
Vec3d read_box(const YamlValue& value);

/// Reads the geometries of bodies, then builds them. Each function fails at the place in the file.
class GeometryReader {
 public:
  /// \param folder of the scene file
  /// \param allow_outside permits files outside of it
  GeometryReader(std::filesystem::path folder, bool allow_outside)
      : folder_(std::move(folder)), allow_outside_(allow_outside) {}

  /// Reads the one geometry of a body or random shape. Returns its index.
  std::size_t read(const YamlValue& body);
  /// Builds all geometries, in parallel.
  void build();
  const Geometry& at(std::size_t index) const { return *planned_[index].built; }
  /// Returns the path of a file that the scene names, and checks that it may be read.
  std::string resolve(const YamlValue& value, const std::string& named) const;

 private:
  struct Planned {
    YamlValue place;  // of its first use
    std::function<Geometry()> make;
    std::shared_ptr<const Geometry> built;
    std::string error;
  };
  std::size_t add(const std::string& key, const YamlValue& place, std::function<Geometry()> make);
  std::size_t read_mesh(const YamlValue& body, const YamlValue& mesh, double radius);
  std::size_t read_file(const std::string& kind, const YamlValue& body, const YamlValue& value, double radius);

  std::filesystem::path folder_;
  bool allow_outside_;
  std::vector<Planned> planned_;
  std::map<std::string, std::size_t> index_of_;  // by kind and numbers or file
  std::map<std::string, std::shared_ptr<MeshFile>> mesh_files_;
  MeshGeometries meshes_;
  std::uint64_t made_vertices_ = 0;
};

}  // namespace clearance
