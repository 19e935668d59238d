// What stays in device memory between queries: the scene's hulls, and lists of pairs.
#pragma once

#include <algorithm>
#include <limits>
#include <unordered_map>
#include <vector>

#include "device.h"
#include "engine/direction_table.h"
#include "engine/pair_table.h"
#include "engine/scene.h"
#include "memory.cuh"
#include "pair_kernel.cuh"

namespace clearance::cuda {

inline constexpr std::size_t kMostVertices = 1u << 16;     // that 16 bits can name
inline constexpr std::size_t kMostSharedVertices = 512;           // of a hull in shared memory; larger ones are read where the scene has them
inline constexpr std::size_t kTableVertices = 16;  // fewer are scanned as fast
inline constexpr std::size_t kFewVertices = 4;     // of a list of a table that is not worth dividing further
inline constexpr std::uint32_t kFinerGrid = 1;     // than the CPU's: a list is found in fewer steps
inline constexpr std::uint32_t kNarrowDivided = 1u << 15;  // DirectionTable::kDivided in 16 bits

// The scene's hulls in device memory.
class ResidentHulls {
 public:
  /// On the calling thread's device. \param most_shared bytes that two hulls may take of a block's shared memory.
  ResidentHulls(const Scene& scene, int most_shared, MemoryCounters& counters)
      : most_shared_(static_cast<std::uint32_t>(most_shared)), memory_(counters) {
    check(cudaGetDevice(&device_), "asking for the device");
    HullArrays arrays;
    std::vector<std::uint32_t> piece_hull, hulls;
    std::unordered_map<const Piece*, std::uint32_t> index;
    piece_begin_.push_back(0);
    for (const Body& body : scene.bodies()) {
      hulls.clear();
      for (const PiecePtr& piece : body.pieces) {
        const auto [at, is_new] = index.try_emplace(piece.get(), kNone);
        if (is_new) at->second = add_hull(*piece, arrays);
        if (at->second == kNone) break;
        hulls.push_back(at->second);
      }
      const bool is_held = hulls.size() == body.pieces.size();
      of_body_.push_back(!is_held ? kNone : hulls.size() == 1 ? hulls[0] : kSeveral);
      if (is_held) piece_hull.insert(piece_hull.end(), hulls.begin(), hulls.end());
      piece_begin_.push_back(static_cast<std::uint32_t>(piece_hull.size()));
      has_several_ = has_several_ || of_body_.back() == kSeveral;
    }
    heads_ = arrays.heads;
    Upload& m = memory_;
    const std::size_t at_heads = m.add<HullHead>(arrays.heads), at_x = m.add<double>(arrays.x), at_y = m.add<double>(arrays.y),
                      at_z = m.add<double>(arrays.z), at_f32 = m.add<float>(arrays.f32),
                      at_words = m.add<std::uint16_t>(arrays.words), at_of = m.add<std::uint32_t>(of_body_),
                      at_begin = m.add<std::uint32_t>(piece_begin_), at_pieces = m.add<std::uint32_t>(piece_hull);
    m.send(nullptr);
    check(cudaStreamSynchronize(nullptr), "copying the scene to the device");
    m.forget_host();
    view_ = {m.at<HullHead>(at_heads),      m.at<double>(at_x),        m.at<double>(at_y), m.at<double>(at_z), m.at<float>(at_f32),
             m.at<std::uint16_t>(at_words), m.at<std::uint32_t>(at_of), m.at<std::uint32_t>(at_begin),
             m.at<std::uint32_t>(at_pieces)};
  }
  const HullsView& view() const { return view_; }
  int device() const { return device_; }  ///< its number
  std::uint32_t of_body(std::uint32_t body) const { return of_body_[body]; }
  const HullHead& head(std::uint32_t hull) const { return heads_[hull]; }
  bool is_shared(std::uint32_t hull) const { return heads_[hull].count <= kMostSharedVertices; }
  bool has_several() const { return has_several_; }  ///< whether a body here has several pieces
  std::size_t pieces() const { return piece_begin_.back(); }  ///< of all bodies here
  std::uint32_t pieces_of(std::uint32_t body) const { return piece_begin_[body + 1] - piece_begin_[body]; }

 private:
  struct HullArrays {
    std::vector<HullHead> heads;
    std::vector<double> x, y, z;
    std::vector<float> f32;
    std::vector<std::uint16_t> words;
  };

