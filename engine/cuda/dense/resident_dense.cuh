// Device queries with a row per configuration and pair.
#pragma once

#include "engine/cuda/dense/dense_launch.cuh"
#include "engine/cuda/dense/open_rows.cuh"
#include "engine/cuda/workspace/resident_workspace.cuh"

namespace clearance::cuda {

struct ResidentDenseSlot : ResidentSlot {
  ResidentDenseSlot(MemoryCounters& c, int priority) : ResidentSlot(c, priority), enclosed(c), open(c), rest(c) {}

  DeviceBuffer enclosed, open, rest;
};

class ResidentDense final : public ResidentSide<ResidentDenseSlot> {
 public:
  using ResidentSide::ResidentSide;

  void launch(const ChunkSetup& chunk, const ReplyView& rows, const ResidentPairs& in_order,
              std::uint64_t first_in_order, void* stream) override {
    if (chunk.tiles() == 0) return;
    const OnDevice here = on_device();
    const Lent lent(slot(), stream);
    ChunkView view = view_of(slot(), chunk);
    view.reply = rows;
    view.counts = counts();
    view.rest = reinterpret_cast<std::uint32_t*>(slot().rest.data());
    if (pair_limits_.prove_overlaps) view.enclosed = reinterpret_cast<Enclosed*>(slot().enclosed.data());
    if (pair_limits_.f32) view.left_open = reinterpret_cast<LeftOpen*>(slot().open.data());
    check(cudaMemsetAsync(view.counts, 0, kCounts * sizeof(std::uint32_t), slot().stream), "clearing counters");
    const LateGrid late = LateGrid::whole_device();
    answer_chunk(view, chunk, *pairs_, fields_, late, slot().stream);
    const auto blocks = std::min(blocks_of(chunk.rows(), kTile), late.blocks);
    answer_open_rows<<<blocks, kTile, 0, slot().stream>>>(
        view, static_cast<const CudaPairs&>(in_order).pairs + first_in_order, late.warps);
    check(cudaGetLastError(), "starting a kernel");
    ++counters_.launches;
  }

 private:
  void reserve_rows(std::uint64_t rows, std::uint32_t) override {
    slot().rest.reserve(rows * sizeof(std::uint32_t));
    if (pair_limits_.prove_overlaps) slot().enclosed.reserve(rows * sizeof(Enclosed));
    if (pair_limits_.f32) slot().open.reserve(rows * sizeof(LeftOpen));
  }
  std::uint64_t bytes_for_rows() const override {
    return slot().rest.size() + slot().enclosed.size() + slot().open.size();
  }
};

}  // namespace clearance::cuda
