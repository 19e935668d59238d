// Motions on the device: a chunk's levels, one after another in a stream, without waiting for the host in between.
#pragma once

#include <algorithm>
#include <utility>

#include "engine/cuda/memory/chunk_clock.cuh"
#include "engine/cuda/motion/motion_lean.cuh"
#include "engine/cuda/motion/motions.cuh"
#include "engine/device/motion_layout.h"

namespace clearance::cuda {

struct MotionSlot : QuerySlot {
  MotionSlot(MemoryCounters& c, int priority)
      : QuerySlot(c, priority), motions(c), spans(c), pairs(c), hits(c), host_motions(c), host_hits(c) {}

  DeviceBuffer motions, spans, pairs, hits;
  PinnedBuffer host_motions, host_hits;
  ChunkTime time;
  MotionsView view{};
};

class MotionCudaWorkspace final : public QuerySide<LentMotions, MotionSlot> {
  using Side = QuerySide<LentMotions, MotionSlot>;

 public:
  MotionCudaWorkspace(const ResidentHulls& hulls, WorkCounters& counters)
      : Side(hulls, counters), tables_(counters.memory) {}

  void wait_for_all() override { Side::wait_for_all(); }

  void begin(const QuerySetup& s) override {
    Side::begin(s);
    const OnDevice here = on_device();
    const MotionArrays& arrays = *s.motions;
    tables_.clear();
    tables_.add(arrays.movers, at_.movers);
    tables_.add(arrays.chains, at_.chains);
    tables_.add(arrays.chain_of_slot, at_.chain_of_slot);
    tables_.add(arrays.views, at_.views);
    tables_.add(arrays.views_of_pair, at_.views_of_pair);
    tables_.add(arrays.reach, at_.reach);
    tables_.send(slots_[0]->stream);
    check(cudaEventRecord(sent_.event, slots_[0]->stream), "recording an event");
    for (int i = 1; i < kSlots && static_cast<std::uint64_t>(i) < s.chunks; ++i)
      check(cudaStreamWaitEvent(slots_[i]->stream, sent_.event), "waiting for an event");
    margin_ = s.margin;
    max_evaluations_ = s.max_evaluations;
    least_ = s.least;
    clock_.restart();
  }

  void launch(int index, const ChunkSetup& chunk) override {
    const OnDevice here = on_device();
    MotionSlot& slot = *slots_[index];
    slot.is_under_way = true;
    reserve(slot, chunk);
    MotionsView& m = slot.view;
    m.ends = send_given(slot, chunk, Given::kPositions, chunk.positions, 2 * std::size_t{joints_});
    clock_.begin(slot.time, slot.stream);
    start(m, slot.stream);
    clock_.end(slot.time, slot.stream);
    ++counters_.launches;
    const std::size_t bytes = motions_bytes(m.motions);
    std::byte* const host = slot.host_motions.reserve(bytes);
    check(cudaMemcpyAsync(host, m.counts, bytes, cudaMemcpyDeviceToHost, slot.stream), "copying results");
  }

  MotionResult finish(int index) override {
    const OnDevice here = on_device();
    MotionSlot& slot = *slots_[index];
    const MotionsView& m = slot.view;
    check(cudaStreamSynchronize(slot.stream), "deciding motions");
    counters_.kernel_ns += clock_.nanoseconds(slot.time);
    const std::byte* const host = slot.host_motions.data();
    const auto* const counts = reinterpret_cast<const std::uint32_t*>(host);
    const std::size_t rows = counts[kHitRowCount], bytes = rows * sizeof(MotionHitRow);
    std::byte* const hits = slot.host_hits.reserve(std::max<std::size_t>(bytes, 1));
    if (rows > 0) {
      check(cudaMemcpyAsync(hits, m.hit_rows, bytes, cudaMemcpyDeviceToHost, slot.stream), "copying hits");
      check(cudaStreamSynchronize(slot.stream), "copying hits");
    }
    const auto* const free_until = reinterpret_cast<const double*>(host + counts_bytes());
    const std::size_t times = seeks_contact() ? m.motions : 0;
    const auto* const steps = reinterpret_cast<const std::uint32_t*>(free_until + times);
    const auto* const outcomes = reinterpret_cast<const MotionOutcome*>(steps + m.motions);
    return {{outcomes, m.motions},
            {steps, m.motions},
            {free_until, times},
            {reinterpret_cast<const MotionHitRow*>(hits), rows},
            counts[kConvergedCount]};
  }

