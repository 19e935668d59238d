#include "engine/mesh/readers/mesh_import.h"

#include <unistd.h>

#include <algorithm>
#include <assimp/Importer.hpp>
#include <cerrno>
#include <filesystem>
#include <new>
#include <stdexcept>
#include <vector>

#include "engine/base/dedupe.h"
#include "engine/mesh/mesh_folder.h"
#include "engine/mesh/mesh_format.h"
#include "engine/mesh/mesh_part.h"
#include "engine/mesh/mesh_text.h"
#include "engine/mesh/readers/mesh_assimp.h"
#include "engine/mesh/readers/mesh_dae.h"
#include "engine/mesh/readers/mesh_gltf.h"

namespace clearance {

namespace fs = std::filesystem;

namespace {

// Limit of vertices of a file whose nodes repeat meshes, the same as for a scene file.
constexpr std::uint64_t kMostRepeatedVertices = 20'000'000;

// The result file, written sequentially with the header last.
class Result {
 public:
  Result(int fd, std::uint64_t memory_bytes) : fd_(fd), memory_bytes_(memory_bytes) {}

  /// Writes the distinct positions of a part and its triangles of three distinct corners. Skips an empty part.
  void add(const MeshPart& part) {
    if (part.positions.empty()) return;
    const UniquePositions<double> unique = unique_positions<double>(part.positions);
    std::vector<Triangle> triangles;
    triangles.reserve(part.triangles.size());
    for (const Triangle& corners : part.triangles) {
      const Triangle t = {unique.index[corners[0]], unique.index[corners[1]], unique.index[corners[2]]};
      if (t[0] != t[1] && t[1] != t[2] && t[2] != t[0]) triangles.push_back(t);
    }
    const SubmeshHeader header{unique.positions.size(), triangles.size(), part.positions.size(), part.rounding};
    write(&header, sizeof header);
    write(unique.positions.data(), unique.positions.size() * sizeof(Vec3d));
    write(triangles.data(), triangles.size() * sizeof(Triangle));
    const std::uint32_t padding = 0;
    if (triangles.size() % 2) write(&padding, sizeof padding);
    ++parts_;
  }

  /// Writes the header and returns whether that worked. Throws LoadError if there was no part.
  /// \param alone no other file was requested
  bool finish(bool alone) {
    if (parts_ == 0) throw LoadError("it holds no mesh");
    const MeshHeader header{kMeshMagic, MeshState::kGood, parts_, 0, at_, LoaderLimits::kAll, alone ? 1u : 0u};
    return ::pwrite(fd_, &header, sizeof header, 0) == sizeof header;
  }

 private:
  void write(const void* data, std::uint64_t bytes) {
    if (bytes > memory_bytes_ - std::min(at_, memory_bytes_)) throw std::bad_alloc();
    for (const auto* p = static_cast<const char*>(data); bytes > 0;) {
      const ssize_t n = ::pwrite(fd_, p, bytes, static_cast<off_t>(at_));
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) throw std::bad_alloc();  // a memfd fails for no other reason
      p += n;
      at_ += static_cast<std::uint64_t>(n);
      bytes -= static_cast<std::uint64_t>(n);
    }
  }

  int fd_;
  std::uint64_t memory_bytes_, at_ = sizeof(MeshHeader);
  std::uint32_t parts_ = 0;
};

bool load(std::unique_ptr<Assimp::Importer>* kept, Result* result, const fs::path& path, std::string_view content,
          bool as_heights) {
  const std::string extension = lower(path.extension().string().substr(1));
  const MeshFolder folder(path);
  const PartSink sink = [result](const MeshPart& part) { result->add(part); };
  if (extension == "obj")
    read_obj(content, sink);
  else if (extension == "off")
    read_off(content, sink);
  else if (extension == "ply")
    read_ply(content, sink);
  else if (extension == "stl")
    read_stl(content, sink);
  else if (extension == "xyz")
    read_xyz(content, sink);
  else if (extension == "npy")
    as_heights ? read_npy_heights(content, sink) : read_npy(content, sink);
  else if (extension == "pcd")
    read_pcd(content, sink);
  else if (extension == "bt" || extension == "ot")
    read_octomap(content, sink);
  else if (extension == "gltf" || extension == "glb")
    read_gltf(content, extension == "glb", folder, kMostRepeatedVertices, sink);
  else if (const AssimpFormat* format = find_assimp_format(extension))
    read_assimp(*format, kept, path, content, folder, kMostRepeatedVertices, sink);
  else
    read_dae(kept, path, content, folder, kMostRepeatedVertices, sink);
  return result->finish(folder.alone());
}

}  // namespace

bool import_mesh(std::unique_ptr<Assimp::Importer>* kept, const std::string& path, std::string_view content,
                 std::uint64_t memory_bytes, int result_fd, bool as_heights) {
  Result result(result_fd, memory_bytes);
  try {
    return load(kept, &result, fs::absolute(path), content, as_heights);
  } catch (const std::bad_alloc&) {
    const std::string text =
        "reading it takes more than " + std::to_string(memory_bytes >> 20) + " MiB of memory; is the file damaged?";
    return write_mesh_error(result_fd, MeshState::kOutOfMemory, text.c_str());
  } catch (const std::exception& e) {
    return write_mesh_error(result_fd, MeshState::kError, e.what());
  }
}

}  // namespace clearance
