// Dense queries on the device: a row for every configuration and pair.
#pragma once

#include "group_kernel.cuh"
#include "overlap_kernel.cuh"
#include "reply_columns.h"
#include "workspace.cuh"

namespace clearance::cuda {

inline constexpr std::uint64_t kOverlapBlocks = 512;  // how many pairs overlap is not known when they start
inline constexpr std::uint64_t kSmallRows = 16384;    // of a chunk that is answered with as few calls as can be
inline constexpr std::uint32_t kRestAtOnce = 4096;    // unsettled rows that come back without a second copy

struct DenseSlot : QuerySlot {
  DenseSlot(MemoryCounters& c, int priority)
      : QuerySlot(c, priority),
        device_reply(c), device_rest(c), device_enclosed(c), device_counts(c), host_reply(c), host_rest(c) {}

  DeviceBuffer device_reply, device_rest, device_enclosed, device_counts;
  PinnedBuffer host_reply, host_rest;
  std::uint64_t rows = 0;
  bool is_small = false;
  ChunkView device_view;
  ReplyView host_view;
  std::uint32_t* host_counts = nullptr;
};

class DenseWorkspace final : public QuerySide<Workspace, DenseSlot> {
 public:
  using QuerySide::QuerySide;

  void begin(const QuerySetup& s) override {
    QuerySide::begin(s);
    warm_ = s.warm ? static_cast<CudaWarm*>(s.warm)->rows() : nullptr;
    all_pairs_ = s.all_pairs;
  }

  void launch(int index, const ChunkSetup& chunk, const ReplyView& direct) override {
    const OnDevice here = on_device();
    DenseSlot& slot = *slots_[index];
    slot.rows = chunk.rows();
    slot.is_small = slot.rows <= kSmallRows;
    ChunkView& view = slot.device_view = view_of(slot, chunk);
    view.warm = warm_ ? warm_ + chunk.first_row : nullptr;
    view.warm_stride = all_pairs_;
    std::uint64_t reply_bytes = 0;
    reply_view_over(nullptr, slot.rows, fields_, &reply_bytes);
    slot.host_view = reply_view_over(slot.host_reply.reserve(reply_bytes), slot.rows, fields_);
    const std::size_t counts_bytes = (kCounts + slot.rows) * sizeof(std::uint32_t);
    slot.host_counts = reinterpret_cast<std::uint32_t*>(slot.host_rest.reserve(counts_bytes));
    if (slot.is_small)
      launch_small(slot, chunk, direct);
    else
      launch_large(slot, chunk, direct, reply_bytes, counts_bytes);
  }

  ChunkResult finish(int index) override {
    DenseSlot& slot = *slots_[index];
    check(cudaStreamSynchronize(slot.stream), "answering a query");
    const std::uint32_t rest = slot.host_counts[kRest];
    std::uint32_t* const listed = slot.host_counts + kCounts;
    if (rest > kRestAtOnce && !slot.is_small) {
      check(cudaMemcpyAsync(listed + kRestAtOnce, slot.device_view.rest + kRestAtOnce,
                            (rest - kRestAtOnce) * sizeof(std::uint32_t), cudaMemcpyDeviceToHost, slot.stream),
            "copying rows");
      check(cudaStreamSynchronize(slot.stream), "copying rows");
    }
    count_kernels(slot);
    return {slot.host_view, {listed, rest}, slot.host_counts[kSettledRows]};
  }

 private:
  // One kernel, which writes straight to host memory: a copy, a kernel more and clearing would each take as long as it does.
  void launch_small(DenseSlot& slot, const ChunkSetup& chunk, const ReplyView& direct) {
    ChunkView& view = slot.device_view;
    view.reply = slot.host_view;
    const auto prefer = [](auto*& column, auto* to, int) {
      if (to) column = to;
    };
    for_each_column(prefer, view.reply, direct);
    if (!slot.device_counts.data()) {
      const std::size_t bytes = kCounts * sizeof(std::uint32_t);
      check(cudaMemsetAsync(slot.device_counts.reserve(bytes), 0, bytes, slot.stream), "clearing counters");
    }
    view.counts = reinterpret_cast<std::uint32_t*>(slot.device_counts.data());
    view.rest = slot.host_counts + kCounts;
    view.prove_at_once = question_.prove_overlaps;
    view.host_counts = slot.host_counts;
    view.blocks = chunk.group_tiles + chunk.stray_tiles;
    if (view.blocks == 0) std::fill_n(slot.host_counts, kCounts, 0u);
    kernels_begin(slot);
    answer(slot, chunk);
    kernels_end(slot);
  }

  void launch_large(DenseSlot& slot, const ChunkSetup& chunk, const ReplyView& direct, std::uint64_t reply_bytes,
                    std::size_t counts_bytes) {
    ChunkView& view = slot.device_view;
    view.reply = reply_view_over(slot.device_reply.reserve(reply_bytes), slot.rows, fields_);
    view.counts = reinterpret_cast<std::uint32_t*>(slot.device_rest.reserve(counts_bytes));
    view.rest = view.counts + kCounts;
    view.enclosed = question_.prove_overlaps
                        ? reinterpret_cast<Enclosed*>(slot.device_enclosed.reserve(slot.rows * sizeof(Enclosed)))
                        : nullptr;
    check(cudaMemsetAsync(view.counts, 0, kCounts * sizeof(std::uint32_t), slot.stream), "clearing counters");
    kernels_begin(slot);
    answer(slot, chunk);
    if (question_.prove_overlaps) {
      const auto blocks = static_cast<unsigned>(std::min<std::uint64_t>((slot.rows + kTile - 1) / kTile, kOverlapBlocks));
      prove_overlaps<<<blocks, kTile, 0, slot.stream>>>(view);
      check(cudaGetLastError(), "starting a kernel");
    }
    kernels_end(slot);
    bring(slot, direct);
    const std::size_t at_once = (kCounts + std::min<std::uint64_t>(slot.rows, kRestAtOnce)) * sizeof(std::uint32_t);
    check(cudaMemcpyAsync(slot.host_counts, view.counts, at_once, cudaMemcpyDeviceToHost, slot.stream),
          "copying counters");
  }

  void answer(DenseSlot& slot, const ChunkSetup& chunk) {
    const bool only_compact = fields_ == kFieldCompact;
    if (warm_)
      only_compact ? answer_as<true, true>(slot, chunk) : answer_as<false, true>(slot, chunk);
    else
      only_compact ? answer_as<true, false>(slot, chunk) : answer_as<false, false>(slot, chunk);
    check(cudaGetLastError(), "starting a kernel");
  }
  template <bool kCompact, bool kWarm>
  void answer_as(DenseSlot& slot, const ChunkSetup& chunk) {
    ChunkView& view = slot.device_view;
    view.group_of_tile = pairs_->group_of_tile + chunk.first_tile;
    if (chunk.group_tiles > 0)
      answer_groups<kCompact, kWarm><<<chunk.group_tiles, kTile, pairs_->shared_bytes, slot.stream>>>(view);
    if (chunk.stray_tiles > 0)
      answer_strays<kCompact, kWarm><<<chunk.stray_tiles, kTile, 0, slot.stream>>>(view, chunk.strays);
  }

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

  WarmRow* warm_ = nullptr;  // of the query's rows; null: cold
  std::uint64_t all_pairs_ = 0;
};

}  // namespace clearance::cuda
