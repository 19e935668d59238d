// Reduced queries on the device: rows of groups, or of the pairs within a distance.
#pragma once

#include "engine/cuda/reduce/reduced.cuh"
#include "engine/cuda/reduce/reduced_slot.cuh"
#include "engine/device/query/reply_columns.h"

namespace clearance::cuda {

inline constexpr std::uint32_t kFirstCapacity = 1u << 17;  // initial capacity for candidates
inline constexpr std::uint64_t kFirstHits = 1u << 14;      // initial capacity for rows of Reduce::kWithin
inline constexpr std::uint32_t kFirstOpen = 1u << 12;      // initial capacity for pairs that teams leave open

class ReducedCudaWorkspace final : public QuerySide<LentReduced, ReducedSlot> {
 public:
  using QuerySide::QuerySide;

  void begin(const QuerySetup& s) override {
    table_ = static_cast<const CudaTable*>(s.table);
    if (table_) clear_counts(*slots_[0]);  // now, so that it does not delay the search for near pairs
    QuerySide::begin(s);
    begin_elements(s);
    settings_ = ReducedSettings(s, hulls_);
    most_rows_ = s.most_rows;
    clock_.restart();
  }

  // All memory grows before the first kernel starts.
  void launch(int index, const ChunkSetup& chunk, const ReplyView& direct) override {
    const OnDevice here = on_device();
    ReducedSlot& slot = *slots_[index];
    ReducedView& r = slot.view;
    r.chunk = view_of(slot, chunk);
    settings_.apply(r, static_cast<std::uint32_t>(chunk.rows()), margins_);
    r.elements = elements_.view();
    if (r.elements.count > 0) start_moved_element_boxes(r.chunk, r.elements, slot.stream);
    r.chunk.counts = reinterpret_cast<std::uint32_t*>(slot.device_counts.reserve(kCounts * sizeof(std::uint32_t)));
    r.chunk.host_counts = reinterpret_cast<std::uint32_t*>(slot.host_counts.reserve(kCounts * sizeof(std::uint32_t)));
    slot.direct = direct;
    slot.most_rows = within() ? std::min<std::uint64_t>(r.rows, most_rows_) : groups_of(r);
    if (settings_.by_teams) return launch_teams(slot);
    slot.counts_are_clear = false;
    if (!table_) slot.listed = std::max(slot.listed, std::min(r.rows, kFirstCapacity));
    reserve_items(slot, table_ ? std::min(r.rows, slot.table.expected(r.chunk.bodies.bodies)) : slot.listed);
    reserve_rows(slot, within() ? std::min(slot.most_rows, kFirstHits) : slot.most_rows);

    clock_.begin(slot.time, slot.stream);
    if (table_)
      slot.table.prepare(slot.stream);
    else if (within())
      mark(slot);
    else if (any())
      begin_decisions(slot);
    else
      seed(slot);
    solve(slot);
    write(slot);
    kernels_end(slot);
  }

  ReducedResult finish(int index) override {
    const OnDevice here = on_device();
    ReducedSlot& slot = *slots_[index];
    const ReducedView& r = slot.view;
    check(cudaStreamSynchronize(slot.stream), "answering a query");
    if (settings_.by_teams) {
      answer_open(slot);
    } else if (const std::uint32_t candidates = r.chunk.host_counts[kCandidates]; candidates > r.capacity) {
      if (!table_) slot.listed = candidates;
      reserve_items(slot, candidates);
      clear(slot);
      solve(slot);
      write(slot);
      check(cudaStreamSynchronize(slot.stream), "answering a query");
    }
    counters_.kernel_ns += clock_.nanoseconds(slot.time);
    if (table_) {
      slot.table.found(r.chunk.host_counts[kCandidates]);
      counters_.broad_phase_ns += slot.table.nanoseconds_since(boxes_begun_);
    }
    const std::uint32_t rest = r.chunk.host_counts[kRest];
    if (rest == 0) return result(slot);
    auto* rows = reinterpret_cast<std::uint32_t*>(slot.host_rest.reserve(rest * sizeof(std::uint32_t)));
    check(cudaMemcpyAsync(rows, r.rest_rows, rest * sizeof(std::uint32_t), cudaMemcpyDeviceToHost, slot.stream),
          "copying rows");
    check(cudaStreamSynchronize(slot.stream), "copying rows");
    ReducedResult open;
    open.rest = {rows, rest};
    return open;
  }

