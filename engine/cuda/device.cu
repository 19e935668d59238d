// Device side of the cuda backend: resident hulls, workspaces, launches. A separate library (device_module.h).
#include <map>
#include <memory>
#include <mutex>

#include "engine/cuda/dense/dense_workspace.cuh"
#include "engine/cuda/dense/resident_dense.cuh"
#include "engine/cuda/memory/shared_memory.cuh"
#include "engine/cuda/mesh/elements.cuh"
#include "engine/cuda/motion/motions.cuh"
#include "engine/cuda/reduce/reduced.cuh"
#include "engine/device/device_module.h"
#include "engine/scene/scene.h"

namespace clearance::cuda {

namespace {

constexpr int kMostShared = 96 * 1024;  // bytes for a block's two hulls; devices with less get smaller tables

DeviceInfo probe() {
  DeviceInfo info;
  int count = 0;
  if (const cudaError_t error = cudaGetDeviceCount(&count); error != cudaSuccess || count == 0) {
    info.reason = error != cudaSuccess ? cudaGetErrorString(error) : "no CUDA device";
    return info;
  }
  int device = 0;
  cudaDeviceProp properties{};
  cudaError_t error = cudaGetDevice(&device);
  if (error == cudaSuccess) error = cudaGetDeviceProperties(&properties, device);
  // Also checks that this build contains code for the device.
  cudaFuncAttributes attributes{};
  if (error == cudaSuccess) error = cudaFuncGetAttributes(&attributes, answer_lean<double, false>);
  info.name = properties.name;
  info.count = count;
  info.present = error == cudaSuccess;
  if (!info.present) info.reason = info.name + ": " + cudaGetErrorString(error);
  return info;
}

// Bytes of shared memory for a block's two hulls.
int most_shared() {
  int device = 0, bytes = 0;
  check(cudaGetDevice(&device), "getting the device");
  check(cudaDeviceGetAttribute(&bytes, cudaDevAttrMaxSharedMemoryPerBlockOptin, device), "getting its shared memory");
  return std::min(bytes, kMostShared);
}

template <class T>
void allow_shared_memory() {
  for (const auto kernel : {answer_lean<T, false>, answer_lean<T, true>, answer_groups<T>})
    check(cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, most_shared()),
          "requesting shared memory");
}

// Unused workspaces.
template <class Kind>
class Pool {
 public:
  using Make = std::unique_ptr<Kind> (*)(const ResidentHulls&, WorkCounters&);
  Pool(const ResidentHulls& hulls, WorkCounters& counters, Make make)
      : hulls_(hulls), counters_(counters), make_(make) {}

  /// A workspace that returns to the pool when the pointer is released.
  /// \param owner of this pool; kept alive until then
  std::shared_ptr<Kind> borrow(std::shared_ptr<void> owner) {
    std::unique_ptr<Kind> workspace;
    {
      const std::lock_guard lock(mutex_);
      if (!free_.empty()) {
        workspace = std::move(free_.back());
        free_.pop_back();
      }
    }
    if (!workspace) {
      const OnDevice here(hulls_.device());
      workspace = make_(hulls_, counters_);
    }
    return {workspace.release(), [this, owner = std::move(owner)](Kind* w) {
              std::unique_ptr<Kind> returned(w);
              returned->wait_for_all();  // an abandoned job may still write to its caller's memory
              const std::lock_guard lock(mutex_);
              free_.push_back(std::move(returned));
            }};
  }

 private:
  const ResidentHulls& hulls_;
  WorkCounters& counters_;
  const Make make_;
  std::mutex mutex_;
  std::vector<std::unique_ptr<Kind>> free_;
};

std::unique_ptr<DenseWorkspace> make_dense(const ResidentHulls& hulls, WorkCounters& counters) {
  return std::make_unique<DenseWorkspace>(hulls, counters);
}

// On the calling thread's device.
class CudaDevice final : public Device, public std::enable_shared_from_this<CudaDevice> {
 public:
  /// \param before a device of another scene with the same number, or null
  CudaDevice(const engine::Scene& scene, std::uint64_t memory_limit, const CudaDevice* before)
      : budget_{memory_limit},
        scene_memory_(budget_),
        work_(budget_),
        hulls_(scene, most_shared(), scene_memory_, before ? &before->hulls_ : nullptr),
        dense_(hulls_, work_, make_dense),
        reduced_(hulls_, work_, make_reduced),
        motions_(hulls_, work_, make_motions) {
    allow_shared_memory<double>();
    allow_shared_memory<float>();
  }

  std::uint32_t hull_of(std::uint32_t body) const override { return hulls_.of_body(body); }
  bool shares(std::uint32_t hull) const override { return hulls_.is_shared(hull); }

  std::shared_ptr<const ResidentPairs> upload(std::span<const PairRef> pairs, std::span<const std::uint32_t> position,
                                              std::span<const Group> group_of_tile) override {
    const OnDevice here(hulls_.device());
    return std::make_shared<CudaPairs>(hulls_, work_.memory, pairs, position, group_of_tile);
  }

