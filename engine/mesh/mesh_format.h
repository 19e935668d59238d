// Data exchanged with the mesh loader: the file's bytes in its descriptor 5, and the result in descriptor 3.
//
//   MeshHeader | error text                                     if state is kError
//   MeshHeader | { SubmeshHeader | vertices | triangles | pad } if state is kGood
//
// The header is written last. The reader validates everything, since a hostile file may have corrupted the loader.
#pragma once

#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <cstring>

namespace clearance {

inline constexpr std::uint64_t kMeshMagic = 0x3330306873656d63;  // "cmesh003"
inline constexpr int kMeshResultFd = 3;                          ///< a memfd
inline constexpr int kMeshLifetimeFd = 4;                        ///< the write end of a pipe: closes with the loader
inline constexpr int kMeshFileFd = 5;                            ///< a sealed memfd with the bytes that were hashed
inline constexpr std::uint64_t kMaxMeshErrorBytes = 4096;

enum class MeshState : std::uint32_t { kUnfinished = 0, kGood = 1, kError = 2, kOutOfMemory = 3 };

/// Limits in force while the loader read the file, as it reports them.
enum class LoaderLimits : std::uint32_t {
  kAll = 0,
  kNoCallFilter = 1,  ///< time and memory alone, since the kernel rejects filters of system calls
};

struct MeshHeader {
  std::uint64_t magic;
  MeshState state;
  std::uint32_t submeshes;
  std::uint64_t error_bytes;
  std::uint64_t total_bytes;  ///< size of the result, this header included
  LoaderLimits limits;
  std::uint32_t alone;  ///< 1 if no other file was requested
};
static_assert(sizeof(MeshHeader) == 40);

/// Replaces the result by an error; async-signal-safe. Returns whether it is written.
inline bool write_mesh_error(int fd, MeshState state, const char* text) {
  struct {
    MeshHeader header{};
    char text[kMaxMeshErrorBytes];
  } out;
  out.header.magic = kMeshMagic;
  out.header.state = state;
  out.header.error_bytes = ::strnlen(text, kMaxMeshErrorBytes);
  out.header.total_bytes = sizeof out.header + out.header.error_bytes;
  std::memcpy(out.text, text, out.header.error_bytes);
  return ::ftruncate(fd, 0) == 0 &&
         ::pwrite(fd, &out, out.header.total_bytes, 0) == static_cast<ssize_t>(out.header.total_bytes);
}

struct SubmeshHeader {
  std::uint64_t vertices;         ///< three float64 each
  std::uint64_t triangles;        ///< three uint32 each; padded to 8 bytes in all
  std::uint64_t loaded_vertices;  ///< before exact duplicates were merged
  double rounding;                ///< metres, finite, not negative
};
static_assert(sizeof(SubmeshHeader) == 32);

}  // namespace clearance
