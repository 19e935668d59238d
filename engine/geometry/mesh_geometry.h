// Mesh files to geometry, by way of the cache: what was made of the same bytes before is not made again.
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

/// A mesh file that several bodies may be made of: looked at and read at most once. For several threads.
class MeshFile {
 public:
  explicit MeshFile(std::string path) : path_(std::move(path)) {}
  const std::string& path() const { return path_; }
  /// Of the file's bytes. Throws MeshError.
  Sha256Digest digest();
  /// What it holds. Throws MeshError, each time the same.
  const Mesh& mesh();
  /// The file of pieces that are proposed for it, which `clearance decompose` writes; null where there is none.
  MeshFile* pieces();

 private:
  const std::string path_;
  std::mutex mutex_;
  std::optional<Sha256Digest> digest_;
  std::optional<Mesh> mesh_;
  std::string error_;
  std::unique_ptr<MeshFile> pieces_;
};

/// Where the pieces that are proposed for a mesh are looked for: its path and this.
inline constexpr std::string_view kPiecesExtension = ".pieces.obj";

/// Makes the geometries of a scene's mesh files, those of equal bytes and recipes once, and keeps them in the cache.
/// For several threads.
class MeshGeometries {
 public:
  /// \param source names the file. Throws MeshError, and std::invalid_argument as geometry_of_mesh() does.
  Geometry make(MeshFile& file, const MeshRecipe& recipe, const std::string& source);
  const Cache& cache() const { return cache_; }

 private:
  struct Slot {
    std::mutex mutex;
    std::optional<Geometry> geometry;
  };
  std::string name_of(MeshFile& file, const MeshRecipe& recipe);
  Geometry made(MeshFile& file, const MeshRecipe& recipe, const std::string& name, bool* shared);

  const Cache cache_ = Cache::of_environment();
  std::mutex mutex_;
  std::optional<Sha256Digest> loader_;
  std::map<std::string, std::shared_ptr<Slot>> slots_;
};

/// Whether a record holds the direction tables: the cache's do, and are read by who wrote them. Elsewhere tables are
/// made anew, since bounds rest on them.
enum class Tables : bool { kMadeAnew, kKept };

/// A geometry as the cache keeps it, without its source.
std::vector<std::byte> geometry_record(const Geometry& geometry, Tables tables = Tables::kKept);
/// The geometry of a record; none for bytes that are no record, or that hold tables where they should not. Whatever the
/// bytes, what comes back can be computed with.
std::optional<Geometry> geometry_of_record(std::span<const std::byte> record, Tables tables = Tables::kKept);

}  // namespace clearance
