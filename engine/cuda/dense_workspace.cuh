// Dense queries on the device: a row for every configuration and pair.
#pragma once

#include "group_kernel.cuh"
#include "overlap_kernel.cuh"
#include "reply_columns.h"
#include "workspace.cuh"

namespace clearance::cuda {

inline constexpr std::uint64_t kOverlapBlocks = 512;  // how many pairs overlap is not known when they start
inline constexpr std::uint32_t kRestAtOnce = 4096;    // unsettled rows that come back without a second copy

struct DenseSlot : QuerySlot {
  DenseSlot(MemoryCounters& c, int priority)
      : QuerySlot(c, priority), device_reply(c), device_rest(c), device_enclosed(c), host_reply(c), host_rest(c) {}

  DeviceBuffer device_reply, device_rest, device_enclosed;
  PinnedBuffer host_reply, host_rest;
  std::uint64_t rows = 0;
  ChunkView device_view;
  ReplyView host_view;
  std::uint32_t* host_counts = nullptr;
};

class DenseWorkspace final : public QuerySide<Workspace, DenseSlot> {
 public:
  using QuerySide::QuerySide;

  void launch(int index, const ChunkSetup& chunk, const ReplyView& direct) override {
    DenseSlot& slot = *slots_[index];
    const std::uint64_t rows = chunk.rows();
    ChunkView view = view_of(slot, chunk);

    std::uint64_t reply_bytes = 0;
    reply_view_over(nullptr, rows, fields_, &reply_bytes);
    view.reply = reply_view_over(slot.device_reply.reserve(reply_bytes), rows, fields_);
    const std::size_t counts_bytes = (kCounts + rows) * sizeof(std::uint32_t);
    view.counts = reinterpret_cast<std::uint32_t*>(slot.device_rest.reserve(counts_bytes));
    view.rest = view.counts + kCounts;
    view.enclosed = question_.prove_overlaps
                        ? reinterpret_cast<Enclosed*>(slot.device_enclosed.reserve(rows * sizeof(Enclosed)))
                        : nullptr;
    check(cudaMemsetAsync(view.counts, 0, kCounts * sizeof(std::uint32_t), slot.stream), "clearing counters");
    const bool only_compact = fields_ == kFieldCompact;
    kernels_begin(slot);
    if (chunk.group_tiles > 0) {
      view.group_of_tile = pairs_->group_of_tile + chunk.first_tile;
      (only_compact ? answer_groups<true> : answer_groups<false>)<<<chunk.group_tiles, kTile, pairs_->shared_bytes, slot.stream>>>(view);
    }
    if (chunk.stray_tiles > 0)
      (only_compact ? answer_strays<true> : answer_strays<false>)<<<chunk.stray_tiles, kTile, 0, slot.stream>>>(view, chunk.strays);
    if (question_.prove_overlaps) {
      const auto blocks = static_cast<unsigned>(std::min<std::uint64_t>((rows + kTile - 1) / kTile, kOverlapBlocks));
      prove_overlaps<<<blocks, kTile, 0, slot.stream>>>(view);
    }
    check(cudaGetLastError(), "starting a kernel");
    kernels_end(slot);

    slot.rows = rows;
    slot.device_view = view;
    slot.host_view = reply_view_over(slot.host_reply.reserve(reply_bytes), rows, fields_);
    bring(slot, direct);
    slot.host_counts = reinterpret_cast<std::uint32_t*>(slot.host_rest.reserve(counts_bytes));
    const std::size_t at_once = (kCounts + std::min<std::uint64_t>(rows, kRestAtOnce)) * sizeof(std::uint32_t);
    check(cudaMemcpyAsync(slot.host_counts, view.counts, at_once, cudaMemcpyDeviceToHost, slot.stream),
          "copying counters");
  }

  ChunkResult finish(int index) override {
    DenseSlot& slot = *slots_[index];
    check(cudaStreamSynchronize(slot.stream), "answering a query");
    const std::uint32_t rest = slot.host_counts[kRest];
    std::uint32_t* const listed = slot.host_counts + kCounts;
    if (rest > kRestAtOnce) {
      check(cudaMemcpyAsync(listed + kRestAtOnce, slot.device_view.rest + kRestAtOnce,
                            (rest - kRestAtOnce) * sizeof(std::uint32_t), cudaMemcpyDeviceToHost, slot.stream),
            "copying rows");
      check(cudaStreamSynchronize(slot.stream), "copying rows");
    }
    count_kernels(slot);
    return {slot.host_view, {listed, rest}, slot.host_counts[kSettledRows]};
  }

 private:
  // Copies columns to where they are wanted; those that wait in the workspace lie side by side and go at once.
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
};

}  // namespace clearance::cuda