  ReducedResult finish_with(int index, std::span<const PairAnswer> answers) override {
    const OnDevice here = on_device();
    ReducedSlot& slot = *slots_[index];
    const std::size_t bytes = answers.size_bytes();
    std::byte* host = slot.host_answers.reserve(bytes);
    std::memcpy(host, answers.data(), bytes);
    std::byte* device = slot.device_answers.reserve(bytes);
    check(cudaMemcpyAsync(device, host, bytes, cudaMemcpyHostToDevice, slot.stream), "copying answers");
    const auto count = static_cast<std::uint32_t>(answers.size());
    const auto take = any() ? take_open_answers : take_answers;
    take<<<blocks_of(count, kItemThreads), kItemThreads, 0, slot.stream>>>(
        slot.view, reinterpret_cast<const PairAnswer*>(device), count);
    if (!any() && !within()) clear_winners(slot.view, slot.stream);
    write(slot);
    check(cudaStreamSynchronize(slot.stream), "answering a query");
    return result(slot);
  }

 private:
  bool within() const { return settings_.reduce == Reduce::kWithin; }
  bool any() const { return settings_.reduce == Reduce::kAny; }

  // Clouds and meshes among the bodies, with the boxes of fixed ones.
  void begin_elements(const QuerySetup& s) {
    const OnDevice here = on_device();
    elements_.begin(s, bodies_.bodies, slots_[0]->stream);
    if (s.elements.empty()) return;
    start_element_boxes(elements_.view(), bodies_, slots_[0]->stream);
    check(cudaEventRecord(ready_.event, slots_[0]->stream), "recording an event");
    for (int i = 1; i < kSlots && static_cast<std::uint64_t>(i) < s.chunks; ++i)
      check(cudaStreamWaitEvent(slots_[i]->stream, ready_.event), "waiting for an event");
  }

  void kernels_end(ReducedSlot& slot) {
    clock_.end(slot.time, slot.stream);
    ++counters_.launches;
  }

  // One team of threads decides each configuration. Configurations that teams leave open are rare, and are listed.
  void launch_teams(ReducedSlot& slot) {
    ReducedView& r = slot.view;
    reserve_items(slot, std::max({r.chunk.configurations, kFirstOpen, slot.listed}));
    reserve_rows(slot, slot.most_rows);
    reserve_groups(slot);
    if (!slot.counts_are_clear) clear_counts(slot);
    slot.counts_are_clear = true;  // the kernel leaves them cleared
    clock_.begin(slot.time, slot.stream);
    start_teams(r, slot.stream);
    kernels_end(slot);
  }
  void answer_open(ReducedSlot& slot) {
    ReducedView& r = slot.view;
    if (const std::uint32_t open = r.chunk.host_counts[kCandidates]; open > r.capacity) {
      slot.listed = open;
      reserve_items(slot, open);
      start_teams(r, slot.stream);
      check(cudaStreamSynchronize(slot.stream), "answering a query");
    }
    if (r.chunk.host_counts[kCandidates] == 0) return;
    slot.counts_are_clear = false;
    check(cudaMemcpyAsync(r.chunk.counts, r.chunk.host_counts, kCounts * sizeof(std::uint32_t), cudaMemcpyHostToDevice,
                          slot.stream),
          "copying counts");
    clear_candidates(r, slot.stream);
    start_items(r, hulls_.has_several(), slot.stream);
    write(slot);
    check(cudaStreamSynchronize(slot.stream), "answering a query");
  }

  void reserve_items(ReducedSlot& slot, std::uint32_t capacity) {
    ReducedView& r = slot.view;
    take_item_memory(r, slot.device_items.reserve(item_bytes(capacity)), capacity);
    if (!table_) return;
    slot.table.reserve(r, *table_, slot.stream);
    if (r.hit_ranks) slot.reserve_ranks();
  }

