// What host and device share: how a query's hulls, poses, pairs and answers lie in device memory.
#pragma once

#include <cstdint>

#include "engine/base/placement_error.h"
#include "engine/evaluate/joint_gradient_step.h"
#include "engine/hull/box.h"
#include "engine/narrow/certify.h"
#include "engine/pose/placed.h"
#include "engine/robot/kinematics_step.h"
#include "engine/selection/columns.h"
#include "engine/uncertainty/uncertainty_step.h"

namespace clearance::cuda {

/// A piece as the device knows it; its vertices are [first, first + count) of the scene's coordinate arrays.
struct HullHead : HullExtents {
  double f32_size;  ///< spread + radius, for fits_f32(); infinite: float32 is not tried
  std::uint32_t first, count;
  /// Its direction table, narrowed to 16 bits: cells, then lists, from word `first_word` on. No words: no table.
  std::uint32_t first_word, words, cell_words, grid_bits;
};

/// Bytes of a hull in a block's shared memory: table, then vertices. Every part begins on 16 bytes.
CLEARANCE_HD inline std::uint32_t shared_bytes(const HullHead& h) {
  return (h.words + 7) / 8 * 16 + h.count * 16 + (h.count + 1) / 2 * 16;
}

/// The same where float32 goes first: the vertices in float32 follow, four numbers each.
CLEARANCE_HD inline std::uint32_t shared_bytes_f32(const HullHead& h) {
  return shared_bytes(h) + h.count * 16;
}
/// Whether float32 can be tried on two hulls: fits_f32() of their pieces.
CLEARANCE_HD inline bool fit_f32(const HullHead& a, const HullHead& b) {
  return sizes_fit_f32(a.f32_size, b.f32_size);
}

/// In place of a hull's index: the body has several pieces.
inline constexpr std::uint32_t kSeveral = kNone - 1;

/// All hulls of the scene, in device memory.
struct HullsView {
  const HullHead* heads;
  const double *x, *y, *z;
  const float* f32;            ///< (vertices, 4) relative to the hull's centre; the fourth is of no use
  const std::uint16_t* words;  ///< of all tables, each from a multiple of 8 on
  const std::uint32_t*
      of_body;  ///< (bodies,) index of the body's hull; kSeveral: it has several; kNone: not on the device
  const std::uint32_t* piece_begin;  ///< (bodies + 1,) of each body's pieces; none where it is not on the device
  const std::uint32_t* piece_hull;   ///< (pieces,) index of the hull
};

/// A node of a tree of elements, as Surface has it: the tree is copied to the device as it is.
struct alignas(16) ElementNode {
  float low_x, low_y, low_z, high_x, high_y, high_z;
  std::uint32_t right, few;
};
/// The planes of a mesh's node: Surface::Slab.
struct alignas(16) ElementSlab {
  float low, high;
  std::int16_t units[3];
  CLEARANCE_HD Vec3d normal() const { return 0x1p-14 * Vec3d{double(units[0]), double(units[1]), double(units[2])}; }
};
/// The elements of a body, in device memory, in the order of the leaves: points, voxels or a mesh's triangles. Of a
/// body whose pairs are all the CPU's there is nothing but the hull.
struct ElementSet {
  HullExtents hull;          ///< around all of them; they are grown by its radius
  Vec3d centre;              ///< of the nodes' corners
  const ElementNode* nodes;  ///< the root is the first
  const float* points;       ///< (points, 3)
  double half;               ///< of the boxes' edges; 0: points
  double reach;  ///< along each axis from its point, no corner of a box is farther: `half`, as it is rounded
  const ElementSlab* slabs;    ///< of a mesh's nodes
  const double* corners;       ///< (triangles, 3 axes, 3 corners) of a mesh; null: it is none
  const std::uint32_t* parts;  ///< of a mesh: a triangle of each part that hangs together
  std::uint32_t part_count;
  std::uint32_t body;
  bool is_solid;  ///< what the triangles wind around belongs to it
  bool is_empty;  ///< a cloud without points, which is farther than all from everything

