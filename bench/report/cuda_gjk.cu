// The report's GJK on a GPU: one block works on one pair.
//
// As there, vertices are transformed on the host and copied for every query. Four things vary: whether one thread or
// all scan for the support vertex, whether one thread or all fill the table of products, whether pairs are launched one
// at a time or all at once, and the number of threads per block, which is arbitrary because work is strided.
#include <algorithm>
#include <stdexcept>

#include "bench/report/cuda_gjk.h"
#include "engine/cuda/memory/memory.cuh"

namespace clearance::baselines {

namespace {

using cuda::check;
constexpr std::size_t kPairsPerLaunch = std::size_t{1} << 22;  // 300 MB of answers

/// Best value of each warp, in shared memory.
struct WarpBests {
  double most[32];
  std::uint32_t index[32];
};

struct BlockThreads {
  WarpBests* bests;

  __device__ bool first() const { return threadIdx.x == 0; }
  __device__ std::uint32_t rank() const { return threadIdx.x; }
  __device__ std::uint32_t count() const { return blockDim.x; }
  __device__ void sync() const { __syncthreads(); }

  /// Returns to the first thread the index of the largest value; the smallest index among equals.
  __device__ std::uint32_t highest(double most, std::uint32_t index) const {
    const unsigned lane = threadIdx.x % 32, warp = threadIdx.x / 32, warps = (blockDim.x + 31) / 32;
    reduce(most, index, lane, min(32u, blockDim.x - 32 * warp));
    if (lane == 0) {
      bests->most[warp] = most;
      bests->index[warp] = index;
    }
    __syncthreads();
    if (warp == 0) {
      const unsigned mine = min(lane, warps - 1), lanes = min(32u, blockDim.x);
      most = bests->most[mine];
      index = bests->index[mine];
      reduce(most, index, lane, lanes);
    }
    __syncthreads();
    return index;
  }

 private:
  __device__ static void reduce(double& most, std::uint32_t& index, unsigned lane, unsigned lanes) {
    const unsigned mask = lanes == 32 ? ~0u : (1u << lanes) - 1;
    for (unsigned step = 16; step > 0; step /= 2) {
      const double other = __shfl_down_sync(mask, most, step);
      const std::uint32_t other_index = __shfl_down_sync(mask, index, step);
      if (lane + step < lanes && (other > most || (other == most && other_index < index))) {
        most = other;
        index = other_index;
      }
    }
  }
};

template <bool kParallel>
struct BlockScan {
  const Vec3d* vertices[2];
  std::uint32_t count[2];
  BlockThreads threads;
  __device__ std::uint32_t operator()(int side, const Vec3d& d) const {
    if constexpr (kParallel) return scan(threads, vertices[side], count[side], d);
    const std::uint32_t index = threads.first() ? scan(OneThread{}, vertices[side], count[side], d) : 0;
    threads.sync();  // waits for threads that still test whether the run is done
    return index;
  }
};

template <bool kParallelSupport, bool kParallelTerms>
__global__ void __launch_bounds__(1024)
    gjk_kernel(const Vec3d* vertices, const VertexRange* ranges, const BodyPair* pairs, PairAnswer* answers) {
  __shared__ SignGjk s;
  __shared__ WarpBests bests;
  const BodyPair pair = pairs[blockIdx.x];
  const VertexRange a = ranges[pair.a], b = ranges[pair.b];
  const BlockThreads threads{&bests};
  BlockScan<kParallelSupport> support{{vertices + a.first, vertices + b.first}, {a.count, b.count}, threads};
  if constexpr (kParallelTerms)
    run_sign_gjk(s, support.vertices[0], support.vertices[1], threads, threads, support);
  else
    run_sign_gjk(s, support.vertices[0], support.vertices[1], threads, OneThread{}, support);
  if (threads.first()) s.write(support.vertices[0], support.vertices[1], answers[blockIdx.x]);
}

using Kernel = void (*)(const Vec3d*, const VertexRange*, const BodyPair*, PairAnswer*);
struct Variant {
  const char* name;
  Kernel kernel;
  bool batched;
};
constexpr Variant kVariants[] = {
    {"cuda_support_seq", gjk_kernel<false, true>, false}, {"cuda_support_par", gjk_kernel<true, true>, false},
    {"cuda_terms_seq", gjk_kernel<true, false>, false},   {"cuda_terms_par", gjk_kernel<true, true>, false},
    {"cuda_pairwise", gjk_kernel<true, true>, false},     {"cuda_batched", gjk_kernel<true, true>, true},
};

template <class T>
T* room(cuda::DeviceBuffer& buffer, std::size_t count) {
  return reinterpret_cast<T*>(buffer.reserve(std::max<std::size_t>(1, count) * sizeof(T)));
}

class CudaGjk final : public NarrowBaseline {
 public:
  CudaGjk(const Variant& variant, int block_size) : variant_(variant), block_size_(static_cast<unsigned>(block_size)) {
    check(cudaEventCreate(&begin_), "an event");
    check(cudaEventCreate(&end_), "an event");
  }
  ~CudaGjk() override {
    cudaEventDestroy(begin_);
    cudaEventDestroy(end_);
  }

