// A scene's hulls in the layout of device memory, built on the host.
#pragma once

#include <algorithm>
#include <limits>
#include <unordered_map>
#include <unordered_set>
#include <utility>
#include <vector>

#include "engine/device/layout.h"
#include "engine/hull/direction_table.h"
#include "engine/scene/scene.h"

namespace clearance::cuda {

inline constexpr std::size_t kMostVertices = 1u << 16;  // limit of 16-bit indices
inline constexpr std::size_t kMostSharedVertices =
    512;  // of a hull in shared memory; larger ones are read from global memory
inline constexpr std::size_t kTableVertices = 16;          // smaller hulls are scanned as fast without a table
inline constexpr std::size_t kFewVertices = 4;             // lists of a table are not divided below this size
inline constexpr std::uint32_t kFinerGrid = 1;             // finer than the CPU's grid: a list is found in fewer steps
inline constexpr std::uint32_t kNarrowDivided = 1u << 15;  // DirectionTable::kDivided in 16 bits

/// The hulls of a scene that a device holds, from which a changed scene begins. Keeps their parts, whose addresses are
/// the keys.
struct HeldHulls {
  std::unordered_map<ConvexPartPtr, std::uint32_t> index;  ///< of parts on the device
  std::vector<HullHead> heads;
  std::size_t vertices = 0, words = 0;  ///< in the device's arrays

  /// Whether a scene uses at least half of the vertices, so that the arrays of removed bodies cannot accumulate.
  bool suits(const engine::Scene& scene) const {
    std::unordered_set<std::uint32_t> used;
    std::size_t count = 0;
    for (const Body& body : scene.bodies())
      for (const ConvexPartPtr& part : body.parts)
        if (const auto at = index.find(part);
            at != index.end() && at->second != kNone && used.insert(at->second).second)
          count += heads[at->second].count;
    return 2 * count >= vertices;
  }
};

/// The arrays of a HullsView, without the vertices and words that the device holds already.
class HullArrays {
 public:
  std::vector<HullHead> heads;
  std::vector<double> x, y, z;
  std::vector<float> f32;
  std::vector<std::uint16_t> words;
  std::vector<std::uint32_t> of_body, part_begin{0}, part_hull;

  /// \param most_shared bytes of a block's shared memory that two hulls may use
  /// \param held of the scene before a change, with the same `most_shared`; all its vertices and words precede those of
  /// the arrays
  HullArrays(const engine::Scene& scene, std::uint32_t most_shared, const HeldHulls& held = {})
      : heads(held.heads),
        most_shared_(most_shared),
        held_vertices_(held.vertices),
        held_words_(held.words),
        index_(held.index) {
    std::vector<std::uint32_t> hulls;
    for (const Body& body : scene.bodies()) {
      hulls.clear();
      for (const ConvexPartPtr& part : body.parts) {
        const auto [at, is_new] = index_.try_emplace(part, kNone);
        if (is_new) at->second = add_hull(*part);
        if (at->second == kNone || is_cloud(body)) break;
        hulls.push_back(at->second);
      }
      const bool is_held = hulls.size() == body.parts.size();
      of_body.push_back(!is_held ? kNone : hulls.size() == 1 ? hulls[0] : kSeveral);
      if (is_held) part_hull.insert(part_hull.end(), hulls.begin(), hulls.end());
      part_begin.push_back(static_cast<std::uint32_t>(part_hull.size()));
    }
  }

  /// The hulls that the device holds with these arrays.
  HeldHulls held() const {
    HeldHulls all{index_, heads, held_vertices_ + x.size(), held_words_ + words.size()};
    std::erase_if(all.index, [](const auto& part) { return part.second == kNone; });
    return all;
  }

  /// The arrays in host memory, of a scene without held hulls.
  HullsView view() const {
    return {heads.data(), x.data(),       y.data(),          z.data(),        f32.data(),
            words.data(), of_body.data(), part_begin.data(), part_hull.data()};
  }

 private:
  // Returns the hull's index, or kNone if the device cannot hold it.
  std::uint32_t add_hull(const ConvexPart& p) {
    // Kernels support hulls alone: no triangles and no closed forms.
    if (p.surface || p.primitive || p.vertices.size() > kMostVertices) return kNone;
    HullHead head{p.extents(),
                  p.table ? std::numeric_limits<double>::infinity() : p.spread + p.radius,
                  static_cast<std::uint32_t>(held_vertices_ + x.size()),
                  static_cast<std::uint32_t>(p.vertices.size()),
                  0,
                  0,
                  0,
                  0};
    if (p.vertices.size() <= kMostSharedVertices)
      add_table(p, head);
    else if (!add_large_table(p, head))
      return kNone;
    for (const Vec3d& v : p.vertices) {
      x.push_back(v.x);
      y.push_back(v.y);
      z.push_back(v.z);
      for (int i = 0; i < 3; ++i) f32.push_back(static_cast<float>(v[i] - p.centre[i]));
      f32.push_back(0);
    }
    heads.push_back(head);
    return static_cast<std::uint32_t>(heads.size() - 1);
  }
  // Finer than the CPU's table, since the threads of a warp wait for the longest list. Omitted if it would leave too
  // little space for a second hull.
  void add_table(const ConvexPart& p, HullHead& head) {
    if (p.vertices.size() < kTableVertices) return;
    const DirectionTable table =
        make_direction_table(p.vertices, p.rho, {kFewVertices, kFinerGrid, float_blur(p.spread)});
    if (!is_narrow(table)) return;
    HullHead with_table = head;
    with_table.words = static_cast<std::uint32_t>(table.cells.size() + table.lists.size());
    if (2 * (p.table ? shared_bytes(with_table) : shared_bytes_f32(with_table)) <= most_shared_) put_table(table, head);
  }
  // Uses the finest of a few tables that 16 bits can index. Returns false if none fits: a scan of all vertices would be
  // slower than the CPU.
  bool add_large_table(const ConvexPart& p, HullHead& head) {
    for (const auto& [few, finer] :
         {std::pair{kFewVertices, kFinerGrid}, {std::size_t{6}, 0u}, {std::size_t{16}, 0u}, {std::size_t{40}, 0u}}) {
      const DirectionTable table = make_direction_table(p.vertices, p.rho, {few, finer, float_blur(p.spread)});
      if (!is_narrow(table)) continue;
      put_table(table, head);
      return true;
    }
    return false;
  }
  static bool is_narrow(const DirectionTable& table) {
    return std::max(table.cells.size(), table.lists.size()) < kNarrowDivided;
  }
  void put_table(const DirectionTable& table, HullHead& head) {
    words.resize((words.size() + 7) / 8 * 8);
    head.first_word = static_cast<std::uint32_t>(held_words_ + words.size());
    head.grid_bits = table.grid_bits;
    head.cell_words = static_cast<std::uint32_t>(table.cells.size());
    head.words = static_cast<std::uint32_t>(table.cells.size() + table.lists.size());
    for (const std::uint32_t cell : table.cells)
      words.push_back(static_cast<std::uint16_t>(cell & DirectionTable::kDivided ? kNarrowDivided | cell : cell));
    words.insert(words.end(), table.lists.begin(), table.lists.end());
    words.resize((words.size() + 7) / 8 * 8);
  }

  std::uint32_t most_shared_;
  std::size_t held_vertices_, held_words_;
  std::unordered_map<ConvexPartPtr, std::uint32_t> index_;
};

}  // namespace clearance::cuda