  CLEARANCE_HD bool is_mesh() const { return corners != nullptr; }
  CLEARANCE_HD bool is_there() const { return nodes != nullptr; }
};
/// Which kinds of pairs with elements there are for a device to look at.
struct ElementKinds {
  bool points_and_hull = false, mesh_and_hull = false, meshes = false;
};
/// Bodies of elements in a query's pairs.
struct ElementsView {
  const ElementSet* sets;
  const std::uint32_t*
      of_body;          ///< (bodies,) which set; kNone: it has a hull, or is not asked for; null: there are none
  std::uint32_t count;  ///< sets
  ElementKinds kinds;
};

/// A body in a pair: its id, or kMovedBit and its place among the bodies that the query moves.
inline constexpr std::uint32_t kMovedBit = 1u << 31;
struct PairRef {
  std::uint32_t a, b;
};

/// Pairs of the same two hulls, side by side in the list of pairs. Their pair-configurations are dealt to blocks in
/// tiles: item i is pair i / configurations in configuration i % configurations, so that neighbouring threads read
/// neighbouring poses.
struct Group {
  std::uint32_t hull_a, hull_b;  ///< kNone: each pair has hulls of its own
  std::uint32_t first, count;    ///< pairs
  std::uint32_t first_tile;
};
inline constexpr std::uint32_t kTile = 128;  ///< pair-configurations of one block

/// Placed bodies, one component after another (R_wb by rows, t_w, box low, box high), so that neighbouring threads read
/// neighbouring numbers: component c of the body at `index` is at c * stride + index.
inline constexpr std::uint32_t kPoseComponents = 12, kBoxComponents = 6;
/// A body's state: its Status in the low bits, then these.
inline constexpr std::uint8_t kStateStatus = 15, kStateRenormalised = 16, kStateBeyondLimits = 64;

/// A body's box rounded outward to float32, for tests that may be loose; low > high: the body has no usable pose.
struct alignas(16) OuterBox {
  float low_x, low_y, low_z, high_x, high_y, high_z, unused[2];
};

/// What is not known of a body where it stands: its PoseUncertainty, as pairs need it.
struct BodySlack {
  Slack all, beside;
  double travel = 0;  ///< of its robot's joints
};
/// Where a link is in the table of its robot's pairs.
struct LinkPlace {
  std::uint32_t robot = kNone;  ///< kNone: it is no link, or its robot has no table
  std::uint32_t slot = 0;
  std::uint64_t first_pair = 0;  ///< of the robot's, in UncertaintyView::link_pairs
};
struct UncertaintyView {
  const BodySlack* fixed;           ///< (bodies,) where the snapshot has them; null: nothing is doubted of any
  BodySlack* moved;                 ///< (moved, configurations)
  const LinkPlace* links;           ///< (bodies,)
  const LinkPairError* link_pairs;  ///< of all robots
};

struct BodiesView {
  const double* fixed;              ///< (components, bodies) where the snapshot has them
  const std::uint8_t* fixed_state;  ///< (bodies,)
  const OuterBox* fixed_box;        ///< (bodies,); null where boxes are not wanted
  std::uint32_t bodies;
  OuterBox* moved_box;              ///< (configurations, moved)
  double* moved;                    ///< (moved, components, configurations) where the query has them
  std::uint8_t* moved_state;        ///< (moved, configurations)
  const std::uint32_t* moved_body;  ///< (moved,) ids
  std::uint32_t moved_count;
  std::uint32_t components;  ///< of each body: with or without boxes
  // Boxes of pieces: low, high. Null where no body has several.
  double* fixed_piece_box;                 ///< (pieces, 6) where the snapshot has them
  double* moved_piece_box;                 ///< (pieces of the moved, 6, configurations)
  const std::uint32_t* moved_piece_begin;  ///< (moved,)
  UncertaintyView uncertainties;
};

/// A column of a robot of which joints move.
struct JointColumn {
  double position;        ///< where it stays; 0 if there is none that can be used
  double lower, upper;    ///< limits
  std::uint32_t at;       ///< its place in a row of positions; kNone: it stays
  std::uint8_t fact = 0;  ///< LinkFact bits of one that stays
};
/// A robot of which joints move. Its frames lie side by side: its roots, then one for each step.
struct JointRobot {
  std::uint32_t first_step, steps, first_column, roots, first_frame;
};
/// How the links of robots get their poses, each in the frame of its root: LinkMotion, as kernels know it.
struct FramesView {
  const KinematicStep* steps;
  const JointColumn* columns;
  const JointRobot* robots;
  std::uint32_t robot_count, joints;
  const double* positions;  ///< (configurations, joints)
  double* numbers;          ///< (frames, 7, configurations) qw, qx, qy, qz, x, y, z
  std::uint8_t* facts;      ///< (frames, configurations) LinkFact bits
  double* travels;          ///< not used
};

/// What a moved body adds to what is doubted of what it follows.
struct UncertaintyStep {
  UncertaintySource source;
  double age_s = 0;
  double joint_fixed = 0, joint_per_travel = 0, joint_turn = 0;  ///< PlacementError of a link's pose; 0: it is none
  double travel = 0;                                             ///< where the query's joints do not say it
  std::uint32_t robot = kNone;                                   ///< in FramesView; kNone: the travel is `travel`
};
/// Facts about a moved body that its poses do not change, as bits: it has no pose, or one that is too old; a joint that
/// the query leaves as it is, and that places it, is beyond its limits.
inline constexpr std::uint8_t kSlotUnplaced = 1, kSlotStale = 2, kSlotBeyondLimits = 4;

/// How the moved bodies get their poses. Each follows a chain of moved bodies, from the top down to itself, under a
/// body that stays (or the world).
struct MovesView {
  const Pose* given;  ///< (configurations, given_count)
  std::uint32_t given_count;
  const std::uint32_t* source;       ///< (moved,) which of the given poses, or given_count and a frame; kNone: `own`
  const Pose* own;                   ///< (moved,) where the query gives none
  const std::uint32_t* chain_begin;  ///< (moved + 1,)
  const std::uint32_t* chain;        ///< places among the moved
  const BodyPlacement* base;         ///< (moved,) the body that the chain's top follows
  const std::uint8_t* has_base;      ///< (moved,)
  const std::uint8_t* slot_state;    ///< (moved,) kSlotUnplaced and so on
  FramesView frames;
  // Where something is doubted:
  const UncertaintyStep* uncertainties;       ///< (moved,)
  const PlacedUncertainty* base_uncertainty;  ///< (moved,) of `base`
};

/// What the column gradient_joints needs.
struct MoversView {
  const JointMover* movers;      ///< `link` and `carrier` as in PairRef
  const std::uint32_t* of_body;  ///< (bodies,) the nearest that carries it, or kNone
};

/// What is asked of every pair.
struct PairLimits {
  double max_distance, abs_tol, rel_tol;
  std::int32_t max_iterations;
  bool cull;  ///< compare boxes with max_distance first
  bool want_points;
  bool want_nonsmooth;
  bool prove_overlaps;  ///< no depth is asked for
  bool prove_depths;    ///< a depth is, and the device finds it where it can
  bool f32;             ///< float32 goes first where it fits
};

/// Where the last query's run of GJK ended for a row, to begin there (WarmSimplex). Hulls have at most 2^16 vertices
/// here.
struct alignas(16) WarmRow {
  std::uint16_t a[3], b[3], size, unused;
};

/// A pair whose simplex holds the origin: its four vertices of each hull.
struct Enclosed {
  std::uint32_t pair, configuration;  ///< within the chunk
  std::uint16_t a[4], b[4];
};

/// A pair that float32 has left open.
struct LeftOpen {
  std::uint32_t pair, configuration;  ///< within the chunk
};

/// Places in ChunkView::counts: rows left to the CPU; rows that the narrow phase settled; enclosed pairs; of reduced
/// queries pairs that are looked at, and rows that come back.
/// And blocks that are done, of chunks whose last block hands the counts over; pairs that float32 has left open; of
/// reduced queries those of the pairs that are looked at of which a body has several pieces.
/// kPointsTaken, kTrianglesTaken and kMeshesTaken (of reduced queries, which leave kLeftOpen alone): how many of the
/// pairs that are looked at were taken by who looks at these kinds of pairs. kCounts is even: what follows the counts
/// may have 8 bytes.
inline constexpr std::uint32_t kRest = 0, kConvergedRows = 1, kEnclosedPairs = 2, kCandidates = 3, kHits = 4,
                               kBlocksDone = 5, kLeftOpen = 6, kPointsTaken = 6, kSeveralPairs = 7, kTrianglesTaken = 8,
                               kMeshesTaken = 9, kCounts = 10;

/// What a dense chunk's last kernel leaves in host memory once its rows and counts are there.
struct Finished {
  std::uint64_t begun, ended;  ///< when the chunk's kernels did, in the device's nanoseconds
  std::uint32_t number;        ///< ChunkView::number, written last
};

/// One launch: some pairs in some configurations.
struct ChunkView {
  HullsView hulls;
  BodiesView bodies;
  PairLimits pair_limits;
  const Group* group_of_tile;
  const PairRef* pairs;
  const std::uint32_t* position;  ///< of each pair within the chunk
  std::uint32_t pair_count;       ///< rows of one configuration
  std::uint32_t configurations;
  std::uint64_t first_configuration;
  MoversView movers;           ///< where the reply has gradient_joints
  ReplyView reply;             ///< device columns: row k * pair_count + position
  std::uint32_t* rest;         ///< rows that are not settled, in no order
  Enclosed* enclosed;          ///< in no order
  LeftOpen* left_open;         ///< in no order
  std::uint32_t* counts;       ///< kRest and so on
  WarmRow* warm;               ///< of the first row; null: every pair begins cold
  std::uint64_t warm_stride;   ///< rows of the query's configurations
  bool prove_at_once;          ///< enclosed pairs are proved by who finds them, not by a kernel of their own
  std::uint32_t* host_counts;  ///< where the last of `blocks` writes the counts and clears them; null: nobody does
  std::uint32_t blocks;
  std::uint64_t* begun;  ///< when the first kernel began, in the device's nanoseconds; 0: it has not; null: nobody asks
  Finished* finished;    ///< with `begun`: written after the counts
  std::uint32_t number;  ///< not 0: the host waits for it in `finished`
};

/// engine/state/pair_table.h in device memory: PairTable::Arrays.
struct TableView {
  const std::uint8_t* is_static;
  const std::uint32_t* movable_before;
  const std::uint64_t* row_begin;
  const std::uint32_t *excluded_begin, *excluded;
};

inline constexpr std::uint32_t kNoPair = ~0u;  ///< all bits set, as device memory is cleared

/// One launch of a reduced query (engine/reduce/reduction.h): its groups are bodies in each configuration, or
/// configurations. Keys are what atomicMin() orders as their meaning; all bits set: there is none yet.
struct ReducedView {
  ChunkView chunk;  ///< pairs in the query's order; `rest` holds items, `reply` is host memory
  Reduce reduce;
  std::uint32_t groups;   ///< of one configuration
  std::uint32_t rows;     ///< configurations * pairs
  std::uint64_t* seed;    ///< (configurations, groups) gap of outer boxes and pair: the least
  std::uint64_t* cutoff;  ///< (configurations, groups) a distance, float64: pairs with boxes farther apart are left out
  std::uint64_t *upper, *lower;  ///< (configurations, groups) least bounds, order_key()
  std::uint64_t* winner;         ///< (configurations, groups) pair and item
  std::uint64_t* lowest;         ///< (configurations, groups) the first pair with the least lower bound, and its item
  std::uint32_t* unusable;       ///< (configurations, groups) the first pair without usable poses, or kNoPair
  std::uint8_t* answered;        ///< (configurations, groups) nonzero: its row is written already; null: none is
  std::uint32_t *candidate_words, *hit_words;  ///< of Reduce::kWithin: a bit for each row
  std::uint32_t *candidate_ranks,
      *hit_ranks;            ///< how many bits are set before each word; null: they are few, and counted
  std::uint32_t* items;      ///< (capacity,) rows of the pairs that are looked at
  PairAnswer* answers;       ///< (capacity,)
  std::uint32_t* rest_rows;  ///< rows of chunk.rest
  std::uint32_t* several;    ///< (capacity,) places in the list of pairs of which a body has several pieces
  std::uint32_t capacity = 0;
  std::uint64_t reply_rows;  ///< room in the reply
  // Of Reduce::kAny. There `winner` is the first pair within its margin, `lowest` the first that is proved neither
  // farther nor within, both with their items, and `seed` the first without usable poses.
  const double* margins;  ///< (pairs,) metres; null: each has `margin`
  double margin;
  PairAnswer beyond;  ///< of a configuration whose pairs are all farther
  // Of a whole table within a distance. Places in the list of pairs that are looked at stand for rows everywhere else.
  TableView table;
  std::uint64_t *found,
      *keys;  ///< (capacity,) a << key_bits | b: in no order, in order; null: rows are listed in `items`
  std::uint32_t key_bits;
  ElementsView elements;
};

}  // namespace clearance::cuda
