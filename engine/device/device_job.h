// Queries answered by a device, with the CPU finishing what the device leaves open.
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

/// What lists of pairs are made for, to know whether they serve the next query too.
struct AskedPairs {
  std::shared_ptr<const PairTable> table;  ///< or:
  std::vector<BodyPair> pairs;
  std::vector<std::uint32_t> moved;

  AskedPairs() = default;
  explicit AskedPairs(const Plan& plan);
  bool fit(const Plan& plan) const;
};

/// How a dense query's pairs are dealt to chunks and groups. Made once for a pair table, and kept for the next query.
struct ChunkPlan {
  struct Part {               ///< of the pairs: the rows of a chunk are `configurations` times this
    std::uint64_t first = 0;  ///< position of its first pair in the query
    std::uint32_t count = 0;
    std::uint32_t first_pair = 0;       ///< in the device's list, where the CPU's pairs are left out
    std::vector<std::uint32_t> on_cpu;  ///< positions within the part of pairs that are not on the device
    struct Groups {
      std::uint32_t first_tile = 0, tiles = 0, ungrouped_tiles = 0, several_tiles = 0;
      Group ungrouped{}, several{};
    } whole, last;  ///< for chunks of `configurations`, and for the last of a query
  };
  std::vector<Part> parts;
  std::uint32_t configurations = 1;       ///< of one chunk
  std::uint32_t last_configurations = 1;  ///< of the last one
  std::shared_ptr<const ResidentPairs> resident;

  AskedPairs asked;
  std::uint64_t all_configurations = 1;
};

/// A query's pairs on the device in the query's order, for reduced queries.
struct PairListOnDevice {
  std::shared_ptr<const ResidentPairs> resident;  ///< null: the device does not know a body of theirs
  std::vector<std::uint32_t> of_elements;         ///< bodies of theirs that are clouds or meshes, or have some
  ElementKinds kinds;                             ///< of theirs, that the device looks at
  AskedPairs asked;
};

/// Clouds and meshes as a query has them.
struct ElementsOnDevice {
  std::vector<ElementBody> bodies;
  std::vector<std::shared_ptr<const ResidentElements>> resident;
};

/// A scene's table of pairs on the device, for reduced queries over all of it.
struct TableOnDevice {
  std::shared_ptr<const PairTable> table;
  std::shared_ptr<const ResidentTable> resident;  ///< null: the device does not know all bodies
};

/// Warm state of a client's last query on the device.
struct DeviceWarmTable {
  std::uint64_t client = 0, question = 0, rows = 0;
  std::unique_ptr<ResidentWarm> memory;
};

class SeveralDevices;

/// The engine's device, or devices, and what is kept between queries.
class DeviceBackend {
 public:
  struct Options {
    std::vector<int> devices;                        ///< numbers; none: the current device
    std::uint64_t memory_limit = ~std::uint64_t{0};  ///< bytes of each device's memory
    bool fallback = true;                            ///< the CPU answers what the device cannot
  };
  /// Without fallback it throws DeviceError where a device cannot hold the scene.
  DeviceBackend(const Scene& scene, const Options& options);

  Device& device() const { return *device_; }
  bool usable() const { return usable_; }
  bool fallback() const { return options_.fallback; }
  /// What the device said last when it did not answer; empty: it always did.
  std::string error() const;
  /// Takes note of an error. Where all devices are lost, none is asked again.
  void note(const DeviceError& error);
  /// How this plan's pairs are dealt: the last deal if it fits.
  std::shared_ptr<const ChunkPlan> deal(const Plan& plan);
  /// The same for a plan that keeps it, in chunks of about so many rows.
  std::shared_ptr<const ChunkPlan> deal_anew(const Plan& plan, std::uint64_t chunk_rows) const;
  /// The plan's pairs in their order: the last list if it fits.
  std::shared_ptr<const PairListOnDevice> list(const Plan& plan);
  /// The elements of these bodies as they are now, copied to the device where they are not there yet; null: the device
  /// holds none. \param scene of the query
  std::shared_ptr<const ElementsOnDevice> elements(const Scene& scene, std::span<const std::uint32_t> bodies);
  /// The plan's whole table: the last one if it is the same.
  std::shared_ptr<const TableOnDevice> table(const Plan& plan);
  /// The client's warm state for this plan, cold if it asked for something else before; null where there is no room.
  /// \param rows configurations times pairs
  std::unique_ptr<DeviceWarmTable> take_warm(const Plan& plan, std::uint64_t rows);
  void put_back(std::unique_ptr<DeviceWarmTable> table) { warm_.put_back(std::move(table)); }
  /// Adds what stats() shows.
  void append(Counters& counters) const;

  static constexpr std::size_t kWarmClients = 16;
  // What became of pair-configurations and queries.
  std::atomic<std::uint64_t> converged{0}, finished_on_cpu{0}, motions_finished_on_cpu{0}, reply_bytes_copied{0},
      queries{0}, queries_on_cpu{0}, without_room{0};

 private:
  const Scene& scene_;
  Options options_;
  std::atomic<bool> usable_{false};
  mutable std::mutex mutex_;  // of what follows
  std::string error_;
  std::shared_ptr<Device> device_;           // before what holds memory that it counts; set once
  std::shared_ptr<SeveralDevices> several_;  // the same; null: it is one
  std::shared_ptr<const ChunkPlan> last_;
  std::shared_ptr<const PairListOnDevice> last_list_;
  std::shared_ptr<const TableOnDevice> last_table_;
  std::mutex elements_mutex_;  // of what follows, also while elements are copied
  struct KnownElements {
    std::shared_ptr<const Surface> surface;
    std::shared_ptr<ResidentElements> resident;
  };
  std::unordered_map<std::uint32_t, KnownElements> elements_;  // by body: the last one that was asked for
  LatestTables<DeviceWarmTable> warm_{kWarmClients};
};

/// What a device does not answer yet, in words; empty: it answers this.
std::string beyond_the_device(const Plan& plan);

/// A query on the device, which the CPU takes over if the device fails in the middle of it; null, and the plan
/// untouched, where the CPU has to answer it from the beginning. Throws QueryError where the device fails and no one
/// may take over.
std::unique_ptr<Job::State> make_device_job(const JobContext& context, Plan& plan, const ReplyView& reply);

}  // namespace clearance::cuda
