// Device queries with a row per configuration: its least distance, or whether all its pairs are beyond their margins.
#pragma once

#include "engine/cuda/reduce/open_items.cuh"
#include "engine/cuda/reduce/reduced_launch.cuh"
#include "engine/cuda/workspace/resident_workspace.cuh"

namespace clearance::cuda {

struct ResidentReducedSlot : ResidentSlot {
  ResidentReducedSlot(MemoryCounters& c, int priority) : ResidentSlot(c, priority), groups(c), items(c) {}

  DeviceBuffer groups, items;
};

class ResidentReduced final : public ResidentSide<ResidentReducedSlot> {
 public:
  using ResidentSide::ResidentSide;

  void begin(const QuerySetup& s) override {
    ResidentSide::begin(s);
    settings_ = ReducedSettings(s, hulls_);
  }

  void launch(const ChunkSetup& chunk, const ReplyView& rows, const ResidentPairs&, std::uint64_t,
              void* stream) override {
    const OnDevice here = on_device();
    const Lent lent(slot(), stream);
    const cudaStream_t in = slot().stream;
    ReducedView r{};
    r.chunk = view_of(slot(), chunk);
    settings_.apply(r, static_cast<std::uint32_t>(chunk.rows()), margins_);
    r.chunk.reply = rows;
    r.reply_rows = groups_of(r);
    r.chunk.counts = counts();
    r.chunk.host_counts = spare_counts();
    take_item_memory(r, slot().items.data(), capacity_of(chunk.rows(), chunk.configurations));
    take_group_memory(r, slot().groups.data(), settings_.by_teams);
    if (settings_.by_teams)
      by_teams(r, in);
    else if (settings_.reduce == Reduce::kAny)
      decide(r, in);
    else
      by_stages(r, in);
    start_group_rows(r, in);
    ++counters_.launches;
  }

 private:
  // No host can grow the lists later, so they have capacity for all pairs and for one answer per configuration.
  static std::uint32_t capacity_of(std::uint64_t rows, std::uint32_t configurations) {
    return static_cast<std::uint32_t>(std::max<std::uint64_t>(rows, configurations));
  }
  void reserve_rows(std::uint64_t rows, std::uint32_t configurations) override {
    slot().items.reserve(item_bytes(capacity_of(rows, configurations)));
    ReducedView r{};
    r.chunk.configurations = configurations;
    r.groups = settings_.groups;
    slot().groups.reserve(group_bytes(r));
  }
  std::uint64_t bytes_for_rows() const override { return slot().items.size() + slot().groups.size(); }

  void by_stages(const ReducedView& r, cudaStream_t stream) {
    clear_all_groups(r, stream);
    start_seeds(r, stream);  // clears the counts
    start_candidates(r, stream);
    evaluate_items(r, stream);
  }
  void decide(const ReducedView& r, cudaStream_t stream) {
    clear_all_groups(r, stream);
    clear_counts(r.chunk.counts, stream);
    start_decisions(r, stream);
    answer_open<true>(r, stream);
  }
  // Configurations that teams leave open are rare, and are listed.
  void by_teams(ReducedView& r, cudaStream_t stream) {
    clear_counts(r.chunk.counts, stream);
    clear_candidates(r, stream);
    r.chunk.host_counts = nullptr;  // the counts stay for later kernels
    start_teams(r, stream);
    r.chunk.host_counts = spare_counts();
    evaluate_items(r, stream);
  }
  void evaluate_items(const ReducedView& r, cudaStream_t stream) {
    start_items(r, hulls_.has_several(), stream);
    answer_open<false>(r, stream);
  }
  template <bool kAny>
  static void answer_open(const ReducedView& r, cudaStream_t stream) {
    constexpr std::uint32_t kWarps = 128;  // few but slow pairs
    answer_open_items<kAny><<<item_blocks(r), kItemThreads, 0, stream>>>(r, kWarps);
    check(cudaGetLastError(), "starting a kernel");
  }

  ReducedSettings settings_;
};

}  // namespace clearance::cuda
