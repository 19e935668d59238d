// The baselines on a GPU, declared without CUDA. In a build without CUDA, cuda_absent.cpp replaces them.
#pragma once

#include "bench/report/narrow.h"

namespace clearance::baselines {

/// Empty without CUDA.
const std::vector<std::string>& cuda_narrow_names();
/// Throws as make_narrow() does.
/// \param name one of cuda_narrow_names()
/// \param options block_size from 1 to 1024
std::unique_ptr<NarrowBaseline> make_cuda_narrow(std::string_view name, const NarrowOptions& options);

/// Copies between host and device that a query of the report may need; no kernel runs.
enum class Transfer : std::uint8_t {
  kMeshByMesh,  ///< allocates, copies and frees the vertices of each mesh
  kGeometry,    ///< all vertices in one existing array
  kPairs,       ///< the list of pairs
  kAnswers,     ///< a PairAnswer for each pair, back to the host
  kPoses,       ///< upload when geometry is resident: seven numbers for each body
};
/// Memory for such copies, unpinned on the host. Throws std::runtime_error without a GPU.
class Transfers {
 public:
  Transfers(const World& world, std::size_t pairs);
  ~Transfers();
  /// Copies, waits, and returns the number of bytes.
  std::size_t run(Transfer transfer);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace clearance::baselines
