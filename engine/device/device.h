// Interface between the engine and a CUDA device that holds a scene. Needs no CUDA headers.
//
// The kernels are in a separate library (device_module.h). If it is missing, no device is present and DeviceInfo holds
// the reason.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "engine/device/device_error.h"
#include "engine/device/layout.h"
#include "engine/device/query_setup.h"

namespace clearance {
class PairTable;
namespace engine {
class Scene;
}
class Surface;
struct ConvexPart;
}  // namespace clearance

namespace clearance::cuda {

struct MotionHitRow;                      // motion_layout.h
enum class MotionOutcome : std::uint8_t;  // motion_layout.h

/// The devices available to the backend.
struct DeviceInfo {
  bool present = false;
  std::string name;    ///< "NVIDIA H100 80GB HBM3"
  std::string reason;  ///< if not present: the missing kernel library, or the driver's message
  int count = 0;       ///< number of devices, numbered from 0
};
inline constexpr int kCurrentDevice = -1;  ///< device number for the calling thread's current device

/// Device counters.
struct DeviceCounters {
  std::uint64_t scene_bytes = 0;           ///< geometry
  std::uint64_t scene_bytes_uploaded = 0;  ///< of it, from the host; the rest was on the device, for the scene before
  std::uint64_t query_bytes = 0;           ///< device memory of queries, kept for reuse
  std::uint64_t pinned_bytes = 0;          ///< pinned host memory of queries, kept for reuse
  std::uint64_t allocations = 0;           ///< number of times either of these had to grow
  std::uint64_t kernel_ns = 0;             ///< kernel time: dense queries by the device's clock, reductions by events
  std::uint64_t broad_phase_ns = 0;  ///< the part of it from poses to the list of near pairs (whole-table queries)
  std::uint64_t launches = 0;        ///< chunks launched
};

inline constexpr int kChunksUnderWay = 4;  ///< on each device

/// Memory and streams for one query at a time, with a few chunks in flight. All members may throw DeviceError.
class QueryWorkspace {
 public:
  virtual ~QueryWorkspace() = default;
  /// Number of chunk slots, valid after begin(). Chunks use the slots in turn.
  virtual int slots() const { return kChunksUnderWay; }
  /// Buffers that the caller fills with the snapshot's bodies before begin().
  virtual FixedBodies body_buffers(std::size_t bodies) = 0;
  virtual void begin(const QuerySetup& setup) = 0;
  /// Pinned memory for input: of a slot's next chunk, or of the whole query.
  virtual std::byte* chunk_input_buffer(Given given, int slot, std::size_t bytes) = 0;
  virtual std::byte* query_input_buffer(Given given, std::size_t bytes) = 0;
};

/// Workspace of dense queries: a row per configuration and pair.
class Workspace : public QueryWorkspace {
 public:
  /// Starts a chunk and returns.
  /// \param direct columns in pinned memory that receive rows directly, from row 0 on; rows of null columns stay in the
  /// workspace.
  virtual void launch(int slot, const ChunkSetup& chunk, const ReplyView& direct) = 0;
  /// Waits for a slot's chunk.
  virtual ChunkResult finish(int slot) = 0;
};

/// Workspace of a query whose poses or positions and rows stay in device memory. All work goes into the caller's
/// stream. After reserve() nothing waits for the host or allocates memory, so a graph can capture it.
class ResidentWorkspace : public QueryWorkspace {
 public:
  /// Allocates memory for chunks of at most this many pair-configurations and configurations; call after begin(). All
  /// data of begin() is on the device when it returns.
  virtual void reserve(std::uint64_t rows, std::uint32_t configurations) = 0;
  virtual int device() const = 0;           ///< device number
  virtual std::uint64_t bytes() const = 0;  ///< device memory held
  /// Allocates device memory for rows. Call at most once.
  virtual std::byte* row_buffer(std::size_t bytes) = 0;
  /// Starts a chunk whose poses and positions (ChunkSetup) are in device memory.
  /// \param rows columns in device memory
  /// \param in_order the query's pairs in query order, since a chunk may order them differently
  /// \param first_in_order index of the chunk's first pair in `in_order`
  /// \param stream cudaStream_t
  virtual void launch(const ChunkSetup& chunk, const ReplyView& rows, const ResidentPairs& in_order,
                      std::uint64_t first_in_order, void* stream) = 0;
};

/// Workspace of reduced queries. A chunk has the pairs of ChunkSetup, all of one part; their grouping by hulls is
/// ignored.
class ReducedWorkspace : public QueryWorkspace {
 public:
  /// Starts a chunk and returns.
  /// \param direct columns in pinned memory that receive rows directly; rows of null columns stay in the workspace.
  virtual void launch(int slot, const ChunkSetup& chunk, const ReplyView& direct) = 0;
  /// Waits for a slot's chunk.
  virtual ReducedResult finish(int slot) = 0;
  /// Takes the CPU's answers for the rows in ReducedResult::rest, in their order.
  virtual ReducedResult finish_with(int slot, std::span<const PairAnswer> answers) = 0;
};

/// Result of a chunk of motions. The views are valid until the slot's next launch.
struct MotionResult {
  std::span<const MotionOutcome> outcomes;  ///< per motion
  std::span<const std::uint32_t> steps;     ///< configurations evaluated, per motion
  std::span<const double> free_until;       ///< per motion, as in MotionRow; empty if first contact was not requested
  std::span<const MotionHitRow> hits;       ///< one per motion that hits, in no order
  std::uint64_t converged = 0;              ///< pairs answered by the narrow phase
};

/// Workspace of joint motions: tests whether all pairs stay beyond their margins, or finds their least distance. A
/// chunk's configurations are motions, with positions of shape (motions, 2, joints).
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
  /// Minimum number of chunks that keeps the device busy in a large query.
  virtual int chunks_wanted() const { return kChunksUnderWay; }
  /// Device index of the body's hull. kSeveral if it has several convex parts; kNone if the CPU answers its pairs.
  virtual std::uint32_t hull_of(std::uint32_t body) const = 0;
  /// Whether a thread block's shared memory can hold the hull together with a second one.
  virtual bool shares(std::uint32_t) const { return true; }
  /// Copies pairs to the device.
  /// \param position of each pair within its chunk
  /// \param group_of_tile group of each tile of 128 pair-configurations that share both hulls
  virtual std::shared_ptr<const ResidentPairs> upload(std::span<const PairRef> pairs,
                                                      std::span<const std::uint32_t> position,
                                                      std::span<const Group> group_of_tile) = 0;
  virtual std::shared_ptr<const ResidentTable> upload(const PairTable& table) = 0;
  /// Copies a surface's elements and tree to the device. The second argument holds unused elements whose memory may be
  /// reused, or null. Returns null if this device does not hold elements.
  virtual std::shared_ptr<ResidentElements> upload(const Surface&, std::shared_ptr<ResidentElements>) {
    return nullptr;
  }
  /// An unused workspace, created if needed. It is returned when the pointer is released.
  virtual std::shared_ptr<Workspace> borrow() = 0;
  virtual std::shared_ptr<ReducedWorkspace> borrow_reduced() = 0;
  /// Null if the CPU answers motions.
  virtual std::shared_ptr<MotionWorkspace> borrow_motions() { return nullptr; }
  /// A new workspace, owned by the caller. Null for several devices.
  /// \param reduce none, min or any
  virtual std::shared_ptr<ResidentWorkspace> make_resident(Reduce) { return nullptr; }
  virtual DeviceCounters counters() const = 0;
};

