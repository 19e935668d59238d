// Common part of device queries: input and output are in the caller's device memory, and work goes into the caller's
// stream.
#pragma once

#include <utility>

#include "engine/cuda/workspace/workspace.cuh"

namespace clearance::cuda {

struct ResidentSlot : QuerySlot {
  ResidentSlot(MemoryCounters& c, int priority) : QuerySlot(c, priority), counts(c), rows(c) {}

  DeviceBuffer counts, rows;
};

/// \tparam Slot a ResidentSlot; only the workspace's first one is used
template <class Slot>
class ResidentSide : public QuerySide<ResidentWorkspace, Slot> {
  using Side = QuerySide<ResidentWorkspace, Slot>;

 public:
  using Side::Side;

  int device() const override { return this->hulls_.device(); }

  std::uint64_t bytes() const override {
    const Slot& s = slot();
    return this->setup_.device_size() + this->device_bodies_.size() + s.device_bodies.size() + s.device_frames.size() +
           s.counts.size() + s.rows.size() + bytes_for_rows();
  }

  std::byte* row_buffer(std::size_t bytes) override {
    const OnDevice here = this->on_device();
    return slot().rows.reserve(bytes);
  }

  void reserve(std::uint64_t rows, std::uint32_t configurations) override {
    const OnDevice here = this->on_device();
    slot().device_bodies.reserve(this->moved_bytes(configurations).bytes());
    slot().device_frames.reserve(this->frame_bytes(configurations));
    slot().counts.reserve(2 * kCounts * sizeof(std::uint32_t));
    reserve_rows(rows, configurations);
    check(cudaStreamSynchronize(slot().stream), "preparing a query");
    slot().is_under_way = false;
  }

 protected:
  virtual void reserve_rows(std::uint64_t rows, std::uint32_t configurations) = 0;
  virtual std::uint64_t bytes_for_rows() const = 0;

  const Slot& slot() const { return *this->slots_[0]; }
  Slot& slot() { return *this->slots_[0]; }
  std::uint32_t* counts() { return reinterpret_cast<std::uint32_t*>(slot().counts.data()); }
  /// Discarded counts, since no host waits for them.
  std::uint32_t* spare_counts() { return counts() + kCounts; }

  // Replaces the slot's stream by the caller's during its lifetime.
  class Lent {
   public:
    Lent(Slot& slot, void* stream) : slot_(slot), own_(std::exchange(slot.stream, static_cast<cudaStream_t>(stream))) {}
    ~Lent() {
      slot_.stream = own_;
      slot_.is_under_way = false;  // the caller waits for its own stream
    }
    Lent(const Lent&) = delete;

   private:
    Slot& slot_;
    cudaStream_t own_;
  };
};

}  // namespace clearance::cuda
