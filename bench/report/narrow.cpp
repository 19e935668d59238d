#include "bench/report/narrow.h"

#include <omp.h>

#include <algorithm>
#include <stdexcept>

#include "bench/report/cuda_gjk.h"
#include "bench/report/naive.h"

namespace clearance::baselines {

namespace {

/// Support by a scan over all vertices (the report's Algorithm 3).
struct ScanSupport {
  const Mesh& a;
  const Mesh& b;
  std::uint32_t operator()(int side, const Vec3d& d) const {
    const Mesh& mesh = side == 0 ? a : b;
    return scan(OneThread{}, mesh.vertices.data(), static_cast<std::uint32_t>(mesh.vertices.size()), d);
  }
};

/// The same in several threads, for large meshes: waking the threads costs more than scanning a few thousand vertices.
constexpr std::size_t kParallelScan = 20'000;
struct ParallelScanSupport {
  const Mesh& a;
  const Mesh& b;
  int threads;
  std::uint32_t operator()(int side, const Vec3d& d) const {
    const std::span<const Vec3d> vertices = (side == 0 ? a : b).vertices;
    std::uint32_t best = 0;
    double most = dot(vertices[0], d);
#pragma omp parallel num_threads(threads)
    {
      std::uint32_t mine = 0;
      double most_of_mine = most;
#pragma omp for schedule(static) nowait
      for (std::size_t i = 0; i < vertices.size(); ++i) {
        const double along = dot(vertices[i], d);
        if (along > most_of_mine) most_of_mine = along, mine = static_cast<std::uint32_t>(i);
      }
#pragma omp critical(clearance_scan)
      if (most_of_mine > most) most = most_of_mine, best = mine;
    }
    return best;
  }
};

/// Hill climbing over neighbours from the last support vertex (Algorithm 4): moves to the best neighbour until none is
/// better.
struct HillSupport {
  const Mesh& a;
  const Mesh& b;
  std::uint32_t last[2] = {0, 0};
  std::uint32_t operator()(int side, const Vec3d& d) {
    const Mesh& mesh = side == 0 ? a : b;
    const Connections& c = *mesh.connections;
    std::uint32_t at = last[side], previous;
    double most = dot(mesh.vertices[at], d);
    do {
      previous = at;
      for (std::uint32_t k = c.neighbours_begin[previous]; k < c.neighbours_begin[previous + 1]; ++k) {
        const double along = dot(mesh.vertices[c.neighbours[k]], d);
        if (along > most) most = along, at = c.neighbours[k];
      }
    } while (at != previous);
    return last[side] = at;
  }
};

template <class Support>
PairAnswer run(const Mesh& a, const Mesh& b, Support support, Reduction reduction) {
  SignGjk s;
  run_sign_gjk(s, a.vertices.data(), b.vertices.data(), OneThread{}, OneThread{}, support, reduction);
  PairAnswer answer;
  s.write(a.vertices.data(), b.vertices.data(), answer);
  return answer;
}

enum class Method { kScan, kHill, kParallel };

class CpuGjk final : public NarrowBaseline {
 public:
  CpuGjk(Method method, int threads, Reduction reduction) : method_(method), threads_(threads), reduction_(reduction) {}

  void distances(const World& world, std::span<const BodyPair> pairs, std::span<PairAnswer> answers) override {
    if (method_ == Method::kParallel && pairs.size() < static_cast<std::size_t>(threads_)) {
      for (std::size_t i = 0; i < pairs.size(); ++i) {
        const Mesh a = world.mesh(pairs[i].a), b = world.mesh(pairs[i].b);
        answers[i] = a.vertices.size() + b.vertices.size() < kParallelScan
                         ? run(a, b, ScanSupport{a, b}, reduction_)
                         : run(a, b, ParallelScanSupport{a, b, threads_}, reduction_);
      }
      return;
    }
#pragma omp parallel for schedule(dynamic, 64) num_threads(threads_) if (method_ == Method::kParallel)
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      const Mesh a = world.mesh(pairs[i].a), b = world.mesh(pairs[i].b);
      answers[i] = method_ == Method::kHill ? run(a, b, HillSupport{a, b}, reduction_)
                                            : run(a, b, ScanSupport{a, b}, reduction_);
    }
  }

 private:
  Method method_;
  int threads_;
  Reduction reduction_;
};

}  // namespace

const std::vector<std::string>& narrow_names() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all{"naive", "naive_omp", "gjk", "gjk_hill", "gjk_omp"};
    for (const std::string& name : cuda_narrow_names()) all.push_back(name);
    return all;
  }();
  return names;
}

std::unique_ptr<NarrowBaseline> make_narrow(std::string_view name, const NarrowOptions& options) {
  if (options.threads < 0) throw std::invalid_argument("threads is negative");
  const int threads = options.threads > 0 ? options.threads : omp_get_max_threads();
  if (name == "naive") return make_naive(1);
  if (name == "naive_omp") return make_naive(threads);
  if (name == "gjk") return std::make_unique<CpuGjk>(Method::kScan, 1, options.reduction);
  if (name == "gjk_hill") return std::make_unique<CpuGjk>(Method::kHill, 1, options.reduction);
  if (name == "gjk_omp") return std::make_unique<CpuGjk>(Method::kParallel, threads, options.reduction);
  const auto& cuda = cuda_narrow_names();
  if (std::find(cuda.begin(), cuda.end(), name) != cuda.end()) return make_cuda_narrow(name, options);
  std::string known;
  for (const std::string& n : narrow_names()) known += (known.empty() ? "" : ", ") + n;
  throw std::invalid_argument("there is no baseline \"" + std::string(name) + "\" for distances; there are " + known);
}

}  // namespace clearance::baselines
