// The report's methods for the distance of pairs of meshes, by name, behind one interface.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "bench/report/sign_gjk.h"
#include "bench/report/world.h"
#include "engine/selection/query.h"

namespace clearance::baselines {

struct NarrowOptions {
  int threads = 0;                            ///< of those with OpenMP; 0 for all cores
  int block_size = 64;                        ///< threads per block, of those on a GPU
  Reduction reduction = Reduction::kRegions;  ///< of iterative methods
};

/// Computes the distances of pairs of meshes. Not thread-safe, because buffers are kept between calls.
class NarrowBaseline {
 public:
  virtual ~NarrowBaseline() = default;
  /// \param pairs of body ids
  /// \param answers (pairs,)
  virtual void distances(const World& world, std::span<const BodyPair> pairs, std::span<PairAnswer> answers) = 0;
  /// Kernel time of the last call in microseconds, by the device's events; 0 on a CPU.
  virtual double kernel_us() const { return 0; }
};

/// naive, naive_omp, gjk, gjk_hill, gjk_omp; in a build with CUDA also cuda_support_seq, cuda_support_par,
/// cuda_terms_seq, cuda_terms_par, cuda_pairwise, cuda_batched.
const std::vector<std::string>& narrow_names();
/// Throws std::invalid_argument for an unknown name or a bad option, and std::runtime_error for a CUDA baseline without
/// a GPU.
std::unique_ptr<NarrowBaseline> make_narrow(std::string_view name, const NarrowOptions& options = {});

/// The report's Algorithm 1 alone: the least distance of two meshes' triangles; 0 if some intersect. A mesh inside
/// another without contact gets the distance of the surfaces; the naive baselines detect that case separately.
PairAnswer least_triangle_distance(const Mesh& a, const Mesh& b);

}  // namespace clearance::baselines
