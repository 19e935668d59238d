// A fake device that answers device queries in host memory, so that the daemon's part needs no GPU. It computes rows
// from the poses and positions in that memory when it is started, and completes when a test allows it.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <thread>

#include "engine/device/shared_memory.h"
#include "tests/engine/device/fake_device.h"

namespace clearance::test {

/// State of the device, and a record of its use. One at a time.
struct PlanDevice {
  std::atomic<bool> is_done{true};          ///< all launched work is done
  std::atomic<bool> is_lost{false};         ///< requests to it fail
  std::atomic<bool> has_room{true};         ///< for memory that is shared
  std::atomic<int> launches{0}, shared{0};  ///< chunks; existing blocks of memory
  std::atomic<int> waiting{0};              ///< threads that wait in share()
  std::mutex mutex;
  std::condition_variable opened;
  bool may_share = true;              ///< otherwise share() waits
  std::set<std::thread::id> threads;  ///< threads that created, launched and freed

  PlanDevice() { current() = this; }
  ~PlanDevice() { current() = nullptr; }
  PlanDevice(const PlanDevice&) = delete;
  static PlanDevice*& current() {
    static PlanDevice* one = nullptr;
    return one;
  }
  void note_thread() {
    const std::lock_guard lock(mutex);
    threads.insert(std::this_thread::get_id());
  }
  void let_share(bool may) {
    const std::lock_guard lock(mutex);
    may_share = may;
    opened.notify_all();
  }

  static cuda::SharedBlock share(int device, std::size_t bytes) {
    PlanDevice& self = *current();
    self.note_thread();
    {
      std::unique_lock lock(self.mutex);
      ++self.waiting;
      self.opened.wait(lock, [&] { return self.may_share; });
      --self.waiting;
    }
    if (!self.has_room)
      throw cuda::DeviceError(cuda::DeviceError::kNoMemory, "device memory, " + std::to_string(bytes) + " bytes: full");
    cuda::SharedBlock block;
    block.stream = std::calloc(bytes + 64, 1);  // zeroed when it is touched
    std::size_t room = bytes + 64;
    void* at = block.stream;
    block.data = static_cast<std::byte*>(std::align(64, bytes, at, room));
    block.device = device;
    // The handle of host memory is its address.
    std::memcpy(block.handle.ipc.data(), &block.data, sizeof block.data);
    block.handle.uuid[3] = std::byte{7};
    ++self.shared;
    return block;
  }
  static void wait(const cuda::SharedBlock&) {}
  static void release(const cuda::SharedBlock& block) {
    current()->note_thread();
    --current()->shared;
    std::free(block.stream);
  }
  static bool evaluate(const cuda::SharedBlock&) {
    current()->note_thread();
    if (current()->is_lost) throw cuda::DeviceError(cuda::DeviceError::kLost, "CUDA: a planted loss");
    return current()->is_done;
  }
  static constexpr cuda::SharedMemoryCalls kCalls{share, wait, release, evaluate};
};

/// Address at which a client maps the memory of a handle.
inline std::byte* mapped(const void* handle) {
  std::byte* at = nullptr;
  std::memcpy(&at, handle, sizeof at);
  return at;
}

/// A row's `lower`, computed from the first body's and the first joint's numbers in its configuration, and from the
/// pair.
inline double planned(double x, double position, std::uint64_t pair) {
  return x + 1000 * position + 1e-3 * static_cast<double>(pair);
}

class HostPlans final : public cuda::ResidentWorkspace {
 public:
  HostPlans(PlanDevice& device, Reduce reduce) : device_(device), reduce_(reduce) {}

  cuda::FixedBodies body_buffers(std::size_t bodies) override {
    components_.resize(bodies * cuda::kPoseComponents);
    state_.resize(bodies);
    return {components_.data(), state_.data()};
  }
  void begin(const cuda::QuerySetup& setup) override {
    bodies_ = setup.moved.given_count;
    joints_ = setup.moved.robots.joints;
  }
  std::byte* chunk_input_buffer(cuda::Given, int, std::size_t) override { return nullptr; }
  std::byte* query_input_buffer(cuda::Given, std::size_t) override { return nullptr; }
  void reserve(std::uint64_t, std::uint32_t) override {}
  int device() const override { return 0; }
  std::uint64_t bytes() const override { return kOwnBytes; }
  std::byte* row_buffer(std::size_t) override { return nullptr; }
  void launch(const cuda::ChunkSetup& chunk, const ReplyView& rows, const cuda::ResidentPairs&, std::uint64_t,
              void*) override {
    device_.note_thread();
    ++device_.launches;
    for (std::uint64_t k = 0; k < chunk.configurations; ++k) {
      const double x = chunk.poses ? chunk.poses[k * bodies_].translation.x : 0,
                   position = chunk.positions ? chunk.positions[k * joints_] : 0;
      if (reduce_ != Reduce::kNone) {
        if (rows.lower) rows.lower[k] = planned(x, position, 0);
        if (rows.status) rows.status[k] = static_cast<std::uint8_t>(Status::kBeyond);
        continue;
      }
      for (std::uint64_t p = 0; p < chunk.pair_count; ++p)
        if (rows.lower) rows.lower[k * chunk.pair_count + p] = planned(x, position, p);
    }
  }

  static constexpr std::uint64_t kOwnBytes = 4096;

 private:
  PlanDevice& device_;
  Reduce reduce_;
  std::uint64_t bodies_ = 0, joints_ = 0;
  std::vector<double> components_;
  std::vector<std::uint8_t> state_;
};

class PlansDevice final : public IdleDevice {
 public:
  PlansDevice(Fault& fault, PlanDevice& device) : IdleDevice(fault), device_(device) {}
  std::shared_ptr<cuda::ResidentWorkspace> make_resident(Reduce reduce) override {
    return std::make_shared<HostPlans>(device_, reduce);
  }

 private:
  PlanDevice& device_;
};

/// An engine that is created during its lifetime has such a device.
struct FakePlanDevice {
  Fault fault;
  PlanDevice device;
  cuda::FakeDevice fake_device{
      {true, "a stand-in", ""},
      [this](const engine::Scene&, int, std::uint64_t) { return std::make_shared<PlansDevice>(fault, device); },
      &PlanDevice::kCalls};
};

}  // namespace clearance::test