  void distances(const World& world, std::span<const BodyPair> pairs, std::span<PairAnswer> answers) override {
    auto* vertices = room<Vec3d>(vertices_, world.vertices().size());
    auto* ranges = room<VertexRange>(ranges_, world.size());
    copy(vertices, world.vertices());
    copy(ranges, world.ranges());
    kernel_us_ = 0;
    for (std::size_t first = 0; first < pairs.size(); first += kPairsPerLaunch) {
      const std::size_t count = std::min(kPairsPerLaunch, pairs.size() - first);
      auto* device_pairs = room<BodyPair>(pairs_, count);
      auto* out = room<PairAnswer>(answers_, count);
      copy(device_pairs, pairs.subspan(first, count));
      check(cudaEventRecord(begin_), "an event");
      if (variant_.batched) {
        variant_.kernel<<<static_cast<unsigned>(count), block_size_>>>(vertices, ranges, device_pairs, out);
      } else {
        for (std::size_t i = 0; i < count; ++i)
          variant_.kernel<<<1, block_size_>>>(vertices, ranges, device_pairs + i, out + i);
      }
      check(cudaGetLastError(), "a launch");
      check(cudaEventRecord(end_), "an event");
      check(cudaMemcpy(&answers[first], out, count * sizeof(PairAnswer), cudaMemcpyDeviceToHost), "the answers");
      float ms = 0;
      check(cudaEventElapsedTime(&ms, begin_, end_), "an event");
      kernel_us_ += 1e3 * static_cast<double>(ms);
    }
  }
  double kernel_us() const override { return kernel_us_; }

 private:
  template <class T>
  static void copy(T* to, std::span<const T> from) {
    check(cudaMemcpy(to, from.data(), from.size_bytes(), cudaMemcpyHostToDevice), "copying to the device");
  }

  const Variant& variant_;
  unsigned block_size_;
  cuda::MemoryCounters counters_;
  cuda::DeviceBuffer vertices_{counters_}, ranges_{counters_}, pairs_{counters_}, answers_{counters_};
  cudaEvent_t begin_ = nullptr, end_ = nullptr;
  double kernel_us_ = 0;
};

}  // namespace

const std::vector<std::string>& cuda_narrow_names() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all;
    for (const Variant& v : kVariants) all.emplace_back(v.name);
    return all;
  }();
  return names;
}

std::unique_ptr<NarrowBaseline> make_cuda_narrow(std::string_view name, const NarrowOptions& options) {
  if (options.block_size < 1 || options.block_size > 1024)
    throw std::invalid_argument("block_size is " + std::to_string(options.block_size) +
                                ": a block has 1 to 1024 threads");
  if (options.reduction != Reduction::kRegions)
    throw std::invalid_argument("on a GPU there is one way of reducing simplices");
  int devices = 0;
  check(cudaGetDeviceCount(&devices), "no device");
  for (const Variant& v : kVariants)
    if (v.name == name) return std::make_unique<CudaGjk>(v, options.block_size);
  throw std::invalid_argument("there is no CUDA baseline \"" + std::string(name) + "\"");
}

struct Transfers::Impl {
  Impl(const World& w, std::size_t n) : world(w), pairs(n), answers(n), poses(w.size()) {
    const std::size_t room =
        std::max({n * sizeof(BodyPair), n * sizeof(PairAnswer), w.size() * sizeof(Pose), w.vertices().size_bytes()});
    device = buffer.reserve(room);
  }

  static void up(std::byte* to, const void* from, std::size_t bytes) {
    check(cudaMemcpy(to, from, bytes, cudaMemcpyHostToDevice), "copying to the device");
  }
  template <class T>
  std::size_t up_all(std::span<const T> array) {
    up(device, array.data(), array.size_bytes());
    return array.size_bytes();
  }
  std::size_t mesh_by_mesh() {
    std::vector<std::byte*> there;
    for (std::uint32_t b = 0; b < world.size(); ++b) {
      const std::span<const Vec3d> vertices = world.mesh(b).vertices;
      there.push_back(cuda::DeviceKind::allocate(vertices.size_bytes()));
      up(there.back(), vertices.data(), vertices.size_bytes());
    }
    for (std::byte* p : there) cuda::DeviceKind::release(p);
    return world.vertices().size_bytes();
  }

  const World& world;
  std::vector<BodyPair> pairs;
  std::vector<PairAnswer> answers;
  std::vector<Pose> poses;
  cuda::MemoryCounters counters;
  cuda::DeviceBuffer buffer{counters};
  std::byte* device = nullptr;
};

Transfers::Transfers(const World& world, std::size_t pairs) : impl_(std::make_unique<Impl>(world, pairs)) {}
Transfers::~Transfers() = default;

std::size_t Transfers::run(Transfer transfer) {
  std::size_t bytes = 0;
  switch (transfer) {
    case Transfer::kMeshByMesh:
      bytes = impl_->mesh_by_mesh();
      break;
    case Transfer::kGeometry:
      bytes = impl_->up_all(impl_->world.vertices());
      break;
    case Transfer::kPairs:
      bytes = impl_->up_all(std::span<const BodyPair>(impl_->pairs));
      break;
    case Transfer::kPoses:
      bytes = impl_->up_all(std::span<const Pose>(impl_->poses));
      break;
    case Transfer::kAnswers:
      bytes = impl_->answers.size() * sizeof(PairAnswer);
      check(cudaMemcpy(impl_->answers.data(), impl_->device, bytes, cudaMemcpyDeviceToHost), "copying from the device");
      break;
  }
  check(cudaDeviceSynchronize(), "a transfer");
  return bytes;
}

}  // namespace clearance::baselines
