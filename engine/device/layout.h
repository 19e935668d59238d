// Data layout shared by host and device: a query's hulls, poses, pairs and answers in device memory.
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

/// A convex part on the device. Its vertices are [first, first + count) of the scene's coordinate arrays.
struct HullHead : HullExtents {
  double f32_size;  ///< spread + radius, for fits_f32(); infinite disables float32
  std::uint32_t first, count;
  /// Its direction table, narrowed to 16 bits: cells, then lists, starting at `first_word`. `words` is 0 if it has
  /// none.
  std::uint32_t first_word, words, cell_words, grid_bits;
};

/// Bytes of a hull in a block's shared memory: table, then vertices. Each section is aligned to 16 bytes.
CLEARANCE_HD inline std::uint32_t shared_bytes(const HullHead& h) {
  return (h.words + 7) / 8 * 16 + h.count * 16 + (h.count + 1) / 2 * 16;
}

/// The same with float32 vertices appended (four numbers each), for queries that try float32 first.
CLEARANCE_HD inline std::uint32_t shared_bytes_f32(const HullHead& h) {
  return shared_bytes(h) + h.count * 16;
}
/// Whether float32 applies to two hulls: fits_f32() of their convex parts.
CLEARANCE_HD inline bool fit_f32(const HullHead& a, const HullHead& b) {
  return sizes_fit_f32(a.f32_size, b.f32_size);
}

/// Replaces a hull index if the body has several convex parts.
inline constexpr std::uint32_t kSeveral = kNone - 1;

/// All hulls of the scene, in device memory.
struct HullsView {
  const HullHead* heads;
  const double *x, *y, *z;
  const float* f32;                 ///< (vertices, 4) relative to the hull's centre; the fourth component is padding
  const std::uint16_t* words;       ///< of all tables, each aligned to a multiple of 8 words
  const std::uint32_t* of_body;     ///< (bodies,) index of the body's hull, kSeveral, or kNone if not on the device
  const std::uint32_t* part_begin;  ///< (bodies + 1,) first convex part of each body; empty range if not on the device
  const std::uint32_t* part_hull;   ///< (parts,) index of the hull
};

/// A body in a pair: its id, or kMovedBit and its index among the bodies that the query moves.
inline constexpr std::uint32_t kMovedBit = 1u << 31;
struct PairRef {
  std::uint32_t a, b;
};

/// Pairs of the same two hulls, consecutive in the list of pairs. Their pair-configurations are split into tiles, one
/// per block: item i is pair i / configurations in configuration i % configurations, so that neighbouring threads read
/// neighbouring poses.
struct Group {
  std::uint32_t hull_a, hull_b;  ///< kNone if each pair has hulls of its own
  std::uint32_t first, count;    ///< pairs
  std::uint32_t first_tile;
};
inline constexpr std::uint32_t kTile = 128;  ///< pair-configurations of one block

/// Placed bodies as component arrays (R_wb by rows, t_w, box low, box high), so that neighbouring threads read
/// neighbouring numbers. Component c of the body at `index` is at c * stride + index.
inline constexpr std::uint32_t kPoseComponents = 12, kBoxComponents = 6;
/// A body's state: its Status in the low bits, then these flags.
inline constexpr std::uint8_t kStateStatus = 15, kStateRenormalised = 16, kStateBeyondLimits = 64;

/// A body's box rounded outward to float32, for conservative tests. low > high if the body has no usable pose.
struct alignas(16) OuterBox {
  float low_x, low_y, low_z, high_x, high_y, high_z, unused[2];
};

