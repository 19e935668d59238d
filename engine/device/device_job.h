// Queries answered by a device. The CPU finishes the rows that a device leaves unresolved.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <string>
#include <unordered_map>
#include <vector>

#include "engine/base/counters.h"
#include "engine/device/device.h"
#include "engine/query/job_state.h"

namespace clearance::cuda {

/// Identifies the pairs that a list was built for, so that a later query can reuse it.
struct PairSelectionKey {
  std::shared_ptr<const PairTable> table;  ///< or, if null:
  std::vector<BodyPair> pairs;
  std::vector<std::uint32_t> moved;

  PairSelectionKey() = default;
  explicit PairSelectionKey(const Plan& plan);
  bool matches(const Plan& plan) const;
};

/// Assignment of a dense query's pairs to chunks and groups. Built once for a pair table and kept for the next query.
struct ChunkPlan {
  struct Part {               ///< a range of pairs; the rows of a chunk are `configurations` times these
    std::uint64_t first = 0;  ///< position of its first pair in the query
    std::uint32_t count = 0;
    std::uint32_t first_pair = 0;       ///< in the device's list, which leaves out the CPU's pairs
    std::vector<std::uint32_t> on_cpu;  ///< positions within the part of pairs that are not on the device
    struct Groups {
      std::uint32_t first_tile = 0, tiles = 0, ungrouped_tiles = 0, several_tiles = 0;
      Group ungrouped{}, several{};
    } whole, last;  ///< for chunks of `configurations`, and for the last chunk of a query
  };
  std::vector<Part> parts;
  std::uint32_t configurations = 1;       ///< of one chunk
  std::uint32_t last_configurations = 1;  ///< of the last chunk
  std::shared_ptr<const ResidentPairs> resident;

  PairSelectionKey key;
  std::uint64_t all_configurations = 1;
};

/// A query's pairs on the device in query order, for reduced queries.
struct PairListOnDevice {
  std::shared_ptr<const ResidentPairs> resident;  ///< null if the device lacks one of their bodies
  std::vector<std::uint32_t> of_elements;         ///< bodies that are, or contain, clouds or meshes
  ElementKinds kinds;                             ///< kinds that the device answers
  PairSelectionKey key;
};

/// Clouds and meshes at the revision of a query.
struct ElementsOnDevice {
  std::vector<ElementBody> bodies;
  std::vector<std::shared_ptr<const ResidentElements>> resident;
};

/// A scene's pair table on the device, for reduced queries over all of it.
struct TableOnDevice {
  std::shared_ptr<const PairTable> table;
  std::shared_ptr<const ResidentTable> resident;  ///< null if the device lacks a body
};

class SeveralDevices;

/// The engine's device or devices, with the data kept between queries.
class DeviceBackend {
 public:
  struct Options {
    std::vector<int> devices;                        ///< device numbers; if empty, the current device
    std::uint64_t memory_limit = ~std::uint64_t{0};  ///< bytes of each device's memory
    bool fallback = true;                            ///< the CPU answers queries that the device cannot
  };
  /// Throws DeviceError if fallback is off and a device cannot hold the scene.
  DeviceBackend(const engine::Scene& scene, const Options& options);

  Device& device() const { return *device_; }
  bool usable() const { return usable_; }
  bool fallback() const { return options_.fallback; }
  /// The device's last error message, or empty.
  std::string error() const;
  /// Records an error. If all devices are lost, none is used again.
  void note(const DeviceError& error);
  /// Chunk plan for the query's pairs: the last one if it fits.
  std::shared_ptr<const ChunkPlan> chunk_plan(const Plan& plan);
  /// A new chunk plan for a query that keeps it, in chunks of about this many rows.
  std::shared_ptr<const ChunkPlan> make_chunk_plan(const Plan& plan, std::uint64_t chunk_rows) const;
  /// The query's pairs in order: the last list if it fits.
  std::shared_ptr<const PairListOnDevice> list(const Plan& plan);
  /// The current elements of these bodies, copied to the device if not yet there. Null if the device holds no elements.
  /// \param scene of the query
  std::shared_ptr<const ElementsOnDevice> elements(const engine::Scene& scene, std::span<const std::uint32_t> bodies);
  /// The query's whole pair table: the last one if it is the same.
  std::shared_ptr<const TableOnDevice> table(const Plan& plan);
  /// Adds the counters shown by stats().
  void append(Counters& counters) const;

  // Totals over pair-configurations and queries.
  std::atomic<std::uint64_t> converged{0}, finished_on_cpu{0}, motions_finished_on_cpu{0}, reply_bytes_copied{0},
      queries{0}, queries_on_cpu{0}, without_room{0};

 private:
  const engine::Scene& scene_;
  Options options_;
  std::atomic<bool> usable_{false};
  mutable std::mutex mutex_;  // guards the following members
  std::string error_;
  std::shared_ptr<Device> device_;           // declared before the members whose memory it counts; set once
  std::shared_ptr<SeveralDevices> several_;  // declared before those as well; null for a single device
  std::shared_ptr<const ChunkPlan> last_;
  std::shared_ptr<const PairListOnDevice> last_list_;
  std::shared_ptr<const TableOnDevice> last_table_;
  std::mutex elements_mutex_;  // guards the following members, also while elements are copied
  struct KnownElements {
    std::shared_ptr<const Surface> surface;
    std::shared_ptr<ResidentElements> resident;
  };
  std::unordered_map<std::uint32_t, KnownElements> elements_;  // by body: the last one requested
};

/// Reason why no device answers this query yet, or empty.
std::string beyond_the_device(const Plan& plan);
/// Throws QueryError with that reason, for engines without a CPU.
void reject_beyond_the_device(const Plan& plan);

/// A query on the device, continued on the CPU if the device fails. Null, with the plan untouched, if the CPU has to
/// answer it from the beginning. If fallback is off, throws QueryError instead, or if the device fails.
std::unique_ptr<Job::State> make_device_job(const JobContext& context, Plan& plan, const ReplyView& reply);

}  // namespace clearance::cuda
