// A dense query between a caller's device memory and the caller's device memory, in the caller's stream.
#pragma once

#include <utility>

#include "engine/cuda/dense_launch.cuh"
#include "engine/cuda/open_rows.cuh"
#include "engine/cuda/workspace.cuh"

namespace clearance::cuda {

struct StandingSlot : QuerySlot {
  StandingSlot(MemoryCounters& c, int priority)
      : QuerySlot(c, priority), enclosed(c), open(c), rest(c), counts(c), rows(c) {}

  DeviceBuffer enclosed, open, rest, counts, rows;
};

class CudaStanding final : public QuerySide<StandingWorkspace, StandingSlot> {
 public:
  using QuerySide::QuerySide;

  int device() const override { return hulls_.device(); }

  std::byte* room_for_rows(std::size_t bytes) override {
    const OnDevice here = on_device();
    return slots_[0]->rows.reserve(bytes);
  }

  void make_room(std::uint64_t rows, std::uint32_t configurations) override {
    const OnDevice here = on_device();
    StandingSlot& slot = *slots_[0];
    slot.device_bodies.reserve(moved_room(configurations).bytes());
    slot.rest.reserve(rows * sizeof(std::uint32_t));
    slot.counts.reserve(kCounts * sizeof(std::uint32_t));
    if (question_.prove_overlaps) slot.enclosed.reserve(rows * sizeof(Enclosed));
    if (question_.f32) slot.open.reserve(rows * sizeof(LeftOpen));
    check(cudaStreamSynchronize(slot.stream), "preparing a query");
    slot.is_under_way = false;
  }

  void launch(const ChunkSetup& chunk, const ReplyView& rows, const ResidentPairs& in_order,
              std::uint64_t first_in_order, void* stream) override {
    if (chunk.tiles() == 0) return;
    const OnDevice here = on_device();
    StandingSlot& slot = *slots_[0];
    const Lent lent(slot, static_cast<cudaStream_t>(stream));
    ChunkView view = view_of(slot, chunk);
    view.reply = rows;
    view.counts = reinterpret_cast<std::uint32_t*>(slot.counts.data());
    view.rest = reinterpret_cast<std::uint32_t*>(slot.rest.data());
    if (question_.prove_overlaps) view.enclosed = reinterpret_cast<Enclosed*>(slot.enclosed.data());
    if (question_.f32) view.left_open = reinterpret_cast<LeftOpen*>(slot.open.data());
    check(cudaMemsetAsync(view.counts, 0, kCounts * sizeof(std::uint32_t), slot.stream), "clearing counters");
    answer_chunk(view, chunk, *pairs_, fields_, false, slot.stream);
    const auto blocks = std::min(blocks_of(chunk.rows(), kTile), kLateBlocks);
    answer_open_rows<<<blocks, kTile, 0, slot.stream>>>(
        view, static_cast<const CudaPairs&>(in_order).pairs + first_in_order, kLateWarps);
    check(cudaGetLastError(), "starting a kernel");
    ++counters_.launches;
  }

 private:
  // The caller's stream in place of the slot's own.
  class Lent {
   public:
    Lent(StandingSlot& slot, cudaStream_t stream) : slot_(slot), own_(std::exchange(slot.stream, stream)) {}
    ~Lent() {
      slot_.stream = own_;
      slot_.is_under_way = false;  // the caller's stream is the caller's to wait for
    }
    Lent(const Lent&) = delete;

   private:
    StandingSlot& slot_;
    cudaStream_t own_;
  };
};

}  // namespace clearance::cuda