/// PoseUncertainty of a placed body, in the form that pairs need.
struct BodySlack {
  Slack all, relative;
  double travel = 0;  ///< joint travel of its robot
};
/// Position of a link in its robot's table of pairs.
struct LinkPlace {
  std::uint32_t robot = kNone;  ///< kNone if the body is no link or its robot has no table
  std::uint32_t slot = 0;
  std::uint64_t first_pair = 0;  ///< the robot's first pair in UncertaintyView::link_pairs
};
struct UncertaintyView {
  const BodySlack* fixed;           ///< (bodies,) at the snapshot's poses; null if no body is uncertain
  BodySlack* moved;                 ///< (moved, configurations)
  const LinkPlace* links;           ///< (bodies,)
  const LinkPairError* link_pairs;  ///< of all robots
};

struct BodiesView {
  const double* fixed;              ///< (components, bodies) at the snapshot's poses
  const std::uint8_t* fixed_state;  ///< (bodies,)
  const OuterBox* fixed_box;        ///< (bodies,); null if boxes are not used
  std::uint32_t bodies;
  OuterBox* moved_box;              ///< (moved, configurations)
  double* moved;                    ///< (moved, components, configurations) at the query's poses
  std::uint8_t* moved_state;        ///< (moved, configurations)
  const std::uint32_t* moved_body;  ///< (moved,) ids
  std::uint32_t moved_count;
  std::uint32_t components;  ///< per body: with or without boxes
  // Boxes of convex parts: low, high. Null if no body has several.
  double* fixed_part_box;                 ///< (parts, 6) at the snapshot's poses
  double* moved_part_box;                 ///< (parts of the moved bodies, 6, configurations)
  const std::uint32_t* moved_part_begin;  ///< (moved,)
  UncertaintyView uncertainties;
};

/// A joint column of a robot with moving joints.
struct JointColumn {
  double position;        ///< value of a fixed joint; 0 if it has no usable one
  double lower, upper;    ///< limits
  std::uint32_t at;       ///< index in a row of positions; kNone if the joint is fixed
  std::uint8_t fact = 0;  ///< LinkFact bits of a fixed joint
};
/// A robot with moving joints. Its frames are consecutive: the roots, then one per step.
struct JointRobot {
  std::uint32_t first_step, steps, first_column, roots, first_frame;
};
/// Kinematics of robot links, each relative to its root frame: the device form of LinkMotion.
struct FramesView {
  const KinematicStep* steps;
  const JointColumn* columns;
  const JointRobot* robots;
  std::uint32_t robot_count, joints;
  const double* positions;  ///< (configurations, joints)
  double* numbers;          ///< (frames, 7, configurations) qw, qx, qy, qz, x, y, z
  std::uint8_t* facts;      ///< (frames, configurations) LinkFact bits
  double* travels;          ///< unused
};

/// Uncertainty that a moved body adds to that of its parent.
struct UncertaintyStep {
  UncertaintySource source;
  double age_s = 0;
  double joint_fixed = 0, joint_per_travel = 0, joint_turn = 0;  ///< PlacementError of a link's pose; 0 for others
  double travel = 0;                                             ///< used if the query does not set the robot's joints
  std::uint32_t robot = kNone;                                   ///< in FramesView; if kNone, `travel` is used
};
/// Pose-independent state bits of a moved body: no pose; pose too old; a fixed joint that places it is beyond its
/// limits.
inline constexpr std::uint8_t kSlotUnplaced = 1, kSlotStale = 2, kSlotBeyondLimits = 4;

/// Kinematics of the moved bodies. Each follows a chain of moved bodies, from the top down to itself, under a fixed
/// body or the world.
struct MovesView {
  const Pose* given;  ///< (configurations, given_count)
  std::uint32_t given_count;
  const std::uint32_t* source;       ///< (moved,) index of the given pose; given_count + frame; or kNone for `own`
  const Pose* own;                   ///< (moved,) pose if the query gives none
  const std::uint32_t* chain_begin;  ///< (moved + 1,)
  const std::uint32_t* chain;        ///< indices of moved bodies
  const BodyPlacement* base;         ///< (moved,) parent of the chain's top
  const std::uint8_t* has_base;      ///< (moved,)
  const std::uint8_t* slot_state;    ///< (moved,) kSlotUnplaced and the other slot bits
  FramesView frames;
  // If uncertain:
  const UncertaintyStep* uncertainties;       ///< (moved,)
  const PlacedUncertainty* base_uncertainty;  ///< (moved,) of `base`
  // Indices of the moved bodies whose poses are read, apart from those of motions. Others only carry them.
  const std::uint32_t* placed;
  std::uint32_t placed_count;
};

