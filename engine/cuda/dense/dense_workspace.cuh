// Dense queries on the device: a row per configuration and pair.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>

#include "engine/cuda/dense/dense_launch.cuh"
#include "engine/cuda/workspace/workspace.cuh"
#include "engine/device/query/reply_columns.h"

namespace clearance::cuda {

inline constexpr std::uint64_t kSmallRows = 16384;              // largest chunk answered with as few calls as possible
inline constexpr std::uint64_t kFirstRows = 1u << 16;           // largest first chunk that proves overlaps at once
inline constexpr std::chrono::microseconds kFlagPatience{200};  // few pairs take a tenth of this

struct DenseSlot : QuerySlot {
  DenseSlot(MemoryCounters& c, int priority)
      : QuerySlot(c, priority),
        device_reply(c),
        device_enclosed(c),
        device_open(c),
        device_counts(c),
        host_reply(c),
        host_rest(c),
        host_finished(c) {}

  DeviceBuffer device_reply, device_enclosed, device_open, device_counts;
  PinnedBuffer host_reply, host_rest, host_finished;
  std::uint64_t rows = 0;
  bool is_small = false;
  std::uint32_t number = 0;  // of the last chunk with a flag
  ChunkView device_view;
  ReplyView host_view;
  std::uint32_t* host_counts = nullptr;
};

class DenseWorkspace final : public QuerySide<Workspace, DenseSlot> {
 public:
  using QuerySide::QuerySide;

  void begin(const QuerySetup& s) override {
    QuerySide::begin(s);
    last_ended_ = 0;
  }

  void launch(int index, const ChunkSetup& chunk, const ReplyView& direct) override {
    const OnDevice here = on_device();
    DenseSlot& slot = *slots_[index];
    slot.rows = chunk.rows();
    slot.is_small = slot.rows <= kSmallRows;
    ChunkView& view = slot.device_view = view_of(slot, chunk);
    std::uint64_t reply_bytes = 0;
    reply_view_over(nullptr, slot.rows, fields_, &reply_bytes, joints_);
    slot.host_view = reply_view_over(slot.host_reply.reserve(reply_bytes), slot.rows, fields_, nullptr, joints_);
    slot.host_counts =
        reinterpret_cast<std::uint32_t*>(slot.host_rest.reserve((kCounts + slot.rows) * sizeof(std::uint32_t)));
    // Kernels write the counts and the CPU's rows directly to host memory and leave the counts cleared, which saves
    // driver calls.
    if (!slot.device_counts.data()) {
      const std::size_t bytes = sizeof(std::uint64_t) + kCounts * sizeof(std::uint32_t);
      check(cudaMemsetAsync(slot.device_counts.reserve(bytes), 0, bytes, slot.stream), "clearing counters");
    }
    // Kernels record the times: an event recorded after a copy in the same stream would wait for the copies of all
    // streams.
    view.begun = reinterpret_cast<std::uint64_t*>(slot.device_counts.data());
    view.finished = reinterpret_cast<Finished*>(slot.host_finished.reserve(sizeof(Finished)));
    *view.finished = {};
    if (slot.is_small && all_chunks_ == 1 && chunk.tiles() > 0)
      view.number = slot.number = std::max(slot.number + 1, 1u);
    view.counts = reinterpret_cast<std::uint32_t*>(view.begun + 1);
    view.rest = slot.host_counts + kCounts;
    view.host_counts = slot.host_counts;
    if (chunk.tiles() == 0) std::fill_n(slot.host_counts, kCounts, 0u);
    if (slot.is_small)  // answers go directly to host memory too: a copy would take as long as the kernel
      view.reply = preferring(slot.host_view, direct);
    else
      view.reply = reply_view_over(slot.device_reply.reserve(reply_bytes), slot.rows, fields_, nullptr, joints_);
    // The caller waits for the first rows. A separate proof kernel would have to wait for space among the next chunk's
    // blocks.
    const bool prove_at_once =
        !pair_limits_.prove_depths && (slot.is_small || (chunk.first_row == 0 && slot.rows <= kFirstRows));
    if (pair_limits_.prove_depths || (pair_limits_.prove_overlaps && !prove_at_once))
      view.enclosed = reinterpret_cast<Enclosed*>(slot.device_enclosed.reserve(slot.rows * sizeof(Enclosed)));
    view.prove_at_once = pair_limits_.prove_overlaps && prove_at_once;
    if (f32_goes_first(pair_limits_, chunk, *pairs_))
      view.left_open = reinterpret_cast<LeftOpen*>(slot.device_open.reserve(slot.rows * sizeof(LeftOpen)));
    if (chunk.tiles() > 0) answer(slot, chunk);
    ++counters_.launches;
    if (!slot.is_small) bring(slot, direct);
  }

  ChunkResult finish(int index) override {
    DenseSlot& slot = *slots_[index];
    wait_for(slot);
    // Time since its kernels began, or since the previous chunk ended if they overlapped.
    const Finished& times = *slot.device_view.finished;
    counters_.kernel_ns += std::max(times.ended, last_ended_) - std::max(times.begun, last_ended_);
    last_ended_ = std::max(times.ended, last_ended_);
    return {slot.host_view, {slot.host_counts + kCounts, slot.host_counts[kRest]}, slot.host_counts[kConvergedRows]};
  }

 private:
  // Waits until the chunk has written everything. The flag is visible 2 us before the stream reports completion. After
  // kFlagPatience the stream is used instead, which also reports errors.
  static void wait_for(DenseSlot& slot) {
    const std::uint32_t number = slot.device_view.number;
    const std::atomic_ref<std::uint32_t> flag(slot.device_view.finished->number);
    const auto until = std::chrono::steady_clock::now() + kFlagPatience;
    while (number != 0 && flag.load(std::memory_order_acquire) != number && std::chrono::steady_clock::now() < until) {
    }
    if (number == 0 || flag.load(std::memory_order_acquire) != number)
      check(cudaStreamSynchronize(slot.stream), "answering a query");
    slot.is_under_way = false;
  }

  void answer(DenseSlot& slot, const ChunkSetup& chunk) {
    answer_chunk(slot.device_view, chunk, *pairs_, fields_, LateGrid::among_chunks(), slot.stream);
  }

  // Copies columns to their destinations. Columns that stay in the workspace are contiguous and are copied together.
  void bring(DenseSlot& slot, const ReplyView& direct) {
    const std::byte *from = nullptr, *to = nullptr;
    std::byte* target = nullptr;
    const auto flush = [&] {
      if (from != to)
        check(cudaMemcpyAsync(target, from, to - from, cudaMemcpyDeviceToHost, slot.stream), "copying answers");
      from = to = nullptr;
    };
    const auto column = [&]<class T>(T* device, T* host, T* caller, std::size_t width) {
      if (!device) return;
      const std::size_t bytes = slot.rows * width * sizeof(T);
      const auto* begin = reinterpret_cast<const std::byte*>(device);
      if (caller) {
        check(cudaMemcpyAsync(caller, device, bytes, cudaMemcpyDeviceToHost, slot.stream), "copying answers");
        return;
      }
      auto* destination = reinterpret_cast<std::byte*>(host);
      if (from == nullptr || destination - target != begin - from) {
        flush();
        from = begin;
        target = destination;
      }
      to = begin + bytes;
    };
    const ReplyView &d = slot.device_view.reply, &h = slot.host_view;
    for_each_column(column, d, h, direct);
    flush();
  }

  std::uint64_t last_ended_ = 0;  // of the finished chunks, in device nanoseconds
};

}  // namespace clearance::cuda
