// Data layout of reduced queries, shared by host and device: clouds and meshes, the table of pairs, groups and candidates.
#pragma once

#include "engine/device/layout.h"

namespace clearance::cuda {

/// Node of an element tree, copied verbatim from Surface.
struct alignas(16) ElementNode {
  float low_x, low_y, low_z, high_x, high_y, high_z;
  std::uint32_t right, few;
};
/// Bounding planes of a mesh's node: Surface::Slab.
struct alignas(16) ElementSlab {
  float low, high;
  std::int16_t units[3];
  CLEARANCE_HD Vec3d normal() const { return 0x1p-14 * Vec3d{double(units[0]), double(units[1]), double(units[2])}; }
};
/// Elements of a body in device memory, in leaf order: points, voxels or triangles. If the CPU answers all pairs of the
/// body, only the hull is set.
struct ElementSet {
  HullExtents hull;            ///< around all elements; each is grown by the hull's radius
  Vec3d centre;                ///< origin of the node corners
  const ElementNode* nodes;    ///< root first
  const float* points;         ///< (points, 3)
  double half;                 ///< half edge length of the voxels; 0 for points
  double reach;                ///< bound on a voxel corner's offset along each axis: `half` with its rounding
  const ElementSlab* slabs;    ///< of a mesh's nodes
  const double* corners;       ///< (triangles, 3 axes, 3 corners) of a mesh; null for others
  const std::uint32_t* parts;  ///< of a mesh: one triangle of each connected component
  std::uint32_t part_count;
  std::uint32_t body;
  bool is_solid;  ///< the region that the triangles wind around belongs to the body
  bool is_empty;  ///< a cloud without points, infinitely far from everything

  CLEARANCE_HD bool is_mesh() const { return corners != nullptr; }
  CLEARANCE_HD bool is_there() const { return nodes != nullptr; }
};
/// Kinds of element pairs that a device has to answer.
struct ElementKinds {
  bool points_and_hull = false, mesh_and_hull = false, meshes = false;
};
/// Bodies with elements in a query's pairs.
struct ElementsView {
  const ElementSet* sets;
  const std::uint32_t* of_body;  ///< (bodies,) index of the set; kNone: a hull, or not in the query; null if no sets
  std::uint32_t count;           ///< number of sets
  ElementKinds kinds;
};

/// engine/state/pair_table.h in device memory: PairTable::Arrays.
struct TableView {
  const std::uint8_t* is_static;
  const std::uint32_t* movable_before;
  const std::uint64_t* row_begin;
  const std::uint32_t *excluded_begin, *excluded;
};

inline constexpr std::uint32_t kNoPair = ~0u;  ///< all bits set, the value of cleared device memory

/// One launch of a reduced query (engine/reduce/reduction.h). Its groups are the bodies of each configuration, or the
/// configurations. Keys keep the order of their values under atomicMin(); all bits set means no key yet.
struct ReducedView {
  ChunkView chunk;  ///< pairs in query order; `rest` holds items, `reply` is host memory
  Reduce reduce;
  std::uint32_t groups;          ///< per configuration
  std::uint32_t rows;            ///< configurations * pairs
  std::uint64_t* seed;           ///< (configurations, groups) least pair of outer-box gap and pair index
  std::uint64_t* cutoff;         ///< (configurations, groups) float64; pairs with boxes farther apart are skipped
  std::uint64_t *upper, *lower;  ///< (configurations, groups) least bounds, order_key()
  std::uint64_t* winner;         ///< (configurations, groups) pair and item
  std::uint64_t* lowest;         ///< (configurations, groups) the first pair with the least lower bound, and its item
  std::uint32_t* unusable;       ///< (configurations, groups) the first pair without usable poses, or kNoPair
  std::uint8_t* answered;        ///< (configurations, groups) nonzero if the row is already written; null if no row is
  std::uint32_t *candidate_words, *hit_words;  ///< Reduce::kWithin: a bit per row
  std::uint32_t *candidate_ranks,
      *hit_ranks;             ///< number of set bits before each word; if null, they are few and are counted
  std::uint32_t* items;       ///< (capacity,) rows of the pairs to evaluate
  PairAnswer* answers;        ///< (capacity,)
  std::uint32_t* rest_rows;   ///< rows of chunk.rest
  std::uint32_t* later;       ///< (capacity,) list positions of pairs left to a later kernel, in no order
  std::uint32_t* unresolved;  ///< Reduce::kAny: (capacity,) list positions of pairs that no kernel resolves
  std::uint32_t capacity = 0;
  std::uint64_t reply_rows;  ///< capacity of the reply
  // Reduce::kAny: `winner` is the first pair within its margin and `lowest` the first pair proved neither beyond nor
  // within it, both with their items. `upper` is the first pair that is probably within its margin, with its item.
  // The pairs of chunk.enclosed are list positions.
  const double* margins;  ///< (pairs,) metres; if null, all pairs have `margin`
  double margin;
  PairAnswer beyond;  ///< row of a configuration whose pairs are all beyond their margins
  // Whole table within a distance: positions in the list of candidates replace rows everywhere else.
  TableView table;
  std::uint64_t *found,
      *keys;  ///< (capacity,) a << key_bits | b, unsorted and sorted; if null, rows are listed in `items`
  std::uint32_t key_bits;
  ElementsView elements;
};

}  // namespace clearance::cuda
