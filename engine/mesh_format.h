// What the mesh loader hands back through its file descriptor 3.
//
//   MeshHeader | error text                                     if state is kError
//   MeshHeader | { SubmeshHeader | vertices | triangles | pad } if state is kGood
//
// The header is written last. The reader trusts nothing: the loader may have run over damaged memory.
#pragma once

#include <cstdint>

namespace clearance {

inline constexpr std::uint64_t kMeshMagic = 0x3130306873656d63;  // "cmesh001"
inline constexpr int kMeshResultFd = 3;                          ///< a memfd
inline constexpr int kMeshLifetimeFd = 4;                        ///< the write end of a pipe: closes with the loader
inline constexpr std::uint64_t kMaxMeshErrorBytes = 4096;

enum class MeshState : std::uint32_t { kUnfinished = 0, kGood = 1, kError = 2, kOutOfMemory = 3 };

struct MeshHeader {
  std::uint64_t magic;
  MeshState state;
  std::uint32_t submeshes;
  std::uint64_t error_bytes;
  std::uint64_t total_bytes;  ///< all that was written, this header included
};
static_assert(sizeof(MeshHeader) == 32);

struct SubmeshHeader {
  std::uint64_t vertices;         ///< three float64 each
  std::uint64_t triangles;        ///< three uint32 each; padded to 8 bytes in all
  std::uint64_t loaded_vertices;  ///< before exact duplicates were merged
};
static_assert(sizeof(SubmeshHeader) == 24);

}  // namespace clearance