  // The kernel writes rows directly to host memory, to the caller's if it is pinned.
  void reserve_rows(ReducedSlot& slot, std::uint64_t rows) {
    ReducedView& r = slot.view;
    std::uint64_t bytes = 0;
    reply_view_over(nullptr, rows, fields_, &bytes, joints_);
    r.reply_rows = rows;
    const ReplyView own = reply_view_over(slot.host_reply.reserve(bytes), rows, fields_, nullptr, joints_);
    r.chunk.reply = preferring(own, slot.direct);
  }

  void reserve_groups(ReducedSlot& slot) {
    take_group_memory(slot.view, slot.device_groups.reserve(group_bytes(slot.view)), settings_.by_teams);
  }

  void seed(ReducedSlot& slot) {
    reserve_groups(slot);
    clear_all_groups(slot.view, slot.stream);
    start_seeds(slot.view, slot.stream);
  }

  void begin_decisions(ReducedSlot& slot) {
    reserve_groups(slot);
    clear_all_groups(slot.view, slot.stream);
    clear_counts(slot);
  }

  // Marks the pairs whose boxes are within max_distance.
  void mark(ReducedSlot& slot) {
    ReducedView& r = slot.view;
    const std::size_t words = (std::size_t{r.rows} + 31) / 32;
    r.candidate_words = reinterpret_cast<std::uint32_t*>(slot.device_words.reserve(4 * words * sizeof(std::uint32_t)));
    r.hit_words = r.candidate_words + words;
    r.candidate_ranks = r.hit_words + words;
    r.hit_ranks = r.candidate_ranks + words;
    slot.reserve_ranks();
    mark_candidates<<<blocks_of(r.rows, kScanThreads), kScanThreads, 0, slot.stream>>>(r);
    slot.rank(r.candidate_words, r.candidate_ranks);
    check(cudaGetLastError(), "starting a kernel");
  }

  void clear_counts(ReducedSlot& slot) {
    const OnDevice here = on_device();
    constexpr std::size_t bytes = kCounts * sizeof(std::uint32_t);
    cuda::clear_counts(reinterpret_cast<std::uint32_t*>(slot.device_counts.reserve(bytes)), slot.stream);
  }
  // Call before solve() and write() are repeated.
  void clear(ReducedSlot& slot) {
    clear_counts(slot);
    if (!within()) clear_candidates(slot.view, slot.stream);
  }

  void solve(ReducedSlot& slot) {
    const ReducedView& r = slot.view;
    if (any()) {
      start_decisions(r, slot.stream);
      return start_open_pairs(r, slot.stream);
    }
    if (table_)
      slot.table.run(r, slot.stream);
    else if (within())
      list_candidates<<<blocks_of((std::uint64_t{r.rows} + 31) / 32, kScanThreads), kScanThreads, 0, slot.stream>>>(r);
    else
      start_candidates(r, slot.stream);
    start_items(r, hulls_.has_several(), slot.stream);
  }

  void write(ReducedSlot& slot) {
    const ReducedView& r = slot.view;
    if (!within()) return start_group_rows(r, slot.stream);
    if (r.hit_ranks) slot.rank(r.hit_words, r.hit_ranks);
    write_hits<<<item_blocks(r), kItemThreads, 0, slot.stream>>>(r);
    check(cudaGetLastError(), "starting a kernel");
  }

  // The rows of a chunk without unresolved pairs.
  ReducedResult result(ReducedSlot& slot) {
    const ReducedView& r = slot.view;
    ReducedResult done;
    done.total = within() ? r.chunk.host_counts[kHits] : slot.most_rows;
    done.row_count = std::min(done.total, slot.most_rows);
    if (done.row_count > r.reply_rows) {
      reserve_rows(slot, done.row_count);
      write(slot);
      check(cudaStreamSynchronize(slot.stream), "answering a query");
    }
    slot.is_under_way = false;
    done.rows = r.chunk.reply;
    done.converged = r.chunk.host_counts[kConvergedRows];
    return done;
  }

  ReducedSettings settings_;
  std::uint64_t most_rows_ = 0;
  const CudaTable* table_ = nullptr;  // null if the query's pairs are listed
  QueryElements elements_{counters_.memory};
  ChunkClock clock_;
};

}  // namespace clearance::cuda
