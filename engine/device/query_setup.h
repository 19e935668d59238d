// Arguments and results of a device's work on a query. Needs no CUDA headers.
#pragma once

#include <cstdint>
#include <functional>
#include <span>

#include "engine/device/reduced_layout.h"
#include "engine/narrow/answer.h"
#include "engine/selection/query.h"

namespace clearance {
struct MotionArrays;
}

namespace clearance::cuda {

/// Lists of pairs in device memory: all chunks of a query, one after another.
class ResidentPairs {
 public:
  virtual ~ResidentPairs() = default;
};

/// A scene's pair table in device memory. Implicit: no list of pairs is stored.
class ResidentTable {
 public:
  virtual ~ResidentTable() = default;
};

/// Elements of a `Surface` and their tree in device memory.
class ResidentElements {
 public:
  virtual ~ResidentElements() = default;
};
/// A query's body that consists of points, voxels or triangles, or of several parts that include some.
struct ElementBody {
  std::uint32_t body;
  HullExtents hull;                  ///< around the whole body
  bool is_empty;                     ///< a cloud without points
  const ResidentElements* resident;  ///< its elements; if null, the CPU answers its pairs
};

/// Buffers for the snapshot's bodies, laid out as in BodiesView without boxes.
struct FixedBodies {
  double* components;
  std::uint8_t* state;
};

/// Requested tolerance of the least distance of motions.
struct LeastTolerance {
  bool is_wanted = false;
  double abs_tol = 0, rel_tol = 0;
};

/// Robots with moving joints, as in FramesView.
struct RobotsSetup {
  std::span<const KinematicStep> steps;
  std::span<const JointColumn> columns;
  std::span<const JointRobot> robots;
  std::uint32_t frames = 0;  ///< of all robots
  std::uint32_t joints = 0;  ///< positions in a row
};

/// Moved bodies, as in MovesView. Empty without configurations.
struct MovedSetup {
  std::uint32_t given_count = 0;
  std::span<const std::uint32_t> bodies, source, chain_begin, chain;
  std::span<const Pose> own;
  std::span<const BodyPlacement> base;
  std::span<const std::uint8_t> has_base, slot_state;
  RobotsSetup robots;
};

/// Uncertainty, as in BodiesView and MovesView. Empty if no body of the query is uncertain.
struct UncertaintySetup {
  std::span<const BodySlack> fixed_slack;
  std::span<const LinkPlace> links;
  std::span<const LinkPairError> link_pairs;
  std::span<const UncertaintyStep> steps;
  std::span<const PlacedUncertainty> base;
};

/// Joints for the column gradient_joints, as in MoversView.
struct MoversSetup {
  std::span<const JointMover> movers;
  std::span<const std::uint32_t> of_body;
};

/// The part of a query that all its chunks share. Spans are copied.
struct QuerySetup {
  PairLimits pair_limits;
  std::uint32_t fields = 0;  ///< columns that come back, Field bits
  bool boxes = false;        ///< whether boxes are compared
  MovedSetup moved;
  UncertaintySetup uncertainty;
  MoversSetup movers;
  const ResidentPairs* pairs = nullptr;
  const ResidentTable* table = nullptr;  ///< replaces `pairs` for Reduce::kWithin over a whole table
  std::uint64_t chunks = 1;
  // Reduced queries:
  Reduce reduce = Reduce::kNone;
  std::uint32_t groups = 1;     ///< per configuration
  std::uint64_t most_rows = 0;  ///< Reduce::kWithin only
  bool by_teams = false;        ///< one launch decides each configuration (Reduce::kMin without depths and float32)
  std::span<const ElementBody> elements;  ///< among the bodies of its pairs; if any, by_teams is false
  ElementKinds element_kinds;             ///< of its pairs
  // Reduce::kAny, as in ReducedView:
  std::span<const double> margins;  ///< per pair; if empty, all pairs have `margin`
  double margin = 0;
  PairAnswer beyond{};
  // Motions:
  const MotionArrays* motions = nullptr;
  std::uint32_t max_evaluations = 0;
  LeastTolerance least;
};

/// Kind of input per configuration.
enum class Given : std::uint8_t { kPoses, kPositions };

/// One chunk: a range of rows, consecutive in every column.
struct ChunkSetup {
  std::uint32_t configurations = 1;
  std::uint64_t first_configuration = 0;
  std::uint64_t first_row = 0;   ///< in the query
  std::uint32_t first_pair = 0;  ///< in QuerySetup::pairs
  std::uint32_t pair_count = 0;  ///< rows of one configuration
  /// (configurations, given_count) and (configurations, joints), in pinned memory that must stay valid until the chunk
  /// is finished.
  const Pose* poses = nullptr;
  const double* positions = nullptr;
  bool given_on_device = false;  ///< the input is in device memory and stays there until the chunk is done
  /// Returns once the input before `end` has arrived. If empty, all of it has.
  std::function<void(Given, const void* end)> wait_for;
  std::uint32_t first_tile = 0;   ///< in the list of each tile's group
  std::uint32_t group_tiles = 0;  ///< tiles of groups that share both hulls
  Group ungrouped{};              ///< pairs with hulls of their own; may be empty
  std::uint32_t ungrouped_tiles = 0;
  Group several{};  ///< pairs with a body of several convex parts; may be empty
  std::uint32_t several_tiles = 0;
  std::uint32_t tiles() const { return group_tiles + ungrouped_tiles + several_tiles; }
  std::uint64_t rows() const { return std::uint64_t{configurations} * pair_count; }
};

/// Result of a chunk. The views are valid until the slot's next launch.
struct ChunkResult {
  ReplyView rows;                       ///< host memory, without the `direct` columns
  std::span<const std::uint32_t> rest;  ///< unresolved rows, in no order
  std::uint64_t converged = 0;          ///< rows answered by the narrow phase
};

/// Result of a chunk of a reduced query. The views are valid until the slot's next launch.
struct ReducedResult {
  /// Rows that the device left unresolved. If any, pass the CPU's answers to `finish_with()` first: other members are
  /// invalid.
  std::span<const std::uint32_t> rest;
  ReplyView rows;               ///< host memory; includes the `direct` columns
  std::uint64_t row_count = 0;  ///< rows of the reply
  std::uint64_t total = 0;      ///< row count without the limit of Reduce::kWithin
  std::uint64_t converged = 0;  ///< pairs answered by the narrow phase
};

}  // namespace clearance::cuda