 private:
  static constexpr std::uint32_t kListBlocks = 16;  // on a multiprocessor, for lists of unknown length
  static constexpr std::uint32_t kMostPairBlocks = 1u << 16;

  bool seeks_contact() const { return (fields_ & kFieldFirstContact) != 0; }
  static std::size_t rounded(std::size_t bytes) { return (bytes + 255) / 256 * 256; }
  // Counts, times, steps and `outcomes` are contiguous, and are copied to the host together.
  static std::size_t counts_bytes() { return rounded(kMotionCounts * sizeof(std::uint32_t)); }
  std::size_t motions_bytes(std::size_t motions) const {
    const std::size_t time = seeks_contact() ? sizeof(double) : 0;
    return counts_bytes() + motions * (time + sizeof(std::uint32_t) + sizeof(MotionOutcome));
  }

  // Consecutive parts of a buffer. If `memory` is null, only counts their bytes.
  struct Parts {
    std::byte* memory;
    std::size_t bytes = 0;
    template <class T>
    void take(T*& at, std::size_t count) {
      at = memory ? reinterpret_cast<T*>(memory + bytes) : nullptr;
      bytes += rounded(count * sizeof(T));
    }
  };
  template <class Take>
  static void make_parts(DeviceBuffer& buffer, const Take& take) {
    Parts counted{nullptr};
    take(counted);
    Parts parts{buffer.reserve(counted.bytes)};
    take(parts);
  }

  // The view of a chunk, without its memory.
  MotionsView view_of(const ChunkSetup& chunk) const {
    MotionsView m{};
    m.chunk.hulls = hulls_.view();
    m.chunk.bodies = bodies_;
    m.chunk.pair_limits = pair_limits_;
    m.chunk.pairs = pairs_->pairs;
    m.chunk.pair_count = chunk.pair_count;
    m.moves = moves_;
    m.tables = at_;
    m.margins = margins_;
    m.margin = margin_;
    m.max_evaluations = max_evaluations_;
    m.seeks_contact = seeks_contact();
    m.finds_least = least_.is_wanted;
    m.abs_tol = least_.abs_tol;
    m.rel_tol = least_.rel_tol;
    m.levels = levels_of(m);
    m.motions = chunk.configurations;
    const MotionCapacity capacity(m.motions, chunk.pair_count);
    m.span_capacity = m.chunk.configurations = capacity.spans;
    m.pair_capacity = capacity.pairs;
    m.hit_capacity = capacity.hits;
    m.apart_capacity = m.finds_least ? 0 : capacity.apart;
    return m;
  }

  void reserve(MotionSlot& slot, const ChunkSetup& chunk) {
    MotionsView& m = slot.view;
    m = view_of(chunk);
    make_parts(slot.motions, [&](Parts& parts) {
      std::byte* begin = nullptr;
      parts.take(begin, motions_bytes(m.motions));
      m.counts = reinterpret_cast<std::uint32_t*>(begin);
      m.free_until = reinterpret_cast<double*>(begin + counts_bytes());
      m.steps = reinterpret_cast<std::uint32_t*>(m.free_until + (m.seeks_contact ? m.motions : 0));
      m.outcomes = reinterpret_cast<MotionOutcome*>(m.steps + m.motions);
      parts.take(m.hit, m.motions);
      parts.take(m.travels, std::size_t{m.motions} * m.moves.frames.robot_count);
      parts.take(m.open, m.motions);
      parts.take(m.to_cpu, m.motions);
      parts.take(m.unresolved, m.motions);
      if (!m.finds_least) return;
      parts.take(m.low, m.motions);
      parts.take(m.seed, 2 * std::size_t{m.motions});
      parts.take(m.lock, m.motions);
    });
    reserve_spans(slot);
    make_parts(slot.pairs, [&](Parts& parts) {
      for (SpanPair** list : {&m.on, &m.next_on, &m.near, &m.to_evaluate}) parts.take(*list, m.pair_capacity);
      if (m.finds_least) return;
      parts.take(m.ways, m.pair_capacity);
      parts.take(m.apart, m.apart_capacity);
    });
    make_parts(slot.hits, [&](Parts& parts) {
      parts.take(m.hits, m.finds_least ? 0 : m.hit_capacity);
      for (MotionHitRow** rows : {&m.best, &m.hit_rows}) parts.take(*rows, m.motions);
    });
  }

