// Makes geometry from mesh files, with a cache by content.
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/cache/cache.h"
#include "engine/geometry/make_geometry.h"
#include "engine/mesh/mesh.h"

namespace clearance {

/// A mesh file of several bodies, read at most once. Thread-safe.
class MeshFile {
 public:
  explicit MeshFile(std::string path) : path_(std::move(path)) {}
  const std::string& path() const { return path_; }
  /// Digest of the file's bytes. Throws MeshError.
  Sha256Digest digest();
  /// Its mesh. Throws the same MeshError each time.
  const Mesh& mesh();

 private:
  const std::string path_;
  std::mutex mutex_;
  std::optional<Sha256Digest> digest_;
  std::optional<Mesh> mesh_;
  std::string error_;
};

/// Makes each geometry of a scene's mesh files once, by content and recipe, and keeps it in the cache. Thread-safe.
class MeshGeometries {
 public:
  /// Throws MeshError, and std::invalid_argument as geometry_of_mesh() does.
  /// \param source names the file
  Geometry make(MeshFile& file, const MeshRecipe& recipe, const std::string& source);
  const Cache& cache() const { return cache_; }

 private:
  struct GeometrySlot {
    std::mutex mutex;
    std::optional<Geometry> geometry;
  };
  std::string name_of(MeshFile& file, const MeshRecipe& recipe);
  Geometry made(MeshFile& file, const MeshRecipe& recipe, const std::string& name, bool* shared);

  const Cache cache_ = Cache::of_environment();
  std::mutex mutex_;
  std::optional<Sha256Digest> loader_;
  std::map<std::string, std::shared_ptr<GeometrySlot>> slots_;
};

/// Whether a record contains the direction tables. Those of the cache do; elsewhere the tables are computed again,
/// because bounds rest on them.
enum class Tables : bool { kMadeAnew, kKept };

/// A geometry as stored in the cache, without its source.
std::vector<std::byte> geometry_record(const Geometry& geometry, Tables tables = Tables::kKept);
/// The geometry of a record. Returns none for invalid bytes, or for tables where none are allowed; any geometry it
/// returns is valid.
std::optional<Geometry> geometry_of_record(std::span<const std::byte> record, Tables tables = Tables::kKept);

}  // namespace clearance