/// The current CUDA device of this process, if any.
const DeviceInfo& installed_device();
std::string installed_device_name(int number);
/// Opens a device and copies the scene's hulls to it.
/// \param number of the device, or kCurrentDevice
/// \param memory_limit maximum device memory, in bytes
std::shared_ptr<Device> open_device(const engine::Scene& scene, int number, std::uint64_t memory_limit);

struct SharedMemoryCalls;

/// Replaces the installed devices during its lifetime, so that tests of device faults need no GPU.
class FakeDevice {
 public:
  using Open = std::function<std::shared_ptr<Device>(const engine::Scene&, int number, std::uint64_t memory_limit)>;
  /// \param memory of SharedMemory; if null, the installed devices' calls are used
  FakeDevice(DeviceInfo info, Open open, const SharedMemoryCalls* memory = nullptr);
  ~FakeDevice();
  FakeDevice(const FakeDevice&) = delete;
  FakeDevice& operator=(const FakeDevice&) = delete;
};

bool has_fake_device();

/// The devices that the backend uses: the installed ones, or the fake ones.
const DeviceInfo& device_info();
std::string device_name(int number);
std::shared_ptr<Device> make_device(const engine::Scene& scene, int number, std::uint64_t memory_limit);

/// Whether the memory is pinned and therefore writable by the device.
bool is_pinned(const void* memory);

/// Pins existing memory during its lifetime, for all devices of this process.
class RegisteredMemory {
 public:
  /// \param memory start of a mapping. All its pages are populated now, which takes milliseconds. Throws DeviceError.
  RegisteredMemory(std::byte* memory, std::size_t bytes);
  ~RegisteredMemory();
  RegisteredMemory(const RegisteredMemory&) = delete;
  RegisteredMemory& operator=(const RegisteredMemory&) = delete;

 private:
  std::byte* memory_;
};

/// Pinned host memory. Replies in it need no copy on the host.
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