/// Input of the column gradient_joints.
struct MoversView {
  const JointMover* movers;      ///< `link` and `carrier` as in PairRef
  const std::uint32_t* of_body;  ///< (bodies,) nearest mover that carries the body, or kNone
};

/// Limits and options of a query that apply to every pair.
struct PairLimits {
  double max_distance, abs_tol, rel_tol;
  std::int32_t max_iterations;
  bool cull;  ///< compare boxes with max_distance first
  bool want_points;
  bool want_nonsmooth;
  bool prove_overlaps;  ///< no depth is requested
  bool prove_depths;    ///< depths are requested; the device computes them where it can
  bool f32;             ///< try float32 first where it fits
};

/// A pair whose simplex encloses the origin: four vertices of each hull, which has at most 2^16 vertices here.
struct Enclosed {
  std::uint32_t pair, configuration;  ///< within the chunk
  std::uint16_t a[4], b[4];
};

/// A pair that float32 could not resolve.
struct LeftOpen {
  std::uint32_t pair, configuration;  ///< within the chunk
};

/// Indices into ChunkView::counts.
/// - kRest: rows left to the CPU; kConvergedRows: rows resolved by the narrow phase; kEnclosedPairs
/// - kCandidates, kHits (reduced queries): pairs to evaluate; rows of the reply
/// - kBlocksDone: finished blocks, for chunks whose last block hands over the counts; kLeftOpen: pairs unresolved in
///   float32
/// - kLaterItems (reduced queries): candidates left to a later kernel
/// - kUnresolved (Reduce::kAny): candidates that no kernel resolves
/// - kPointsTaken, kTrianglesTaken, kMeshesTaken (reduced queries, which do not use kLeftOpen): candidates claimed by
///   the kernel of each element kind
/// kCounts is even, so that 8-byte values may follow the counts.
inline constexpr std::uint32_t kRest = 0, kConvergedRows = 1, kEnclosedPairs = 2, kCandidates = 3, kHits = 4,
                               kBlocksDone = 5, kLeftOpen = 6, kPointsTaken = 6, kLaterItems = 7, kTrianglesTaken = 8,
                               kMeshesTaken = 9, kUnresolved = 10, kCounts = 12;

/// Written to host memory by a dense chunk's last kernel, after its rows and counts.
struct Finished {
  std::uint64_t begun, ended;  ///< start and end of the chunk's kernels, in device nanoseconds
  std::uint32_t number;        ///< ChunkView::number, written last
};

/// One launch: a set of pairs in a set of configurations.
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
  MoversView movers;           ///< if the reply has gradient_joints
  ReplyView reply;             ///< device columns: row k * pair_count + position
  std::uint32_t* rest;         ///< unresolved rows, in no order
  Enclosed* enclosed;          ///< in no order
  LeftOpen* left_open;         ///< in no order
  std::uint32_t* counts;       ///< indexed by kRest and the others
  bool prove_at_once;          ///< enclosed pairs are proved by the thread that finds them, not by a separate kernel
  std::uint32_t* host_counts;  ///< the last of `blocks` blocks copies the counts here and clears them; unused if null
  std::uint32_t blocks;
  std::uint64_t* begun;  ///< start of the first kernel in device nanoseconds, 0 before; unused if null
  Finished* finished;    ///< requires `begun`; written after the counts
  std::uint32_t number;  ///< nonzero; the host waits for it in `finished`
};

}  // namespace clearance::cuda