  void reserve_spans(MotionSlot& slot) {
    MotionsView& m = slot.view;
    BodiesView& bodies = m.chunk.bodies;
    FramesView& frames = m.moves.frames;
    const std::size_t S = m.span_capacity, moved = S * bodies.moved_count;
    make_parts(slot.spans, [&](Parts& parts) {
      for (MotionSpan** list : {&m.spans, &m.next_spans}) parts.take(*list, S);
      for (std::uint32_t** list : {&m.shares, &m.children, &m.next_children}) parts.take(*list, 2 * S);
      parts.take(m.positions, S * joints_);
      frames.positions = m.positions;
      parts.take(frames.numbers, S * frames_ * 7);
      parts.take(frames.travels, S * frames.robot_count);
      parts.take(frames.facts, S * frames_);
      parts.take(m.twists, S * frames_ * 6);
      parts.take(m.numbers, moved * kMotionNumbers);
      parts.take(m.speeds, moved);
      parts.take(bodies.moved_box, moved);
      parts.take(bodies.moved, moved * bodies.components);
      parts.take(bodies.uncertainties.moved, moved);
      parts.take(bodies.moved_state, moved);
      parts.take(bodies.moved_part_box, S * moved_parts_ * kBoxComponents);
      if (moved_parts_ == 0) bodies.moved_part_box = nullptr;
    });
  }

  static void start(MotionsView& m, cudaStream_t stream) {
    const auto blocks = [](std::uint64_t threads) { return blocks_of(threads, kMotionThreads); };
    const unsigned list_blocks = blocks_for_device(kListBlocks);
    const std::uint64_t S = m.span_capacity, moved = m.chunk.bodies.moved_count;
    begin_motions<<<blocks(std::max(m.motions, kMotionCounts)), kMotionThreads, 0, stream>>>(m);
    for (m.level = 0; m.level < m.levels; ++m.level) {
      const bool at_ends = m.finds_least && m.level == 0, is_first = m.level == 0 || (m.finds_least && m.level == 1);
      const std::uint64_t spans = at_ends ? 2 * std::uint64_t{m.motions} : is_first ? m.motions : S;
      const auto pair_blocks = std::min(blocks(spans * m.chunk.pair_count), kMostPairBlocks);
      place_spans<<<blocks(spans * m.moves.frames.joints), kMotionThreads, 0, stream>>>(m);
      place_span_links<<<blocks(S * m.moves.frames.robot_count), kMotionThreads, 0, stream>>>(m);
      place_span_bodies<<<blocks(S * moved), kMotionThreads, 0, stream>>>(m);
      move_span_bodies<<<blocks(S * moved), kMotionThreads, 0, stream>>>(m);
      if (at_ends) {
        find_seeds_at_ends<<<pair_blocks, kMotionThreads, 0, stream>>>(m);
        evaluate_seeds<<<blocks(spans), kMotionThreads, 0, stream>>>(m);
        aim_at_ends<<<blocks(spans), kMotionThreads, 0, stream>>>(m);
      }
      if (is_first)
        find_near_in_spans<true><<<pair_blocks, kMotionThreads, 0, stream>>>(m);
      else
        find_near_in_spans<false><<<list_blocks, kMotionThreads, 0, stream>>>(m);
      look_along_boxes<<<list_blocks, kMotionThreads, 0, stream>>>(m);
      if (m.finds_least) {
        evaluate_span_pairs<true><<<list_blocks, kEvaluateThreads, 0, stream>>>(m);
      } else {
        iterate_span_pairs<<<list_blocks, kIterateThreads, 0, stream>>>(m);
        divide_span_pairs<<<list_blocks, kMotionThreads, 0, stream>>>(m);
        evaluate_span_pairs<false><<<list_blocks, kEvaluateThreads, 0, stream>>>(m);
        keep_hits<<<list_blocks, kMotionThreads, 0, stream>>>(m);
      }
      if (at_ends)
        begin_whole_motions<<<blocks(m.motions), kMotionThreads, 0, stream>>>(m);
      else
        divide_spans<<<blocks(2 * spans), kMotionThreads, 0, stream>>>(m);
      check(cudaGetLastError(), "starting a kernel");
      std::swap(m.spans, m.next_spans);
      std::swap(m.children, m.next_children);
      std::swap(m.on, m.next_on);
    }
    conclude_motions<<<blocks(m.motions), kMotionThreads, 0, stream>>>(m);
    check(cudaGetLastError(), "starting a kernel");
  }

  Upload tables_;
  MotionTables at_{};
  Event sent_;
  ChunkClock clock_;
  double margin_ = 0;
  std::uint32_t max_evaluations_ = 0;
  LeastTolerance least_;
};

}  // namespace clearance::cuda
