#include "engine/mesh/mesh_result.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <string>

namespace clearance {

namespace {

// Sequential, bounds-checked reads from the loader's result.
class ResultReader {
 public:
  explicit ResultReader(int fd) : fd_(fd) {
    struct stat info{};
    if (::fstat(fd, &info) == 0) size_ = static_cast<std::uint64_t>(info.st_size);
  }
  std::uint64_t left() const { return size_ - at_; }
  bool read(void* to, std::uint64_t bytes) {
    if (bytes > left()) return false;
    for (auto* p = static_cast<char*>(to); bytes > 0;) {
      const ssize_t n = ::pread(fd_, p, bytes, static_cast<off_t>(at_));
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) return false;
      p += n;
      at_ += static_cast<std::uint64_t>(n);
      bytes -= static_cast<std::uint64_t>(n);
    }
    return true;
  }

 private:
  int fd_;
  std::uint64_t size_ = 0, at_ = 0;
};

[[noreturn]] void fail_garbled() {
  throw MeshError("the mesh loader's result is corrupted; is the file damaged?");
}

Submesh read_submesh(ResultReader* in) {
  SubmeshHeader header;
  if (!in->read(&header, sizeof header)) fail_garbled();
  if (header.vertices == 0 || header.vertices > in->left() / sizeof(Vec3d)) fail_garbled();
  if (!(header.rounding >= 0 && std::isfinite(header.rounding))) fail_garbled();
  Submesh submesh;
  submesh.loaded_vertices = header.loaded_vertices;
  submesh.rounding = header.rounding;
  submesh.vertices.resize(header.vertices);
  if (!in->read(submesh.vertices.data(), header.vertices * sizeof(Vec3d))) fail_garbled();
  if (header.triangles > in->left() / sizeof(Triangle)) fail_garbled();
  submesh.triangles.resize(header.triangles);
  if (!in->read(submesh.triangles.data(), header.triangles * sizeof(Triangle))) fail_garbled();
  std::uint64_t padding;
  if (header.triangles % 2 && !in->read(&padding, 4)) fail_garbled();
  for (const Vec3d& v : submesh.vertices)
    if (!std::isfinite(v.x) || !std::isfinite(v.y) || !std::isfinite(v.z)) fail_garbled();
  for (const Triangle& t : submesh.triangles)
    if (std::max({t[0], t[1], t[2]}) >= header.vertices) fail_garbled();
  return submesh;
}

}  // namespace

std::optional<Mesh> read_mesh_result(int fd, LoaderLimits* limits) {
  ResultReader in(fd);
  const std::uint64_t size = in.left();
  MeshHeader header;
  if (!in.read(&header, sizeof header) || header.magic != kMeshMagic) return {};
  if (header.total_bytes != size) fail_garbled();
  if (limits) *limits = header.limits;
  if (header.state == MeshState::kError || header.state == MeshState::kOutOfMemory) {
    if (header.error_bytes > kMaxMeshErrorBytes) fail_garbled();
    std::string text(header.error_bytes, '\0');
    if (!in.read(text.data(), text.size())) fail_garbled();
    for (char& c : text)
      if (static_cast<unsigned char>(c) < 0x20 || static_cast<unsigned char>(c) >= 0x7f) c = '?';
    throw MeshError(text);
  }
  if (header.state != MeshState::kGood || header.submeshes == 0) fail_garbled();
  Mesh mesh;
  mesh.alone = header.alone == 1;
  for (std::uint32_t i = 0; i < header.submeshes; ++i) mesh.submeshes.push_back(read_submesh(&in));
  return mesh;
}

}  // namespace clearance