  std::shared_ptr<const ResidentTable> upload(const PairTable& table) override {
    const OnDevice here(hulls_.device());
    return std::make_shared<CudaTable>(work_.memory, table);
  }

  std::shared_ptr<ResidentElements> upload(const Surface& surface, std::shared_ptr<ResidentElements> reused) override {
    const OnDevice here(hulls_.device());
    auto to = reused ? std::static_pointer_cast<CudaElements>(std::move(reused))
                     : std::make_shared<CudaElements>(work_.memory);
    to->take(surface);
    return to;
  }

  std::shared_ptr<Workspace> borrow() override { return dense_.borrow(shared_from_this()); }
  std::shared_ptr<ReducedWorkspace> borrow_reduced() override { return reduced_.borrow(shared_from_this()); }
  std::shared_ptr<MotionWorkspace> borrow_motions() override { return motions_.borrow(shared_from_this()); }
  std::shared_ptr<ResidentWorkspace> make_resident(Reduce reduce) override {
    const OnDevice here(hulls_.device());
    std::unique_ptr<ResidentWorkspace> made;
    if (reduce == Reduce::kNone)
      made = std::make_unique<ResidentDense>(hulls_, work_);
    else
      made = make_resident_reduced(hulls_, work_);
    return {made.release(), [owner = shared_from_this()](ResidentWorkspace* w) {
              // The caller's stream may still read and write its memory.
              const OnDevice there(owner->hulls_.device());
              cudaDeviceSynchronize();
              delete w;
            }};
  }

  DeviceCounters counters() const override {
    DeviceCounters c;
    c.scene_bytes = scene_memory_.device_bytes;
    c.scene_bytes_uploaded = hulls_.uploaded_bytes();
    c.query_bytes = work_.memory.device_bytes;
    c.pinned_bytes = work_.memory.pinned_bytes;
    c.allocations = work_.memory.allocations;
    c.kernel_ns = work_.kernel_ns;
    c.broad_phase_ns = work_.broad_phase_ns;
    c.launches = work_.launches;
    return c;
  }

 private:
  MemoryBudget budget_;
  MemoryCounters scene_memory_;
  WorkCounters work_;
  ResidentHulls hulls_;
  Pool<DenseWorkspace> dense_;
  Pool<LentReduced> reduced_;
  Pool<LentMotions> motions_;
};

const DeviceInfo& installed() {
  static const auto& info = *new DeviceInfo(probe());  // never destroyed: queries may outlast main()
  return info;
}

std::string name_of(int number) {
  cudaDeviceProp properties{};
  check(cudaGetDeviceProperties(&properties, number), "getting the device's name");
  return properties.name;
}

/// The devices opened last, by number. A changed scene shares the hulls of the one before.
struct NewestDevices {
  std::mutex mutex;
  std::map<int, std::weak_ptr<CudaDevice>> by_number;
};

std::shared_ptr<Device> open(const engine::Scene& scene, int number, std::uint64_t memory_limit) {
  if (!installed().present) throw DeviceError(DeviceError::kLost, installed().reason);
  // Devices that answer together must number the hulls alike, so those requested by number begin afresh.
  const bool may_share = number == kCurrentDevice;
  if (may_share) check(cudaGetDevice(&number), "getting the device");
  const OnDevice here(number);
  static auto& newest = *new NewestDevices;  // never destroyed: queries may outlast main()
  const std::lock_guard lock(newest.mutex);
  std::weak_ptr<CudaDevice>& last = newest.by_number[number];
  const std::shared_ptr<CudaDevice> before = may_share ? last.lock() : nullptr;  // alive until its hulls are copied
  auto opened = std::make_shared<CudaDevice>(scene, memory_limit, before.get());
  last = opened;
  return opened;
}

bool is_pinned_memory(const void* memory) {
  cudaPointerAttributes attributes{};
  if (!memory || cudaPointerGetAttributes(&attributes, memory) != cudaSuccess) {
    cudaGetLastError();
    return false;
  }
  return attributes.type == cudaMemoryTypeHost && attributes.devicePointer == memory;
}

void pin(std::byte* memory, std::size_t bytes) {
  check(cudaHostRegister(memory, bytes, cudaHostRegisterPortable),
        ("pinning " + std::to_string(bytes) + " bytes of host memory").c_str());
}
void unpin(std::byte* memory) {
  cudaHostUnregister(memory);
}

}  // namespace

}  // namespace clearance::cuda

extern "C" __attribute__((visibility("default"))) const clearance::cuda::DeviceModule clearance_device_module = {
    clearance::cuda::installed,
    clearance::cuda::name_of,
    clearance::cuda::open,
    clearance::cuda::is_pinned_memory,
    clearance::cuda::pin,
    clearance::cuda::unpin,
    clearance::cuda::PinnedKind::allocate,
    clearance::cuda::PinnedKind::release,
    {clearance::cuda::share, clearance::cuda::wait_for_shared, clearance::cuda::release_shared,
     clearance::cuda::is_shared_done}};
