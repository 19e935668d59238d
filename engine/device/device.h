// A CUDA device with a scene resident in its memory, in words that need no CUDA: what the engine sees of it.
//
// The kernels are in a library of their own (device_module.h). Without it there is no device, and DeviceInfo says why.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "engine/device/device_error.h"
#include "engine/device/layout.h"
#include "engine/narrow/answer.h"
#include "engine/selection/query.h"

namespace clearance {
class PairTable;
class Scene;
class Surface;
struct MotionArrays;
struct Piece;
}  // namespace clearance

namespace clearance::cuda {

struct MotionHitRow;                      // motion_layout.h
enum class MotionVerdict : std::uint8_t;  // likewise

/// A device that the backend can use.
struct DeviceInfo {
  bool present = false;
  std::string name;    ///< "NVIDIA H100 80GB HBM3"
  std::string reason;  ///< why there is none: where the library of the kernels is missing, or what the driver says
  int count = 0;       ///< how many there are, numbered from 0
};
inline constexpr int kCurrentDevice = -1;  ///< in place of a number: the calling thread's

/// Numbers that a device keeps about itself.
struct DeviceCounters {
  std::uint64_t scene_bytes = 0;   ///< geometry, uploaded once
  std::uint64_t query_bytes = 0;   ///< device memory of queries, kept for the next ones
  std::uint64_t pinned_bytes = 0;  ///< host memory of queries, likewise
  std::uint64_t allocations = 0;   ///< how often either had to grow
  std::uint64_t kernel_ns =
      0;  ///< time in kernels: of dense queries by the device's clock, of reductions by its events
  std::uint64_t broad_phase_ns = 0;  ///< of it, of queries over a whole table: from poses to the list of near pairs
  std::uint64_t launches = 0;        ///< chunks of pair-configurations
};

/// Lists of pairs in device memory: those of all chunks of a query, one chunk after another.
class ResidentPairs {
 public:
  virtual ~ResidentPairs() = default;
};

/// A scene's table of pairs in device memory, which knows each pair and lists none.
class ResidentTable {
 public:
  virtual ~ResidentTable() = default;
};

/// Warm state of a client's query in device memory: a WarmRow for each of its configurations and pairs.
class ResidentWarm {
 public:
  virtual ~ResidentWarm() = default;
};

/// A surface's elements and their tree in device memory.
class ResidentElements {
 public:
  virtual ~ResidentElements() = default;
};
/// A body that a query asks for of points, voxels or triangles, or of several pieces with such among them.
struct ElementBody {
  std::uint32_t body;
  HullExtents hull;                  ///< around all of it
  bool is_empty;                     ///< a cloud without points
  const ResidentElements* resident;  ///< its elements; null: its pairs are the CPU's
};

/// Where the snapshot's bodies go, as BodiesView has them; without boxes.
struct FixedBodies {
  double* components;
  std::uint8_t* state;
};

/// How narrow the least distance of motions is to be, where it is asked for.
struct LeastAsked {
  bool is_wanted = false;
  double abs_tol = 0, rel_tol = 0;
};

/// A query's part that stays the same for all its chunks. Spans are copied from.
struct QuerySetup {
  PairLimits pair_limits;
  std::uint32_t fields = 0;  ///< columns that come back, Field bits
  bool boxes = false;        ///< whether boxes are compared
  // The moved ones, as MovesView has them. Empty without configurations.
  std::uint32_t given_count = 0;
  std::span<const std::uint32_t> moved_body, source, chain_begin, chain;
  std::span<const Pose> own;
  std::span<const BodyPlacement> base;
  std::span<const std::uint8_t> has_base, slot_state;
  // The robots of which joints move, as FramesView has them.
  std::span<const KinematicStep> steps;
  std::span<const JointColumn> columns;
  std::span<const JointRobot> robots;
  std::uint32_t frames = 0;  ///< of all of them
  std::uint32_t joints = 0;  ///< positions in a row
  // What is doubted, as BodiesView and MovesView have it. Empty where nothing is doubted of any body that is asked for.
  std::span<const BodySlack> fixed_slack;
  std::span<const LinkPlace> links;
  std::span<const LinkPairError> link_pairs;
  std::span<const UncertaintyStep> uncertainty_steps;
  std::span<const PlacedUncertainty> base_uncertainty;
  // Where the column gradient_joints is wanted, as MoversView has it.
  std::span<const JointMover> movers;
  std::span<const std::uint32_t> mover_of_body;
  const ResidentPairs* pairs = nullptr;
  const ResidentTable* table = nullptr;  ///< of Reduce::kWithin over a whole table, in place of pairs
  std::uint64_t chunks = 1;
  ResidentWarm* warm = nullptr;  ///< null: cold
  std::uint64_t all_pairs = 0;   ///< rows of one configuration of the query
  // Of a reduced query.
  Reduce reduce = Reduce::kNone;
  std::uint32_t groups = 1;     ///< of one configuration
  std::uint64_t most_rows = 0;  ///< of Reduce::kWithin
  bool by_teams = false;  ///< of Reduce::kMin: one launch decides each configuration. Without depths and float32 only
  std::span<const ElementBody> elements;  ///< among the bodies of its pairs; by_teams is false where there are any
  ElementKinds element_kinds;             ///< of its pairs
  // Of Reduce::kAny, as ReducedView has it.
  std::span<const double> margins;  ///< empty: each pair has `margin`
  double margin = 0;
  PairAnswer beyond{};
  // Of motions.
  const MotionArrays* motions = nullptr;
  std::uint32_t max_steps = 0;
  LeastAsked least;
};

/// What a query gives for each configuration.
enum class Given : std::uint8_t { kPoses, kPositions };

/// One chunk: a run of rows that are consecutive in every column.
struct ChunkSetup {
  std::uint32_t configurations = 1;
  std::uint64_t first_configuration = 0;
  std::uint64_t first_row = 0;   ///< in the query
  std::uint32_t first_pair = 0;  ///< in QuerySetup::pairs
  std::uint32_t pair_count = 0;  ///< rows of one configuration
  /// (configurations, given_count) and (configurations, joints), in pinned memory that stays until the chunk is
  /// finished
  const Pose* poses = nullptr;
  const double* positions = nullptr;
  bool given_on_device = false;  ///< they are in device memory, until the chunk is done
  /// Returns once those before `end` are there; empty: all are.
  std::function<void(Given, const void* end)> wait_for;
  std::uint32_t first_tile = 0;   ///< of the list that says each tile's group
  std::uint32_t group_tiles = 0;  ///< tiles of groups of the same two hulls
  Group ungrouped{};              ///< of pairs with hulls of their own; may be empty
  std::uint32_t ungrouped_tiles = 0;
  Group several{};  ///< of pairs of which a body has several pieces; may be empty
  std::uint32_t several_tiles = 0;
  std::uint32_t tiles() const { return group_tiles + ungrouped_tiles + several_tiles; }
  std::uint64_t rows() const { return std::uint64_t{configurations} * pair_count; }
};

/// What a chunk came to. Views are valid until the slot is launched again.
struct ChunkResult {
  ReplyView rows;                       ///< host memory, without what went to `direct` columns
  std::span<const std::uint32_t> rest;  ///< rows that are not settled, in no order
  std::uint64_t converged = 0;          ///< rows that the narrow phase answered
};

/// What a chunk of a reduced query came to. Views are valid until the slot is launched again.
struct ReducedResult {
  /// Rows that the device left open. Where there are any, nothing else is valid: see settle().
  std::span<const std::uint32_t> rest;
  ReplyView rows;               ///< host memory; columns that went to `direct` are those
  std::uint64_t row_count = 0;  ///< of the reply
  std::uint64_t total = 0;      ///< the same without the limit of Reduce::kWithin
  std::uint64_t converged = 0;  ///< pairs that the narrow phase answered
};

inline constexpr int kChunksUnderWay = 4;  ///< on each device

/// Memory and streams for one query at a time, with a few chunks under way. Everything here may throw DeviceError.
class QueryWorkspace {
 public:
  virtual ~QueryWorkspace() = default;
  /// Slots for chunks, once begin() was called. The query's chunks take them in turn.
  virtual int slots() const { return kChunksUnderWay; }
  /// Where the snapshot's bodies go before begin().
  virtual FixedBodies room_for_bodies(std::size_t bodies) = 0;
  virtual void begin(const QuerySetup& setup) = 0;
  /// Pinned memory for what configurations give, of a slot's next chunk or of the whole query.
  virtual std::byte* room_for(Given given, int slot, std::size_t bytes) = 0;
  virtual std::byte* room_for_all(Given given, std::size_t bytes) = 0;
};

/// For a row of every configuration and pair.
class Workspace : public QueryWorkspace {
 public:
  /// Starts a chunk and returns. \param direct columns in pinned memory that rows go to at once, from row 0 on; the
  /// others (null) wait in the workspace.
  virtual void launch(int slot, const ChunkSetup& chunk, const ReplyView& direct) = 0;
  /// Waits for a slot's chunk.
  virtual ChunkResult finish(int slot) = 0;
};

/// For a query whose poses or positions are in device memory already and whose rows stay there. All of it goes into the
/// caller's stream: nothing waits for the host or takes memory once room was made, so that it can be captured in a
/// graph.
class StandingWorkspace : public QueryWorkspace {
 public:
  /// Room for chunks of so many pair-configurations and configurations at most, once begin() was called. All that
  /// begin() sent is there when it returns.
  virtual void make_room(std::uint64_t rows, std::uint32_t configurations) = 0;
  virtual int device() const = 0;           ///< its number
  virtual std::uint64_t bytes() const = 0;  ///< of device memory that it holds
  /// Device memory of its own for rows. Once.
  virtual std::byte* room_for_rows(std::size_t bytes) = 0;
  /// Starts a chunk, whose poses and positions (ChunkSetup) are in device memory. \param rows columns in device memory
  /// \param in_order the query's pairs in their order, where a chunk has them in another. \param first_in_order the
  /// chunk's first among them
  /// \param stream cudaStream_t
  virtual void launch(const ChunkSetup& chunk, const ReplyView& rows, const ResidentPairs& in_order,
                      std::uint64_t first_in_order, void* stream) = 0;
};

/// For reduced queries. A chunk's pairs are those of ChunkSetup, all of one part; what says how they are grouped by
/// hulls is not looked at.
class ReducedWorkspace : public QueryWorkspace {
 public:
  /// Starts a chunk and returns. \param direct columns in pinned memory that rows go to at once; the others (null) wait
  /// in the workspace.
  virtual void launch(int slot, const ChunkSetup& chunk, const ReplyView& direct) = 0;
  /// Waits for a slot's chunk.
  virtual ReducedResult finish(int slot) = 0;
  /// Takes the CPU's answers to the rows that finish() named, in their order.
  virtual ReducedResult settle(int slot, std::span<const PairAnswer> answers) = 0;
};

/// What a chunk of motions came to. Views are valid until the slot is launched again.
struct MotionResult {
  std::span<const MotionVerdict> verdicts;  ///< of each
  std::span<const std::uint32_t> steps;     ///< likewise: configurations that were looked at
  std::span<const double> free_until;       ///< likewise, as MotionRow has it; empty: first contact was not sought
  std::span<const MotionHitRow> hits;       ///< of those that hit, in no order
  std::uint64_t converged = 0;              ///< pairs that the narrow phase answered
};

/// For motions of joints of which it is asked whether all pairs stay beyond their margins, or how near they come. A
/// chunk's configurations are motions, with positions (motions, 2, joints).
class MotionWorkspace : public QueryWorkspace {
 public:
  /// Starts a chunk and returns.
  virtual void launch(int slot, const ChunkSetup& chunk) = 0;
  /// Waits for a slot's chunk.
  virtual MotionResult finish(int slot) = 0;
};

class Device {
 public:
  virtual ~Device() = default;
  /// Chunks that a large query should have at least, to keep all of it busy.
  virtual int chunks_wanted() const { return kChunksUnderWay; }
  /// Index of the body's hull on the device; kSeveral: it has several pieces; kNone: the CPU answers its pairs.
  virtual std::uint32_t hull_of(std::uint32_t body) const = 0;
  /// Whether blocks of threads can hold the hull in their shared memory, beside another one.
  virtual bool shares(std::uint32_t) const { return true; }
  /// Copies pairs to the device. \param position of each within its chunk.
  /// \param group_of_tile of each tile of 128 pair-configurations of the same two hulls.
  virtual std::shared_ptr<const ResidentPairs> upload(std::span<const PairRef> pairs,
                                                      std::span<const std::uint32_t> position,
                                                      std::span<const Group> group_of_tile) = 0;
  virtual std::shared_ptr<const ResidentTable> upload(const PairTable& table) = 0;
  /// Copies a surface's elements and tree to the device. \param room of elements that nobody needs any more, in whose
  /// memory they may go; may be null. Null: this device holds none.
  virtual std::shared_ptr<ResidentElements> upload(const Surface&, std::shared_ptr<ResidentElements>) {
    return nullptr;
  }
  /// Cold state for so many rows. Throws DeviceError where there is no room.
  virtual std::unique_ptr<ResidentWarm> make_warm(std::uint64_t rows) = 0;
  /// A workspace that nobody uses, made if there is none. It goes back when the pointer is let go.
  virtual std::shared_ptr<Workspace> borrow() = 0;
  virtual std::shared_ptr<ReducedWorkspace> borrow_reduced() = 0;
  /// Null: the CPU answers motions.
  virtual std::shared_ptr<MotionWorkspace> borrow_motions() { return nullptr; }
  /// One more, for as long as its owner keeps it; null: what there is are several devices.
  /// \param reduce none, min or any
  virtual std::shared_ptr<StandingWorkspace> make_standing(Reduce) { return nullptr; }
  virtual DeviceCounters counters() const = 0;
};

/// The current CUDA device of this process, if there is one.
const DeviceInfo& installed_device();
std::string installed_device_name(int number);
/// Copies the scene's hulls to a device. \param number of the device, or kCurrentDevice. \param memory_limit bytes of
/// its memory that may be taken.
std::shared_ptr<Device> open_device(const Scene& scene, int number, std::uint64_t memory_limit);

struct SharedMemoryCalls;

/// Stands in for the installed devices while it lives: tests of what follows from a device's faults need none.
class FakeDevice {
 public:
  using Open = std::function<std::shared_ptr<Device>(const Scene&, int number, std::uint64_t memory_limit)>;
  /// \param memory of SharedMemory; null: the installed devices'
  FakeDevice(DeviceInfo info, Open open, const SharedMemoryCalls* memory = nullptr);
  ~FakeDevice();
  FakeDevice(const FakeDevice&) = delete;
  FakeDevice& operator=(const FakeDevice&) = delete;
};

bool has_fake_device();

/// The devices that the backend uses: the installed ones or what stands in for them.
const DeviceInfo& device_info();
std::string device_name(int number);
std::shared_ptr<Device> make_device(const Scene& scene, int number, std::uint64_t memory_limit);

/// Whether the memory is pinned, so that the device can write to it.
bool is_pinned(const void* memory);

/// Makes memory that is there already pinned while it lives, whichever the devices of this process.
class RegisteredMemory {
 public:
  /// \param memory a mapping, from its beginning. All its pages are taken now, which lasts milliseconds. Throws
  /// DeviceError.
  RegisteredMemory(std::byte* memory, std::size_t bytes);
  ~RegisteredMemory();
  RegisteredMemory(const RegisteredMemory&) = delete;
  RegisteredMemory& operator=(const RegisteredMemory&) = delete;

 private:
  std::byte* memory_;
};

/// Pinned host memory: replies in it need no copy on the host.
class PinnedMemory {
 public:
  explicit PinnedMemory(std::size_t bytes);
  ~PinnedMemory();
  PinnedMemory(const PinnedMemory&) = delete;
  PinnedMemory& operator=(const PinnedMemory&) = delete;
  std::byte* data() const { return data_; }

 private:
  std::byte* data_ = nullptr;
};

}  // namespace clearance::cuda
