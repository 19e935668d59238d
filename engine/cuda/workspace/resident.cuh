// Data kept in device memory between queries: the scene's hulls, and lists of pairs.
#pragma once

#include <algorithm>
#include <vector>

#include "engine/cuda/memory/memory.cuh"
#include "engine/cuda/pair/pair_kernel.cuh"
#include "engine/device/device.h"
#include "engine/device/hull_arrays.h"
#include "engine/state/pair_table.h"

namespace clearance::cuda {

// The scene's hulls in device memory.
class ResidentHulls {
 public:
  /// On the calling thread's device.
  /// \param most_shared bytes of a block's shared memory that two hulls may use
  /// \param before hulls of another scene on this device; may be null. Those of both scenes are copied on the device.
  ResidentHulls(const engine::Scene& scene, int most_shared, MemoryCounters& counters, const ResidentHulls* before)
      : memory_(counters) {
    check(cudaGetDevice(&device_), "getting the device");
    const bool shares = before && before->most_shared_ == most_shared && before->held_.suits(scene);
    static const HeldHulls none;
    const HeldHulls& held = shares ? before->held_ : none;
    const HullsView from = shares ? before->view_ : HullsView{};
    HullArrays arrays(scene, static_cast<std::uint32_t>(most_shared), held);
    const std::size_t n = held.vertices;
    memory_.add(arrays.heads, view_.heads);
    memory_.add_after(from.x, n, arrays.x, view_.x);
    memory_.add_after(from.y, n, arrays.y, view_.y);
    memory_.add_after(from.z, n, arrays.z, view_.z);
    memory_.add_after(from.f32, 4 * n, arrays.f32, view_.f32);
    memory_.add_after(from.words, held.words, arrays.words, view_.words);
    memory_.add(arrays.of_body, view_.of_body);
    memory_.add(arrays.part_begin, view_.part_begin);
    memory_.add(arrays.part_hull, view_.part_hull);
    memory_.send(nullptr);
    check(cudaStreamSynchronize(nullptr), "copying the scene to the device");
    memory_.forget_host();
    held_ = arrays.held();
    most_shared_ = most_shared;
    of_body_ = std::move(arrays.of_body);
    part_begin_ = std::move(arrays.part_begin);
    has_several_ = std::ranges::find(of_body_, kSeveral) != of_body_.end();
  }
  std::size_t uploaded_bytes() const { return memory_.new_bytes(); }  ///< the rest was on the device before
  const HullsView& view() const { return view_; }
  int device() const { return device_; }  ///< its number
  std::uint32_t of_body(std::uint32_t body) const { return of_body_[body]; }
  const HullHead& head(std::uint32_t hull) const { return held_.heads[hull]; }
  bool is_shared(std::uint32_t hull) const { return held_.heads[hull].count <= kMostSharedVertices; }
  bool has_several() const { return has_several_; }         ///< whether a body has several convex parts
  std::size_t parts() const { return part_begin_.back(); }  ///< of all bodies on the device
  std::uint32_t convex_parts_of(std::uint32_t body) const { return part_begin_[body + 1] - part_begin_[body]; }

 private:
  int device_ = 0;
  Upload memory_;
  std::vector<std::uint32_t> of_body_, part_begin_;
  HeldHulls held_;
  int most_shared_ = 0;
  bool has_several_ = false;
  HullsView view_;
};

class CudaPairs final : public ResidentPairs {
 public:
  CudaPairs(const ResidentHulls& hulls, MemoryCounters& counters, std::span<const PairRef> p,
            std::span<const std::uint32_t> at, std::span<const Group> tiles)
      : memory_(counters) {
    memory_.add(p, pairs);
    memory_.add(at, position);
    memory_.add(tiles, group_of_tile);
    memory_.send(nullptr);
    check(cudaStreamSynchronize(nullptr), "copying pairs to the device");
    memory_.forget_host();
    for (const Group& group : tiles) {
      const HullHead &a = hulls.head(group.hull_a), &b = hulls.head(group.hull_b);
      const bool same = group.hull_a == group.hull_b;
      most_shared = std::max<std::size_t>(most_shared, shared_bytes(a) + (same ? 0 : shared_bytes(b)));
      if (fit_f32(a, b))
        most_shared_f32 =
            std::max<std::size_t>(most_shared_f32, shared_bytes_f32(a) + (same ? 0 : shared_bytes_f32(b)));
      else
        all_fit_f32 = false;
    }
  }

  const PairRef* pairs;
  const std::uint32_t* position;
  const Group* group_of_tile;
  std::size_t most_shared = 0;      ///< bytes for the hulls of any group
  std::size_t most_shared_f32 = 0;  ///< the same over groups that float32 fits; 0 if there is none
  bool all_fit_f32 = true;

 private:
  Upload memory_;
};

class CudaTable final : public ResidentTable {
 public:
  CudaTable(MemoryCounters& counters, const PairTable& table) : memory_(counters) {
    const PairTable::Arrays a = table.arrays();
    memory_.add(a.is_static, view.is_static);
    memory_.add(a.movable_before, view.movable_before);
    memory_.add(a.row_begin, view.row_begin);
    memory_.add(a.excluded_begin, view.excluded_begin);
    memory_.add(a.excluded, view.excluded);
    memory_.send(nullptr);
    check(cudaStreamSynchronize(nullptr), "copying a table of pairs to the device");
    memory_.forget_host();
  }

  TableView view;

 private:
  Upload memory_;
};

}  // namespace clearance::cuda
