// The baselines on a GPU, in words that need no CUDA. Without it cuda_absent.cpp stands in.
#pragma once

#include "bench/report/narrow.h"

namespace clearance::baselines {

/// None without CUDA.
const std::vector<std::string>& cuda_narrow_names();
/// \param name one of them. \param options block_size from 1 to 1024. Throws as make_narrow() does.
std::unique_ptr<NarrowBaseline> make_cuda_narrow(std::string_view name, const NarrowOptions& options);

/// Copies between host and device that a query of the report may need; no kernel runs.
enum class Transfer : std::uint8_t {
  kMeshByMesh,  ///< allocate, copy and free the vertices of each mesh
  kGeometry,    ///< all vertices in one array that is there already
  kPairs,       ///< the list of pairs
  kAnswers,     ///< a PairAnswer for each pair, back to the host
  kPoses,       ///< what remains of the way there once geometry is resident: seven numbers for each body
};
/// The memory of such copies, that of the host not pinned. Throws std::runtime_error without a GPU.
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
