#include "engine/geometry/mesh_geometry.h"

#include <filesystem>
#include <utility>

#include "algorithm_version.h"

namespace clearance {

Sha256Digest MeshFile::digest() {
  const std::lock_guard lock(mutex_);
  if (!digest_) digest_ = mesh_file_digest(path_);
  return *digest_;
}

const Mesh& MeshFile::mesh() {
  const std::lock_guard lock(mutex_);
  if (!mesh_ && error_.empty()) try {
      mesh_ = load_mesh(path_);
    } catch (const MeshError& error) {
      error_ = error.what();
    }
  if (!mesh_) throw MeshError(error_);
  return *mesh_;
}

// Key of all inputs of a geometry: the engine's code, the mesh loader, the file and the recipe.
std::string MeshGeometries::name_of(MeshFile& file, const MeshRecipe& recipe) {
  CacheKey key("mesh", kAlgorithmVersion);
  {
    const std::lock_guard lock(mutex_);
    if (!loader_) loader_ = mesh_loader_digest();
    key.add(*loader_);
  }
  key.add(file.digest()).add(std::filesystem::path(file.path()).extension().string());
  for (int k = 0; k < 3; ++k) key.add(recipe.scale[k]);
  key.add(static_cast<std::uint64_t>(recipe.up));
  return key.add(static_cast<std::uint64_t>(recipe.mesh_as)).add(recipe.radius).name();
}

Geometry MeshGeometries::make(MeshFile& file, const MeshRecipe& recipe, const std::string& source) {
  const std::string name = name_of(file, recipe);
  std::shared_ptr<GeometrySlot> slot;
  {
    const std::lock_guard lock(mutex_);
    std::shared_ptr<GeometrySlot>& place = slots_[name];
    if (!place) place = std::make_shared<GeometrySlot>();
    slot = place;
  }
  const std::lock_guard lock(slot->mutex);
  Geometry geometry;
  if (slot->geometry) {
    geometry = *slot->geometry;
  } else {
    bool shared = false;
    geometry = made(file, recipe, name, &shared);
    if (shared) slot->geometry = geometry;
  }
  geometry.source = mesh_source(source, recipe.mesh_as, geometry);
  return geometry;
}

// \param shared set if every file of these bytes has this geometry. Not if it depends on other files, or if the bytes
// changed after the key was made.
Geometry MeshGeometries::made(MeshFile& file, const MeshRecipe& recipe, const std::string& name, bool* shared) {
  if (const auto record = cache_.read(name))
    if (std::optional<Geometry> kept = geometry_of_record(*record)) {
      *shared = true;
      return std::move(*kept);
    }
  const Mesh& mesh = file.mesh();
  Geometry geometry = geometry_of_mesh(mesh, recipe, "");
  *shared = mesh.alone && mesh.digest == file.digest();
  if (*shared && cache_.is_on()) cache_.write(name, geometry_record(geometry));
  return geometry;
}

}  // namespace clearance