  // Its index; kNone: the device cannot hold it.
  std::uint32_t add_hull(const Piece& p, HullArrays& arrays) const {
    if (p.vertices.size() > kMostVertices) return kNone;
    HullHead head{p.centre,
                  p.half,
                  p.rho,
                  p.radius,
                  p.spread,
                  p.table ? std::numeric_limits<double>::infinity() : p.spread + p.radius,
                  static_cast<std::uint32_t>(arrays.x.size()),
                  static_cast<std::uint32_t>(p.vertices.size()),
                  0,
                  0,
                  0,
                  0};
    if (p.vertices.size() <= kMostSharedVertices)
      add_table(p, head, arrays.words);
    else if (!add_large_table(p, head, arrays.words))
      return kNone;
    for (const Vec3d& v : p.vertices) {
      arrays.x.push_back(v.x);
      arrays.y.push_back(v.y);
      arrays.z.push_back(v.z);
      for (int i = 0; i < 3; ++i) arrays.f32.push_back(static_cast<float>(v[i] - p.centre[i]));
      arrays.f32.push_back(0);
    }
    arrays.heads.push_back(head);
    return static_cast<std::uint32_t>(arrays.heads.size() - 1);
  }
  // Finer than the CPU's: threads that run side by side wait for the longest list. A table that leaves no room for
  // another hull is left out.
  void add_table(const Piece& p, HullHead& head, std::vector<std::uint16_t>& words) const {
    if (p.vertices.size() < kTableVertices) return;
    const DirectionTable table = make_direction_table(p.vertices, p.rho, {kFewVertices, kFinerGrid, float_blur(p.spread)});
    if (!is_narrow(table)) return;
    HullHead with_table = head;
    with_table.words = static_cast<std::uint32_t>(table.cells.size() + table.lists.size());
    if (2 * (p.table ? shared_bytes(with_table) : shared_bytes_f32(with_table)) <= most_shared_) put_table(table, head, words);
  }
  // The finest of a few that 16 bits can index. False: none, and vertex by vertex the device would be slower than the CPU.
  static bool add_large_table(const Piece& p, HullHead& head, std::vector<std::uint16_t>& words) {
    for (const auto& [few, finer] : {std::pair{kFewVertices, kFinerGrid}, {std::size_t{6}, 0u}, {std::size_t{16}, 0u}, {std::size_t{40}, 0u}}) {
      const DirectionTable table = make_direction_table(p.vertices, p.rho, {few, finer, float_blur(p.spread)});
      if (!is_narrow(table)) continue;
      put_table(table, head, words);
      return true;
    }
    return false;
  }
  static bool is_narrow(const DirectionTable& table) { return std::max(table.cells.size(), table.lists.size()) < kNarrowDivided; }
  static void put_table(const DirectionTable& table, HullHead& head, std::vector<std::uint16_t>& words) {
    words.resize((words.size() + 7) / 8 * 8);
    head.first_word = static_cast<std::uint32_t>(words.size());
    head.grid_bits = table.grid_bits;
    head.cell_words = static_cast<std::uint32_t>(table.cells.size());
    head.words = static_cast<std::uint32_t>(table.cells.size() + table.lists.size());
    for (const std::uint32_t cell : table.cells)
      words.push_back(static_cast<std::uint16_t>(cell & DirectionTable::kDivided ? kNarrowDivided | cell : cell));
    words.insert(words.end(), table.lists.begin(), table.lists.end());
    words.resize((words.size() + 7) / 8 * 8);
  }

  int device_ = 0;
  std::uint32_t most_shared_;
  Upload memory_;
  std::vector<std::uint32_t> of_body_, piece_begin_;
  std::vector<HullHead> heads_;
  bool has_several_ = false;
  HullsView view_;
};

class CudaPairs final : public ResidentPairs {
 public:
  CudaPairs(const ResidentHulls& hulls, MemoryCounters& counters, std::span<const PairRef> p,
            std::span<const std::uint32_t> at, std::span<const Group> tiles)
      : memory_(counters) {
    const std::size_t at_pairs = memory_.add(p), at_position = memory_.add(at), at_tiles = memory_.add(tiles);
    memory_.send(nullptr);
    check(cudaStreamSynchronize(nullptr), "copying pairs to the device");
    memory_.forget_host();
    pairs = memory_.at<PairRef>(at_pairs);
    position = memory_.at<std::uint32_t>(at_position);
    group_of_tile = memory_.at<Group>(at_tiles);
    for (const Group& group : tiles) {
      const HullHead &a = hulls.head(group.hull_a), &b = hulls.head(group.hull_b);
      const bool same = group.hull_a == group.hull_b;
      most_shared = std::max<std::size_t>(most_shared, shared_bytes(a) + (same ? 0 : shared_bytes(b)));
      if (fit_f32(a, b))
        most_shared_f32 = std::max<std::size_t>(most_shared_f32, shared_bytes_f32(a) + (same ? 0 : shared_bytes_f32(b)));
      else
        all_fit_f32 = false;
    }
  }

  const PairRef* pairs;
  const std::uint32_t* position;
  const Group* group_of_tile;
  std::size_t most_shared = 0;      ///< bytes for the hulls of any group
  std::size_t most_shared_f32 = 0;  ///< for those of any that float32 fits; 0: there is none
  bool all_fit_f32 = true;

 private:
  Upload memory_;
};

class CudaTable final : public ResidentTable {
 public:
  CudaTable(MemoryCounters& counters, const PairTable& table) : memory_(counters) {
    const PairTable::Arrays a = table.arrays();
    const std::size_t at_static = memory_.add(a.is_static), at_movable = memory_.add(a.movable_before),
                      at_rows = memory_.add(a.row_begin), at_begin = memory_.add(a.excluded_begin),
                      at_excluded = memory_.add(a.excluded);
    memory_.send(nullptr);
    check(cudaStreamSynchronize(nullptr), "copying a table of pairs to the device");
    memory_.forget_host();
    view = {memory_.at<std::uint8_t>(at_static), memory_.at<std::uint32_t>(at_movable), memory_.at<std::uint64_t>(at_rows),
            memory_.at<std::uint32_t>(at_begin), memory_.at<std::uint32_t>(at_excluded)};
  }

  TableView view;

 private:
  Upload memory_;
};

class CudaWarm final : public ResidentWarm {
 public:
  CudaWarm(MemoryCounters& counters, std::uint64_t rows) : memory_(counters) {
    const std::size_t bytes = rows * sizeof(WarmRow);
    check(cudaMemset(memory_.reserve(bytes), 0, bytes), "clearing warm state");
    check(cudaDeviceSynchronize(), "clearing warm state");  // queries run in streams that do not wait for others
  }
  WarmRow* rows() { return reinterpret_cast<WarmRow*>(memory_.data()); }

 private:
  DeviceBuffer memory_;
};

}  // namespace clearance::cuda
