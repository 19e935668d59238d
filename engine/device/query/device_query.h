// Common parts of dense and reduced queries on a device: uploading poses, pipelining chunks, and answering rows on the
// CPU.
#pragma once

#include <atomic>
#include <deque>
#include <optional>
#include <vector>

#include "engine/device/device_job.h"
#include "engine/device/query/device_movers.h"
#include "engine/device/query/device_uncertainty.h"
#include "engine/device/query/moved_chains.h"
#include "engine/device/query/ordered_copy.h"
#include "engine/query/parallel_job.h"

namespace clearance::cuda {

/// Settings of a chunk of a part, for the number of configurations that `groups` are made for.
inline ChunkSetup chunk_of(const ChunkPlan::Part& part, const ChunkPlan::Part::Groups& groups) {
  ChunkSetup s;
  s.first_pair = part.first_pair;
  s.pair_count = part.count;
  s.first_tile = groups.first_tile;
  s.group_tiles = groups.tiles;
  s.ungrouped = groups.ungrouped;
  s.ungrouped_tiles = groups.ungrouped_tiles;
  s.several = groups.several;
  s.several_tiles = groups.several_tiles;
  return s;
}

class DeviceQuery : public ParallelJob {
 public:
  DeviceQuery(const JobContext& context, Plan&& plan, const ReplyView& reply);

  /// Uploads the query to the device. Throws DeviceError, as advance() does.
  virtual void begin() = 0;
  bool go_on(WorkMeter& slice) final;
  /// Returns the plan, so that the CPU can answer it from the beginning.
  Plan give_up();

 protected:
  /// A row of some chunk, by configuration and pair of the query.
  struct OpenRow {
    std::uint64_t configuration, pair;
  };

  /// Copies the poses of bodies, and returns the settings of the query, which point to data owned by this object.
  QuerySetup setup(QueryWorkspace& workspace);
  /// Starts chunks_ chunks: the first ones at once, while other threads copy the poses of configurations. The caller
  /// may reuse its memory once the query has begun.
  void begin_chunks(QueryWorkspace& workspace, const QuerySetup& setup);
  /// Starts a chunk on the device, and takes a chunk's results. Both are called in order.
  virtual void launch(std::uint64_t chunk) = 0;
  virtual void finish(std::uint64_t chunk) = 0;
  /// Writes the number of rows to `info`, after all chunks are finished.
  virtual void end() = 0;
  /// Settings of a chunk of whole configurations.
  ChunkSetup chunk_of_configurations(std::uint64_t chunk, std::uint64_t most) const {
    ChunkSetup s;
    s.first_configuration = chunk * most;
    s.configurations = static_cast<std::uint32_t>(std::min(most, plan_.size.configurations - s.first_configuration));
    s.pair_count = static_cast<std::uint32_t>(plan_.size.pairs);
    return s;
  }
  /// The poses and positions of a slot's next chunk, pinned. Chunks come in order.
  void give_configurations(QueryWorkspace& workspace, int slot, ChunkSetup& chunk);
  /// Adds rows of a column that the device could not write itself, for copy_all().
  void add_column(const void* from, void* to, std::size_t bytes);
  /// Copies the added rows.
  void copy_all();

  /// Answers rows on the CPU. `open(index)` returns the row, ascending; `take(index, bodies, answer)` receives the
  /// answer.
  template <class Open, class Take>
  void answer_on_cpu(std::size_t count, Open open, Take take) {
    if (count == 0) return;
    std::uint64_t next = 0;
    WorkMeter unlimited;
    run_units(next, (count + kRestUnit - 1) / kRestUnit, unlimited, [&](std::uint64_t unit, int worker, WorkMeter&) {
      const auto w = static_cast<std::size_t>(worker);
      RestScratch& scratch = scratch_[w];
      const std::size_t begin = unit * kRestUnit, end = std::min<std::size_t>(begin + kRestUnit, count);
      std::uint64_t evaluated = 0;
      for (std::size_t i = begin, j; i < end; i = j) {
        const std::uint64_t k = open(i).configuration;
        const BodyPoses& here = placement(worker, k);
        scratch.to_evaluate.clear();
        for (j = i; j < end && open(j).configuration == k; ++j)
          scratch.to_evaluate.push_back(placed_bodies(open(j).pair, here));
        scratch.answers.resize(std::max(scratch.answers.size(), scratch.to_evaluate.size()));
        evaluators_[w].run(scratch.to_evaluate, scratch.answers);
        for (std::size_t n = 0; n < scratch.to_evaluate.size(); ++n) {
          take(i + n, scratch.to_evaluate[n], scratch.answers[n]);
          evaluated += reached_narrow_phase(scratch.answers[n]);
        }
      }
      evaluated_.fetch_add(evaluated, std::memory_order_relaxed);
      return true;
    });
    backend_.finished_on_cpu.fetch_add(count, std::memory_order_relaxed);
  }

  DeviceBackend& backend_;
  std::uint32_t fields_ = 0;  ///< requested columns, Field bits
  ReplyView direct_;          ///< the requested columns in pinned memory
  std::atomic<std::uint64_t> evaluated_{0};
  std::uint64_t slots_ = 1, chunks_ = 0, launched_ = 0, finished_ = 0;  ///< chunks use the workspace's slots in turn

 private:
  static constexpr std::uint64_t kUnitsPerChunk = 1024;  // work units counted for waiting for a chunk
  static constexpr std::uint64_t kRestUnit = 16;         // rows per thread and unit
  struct RestScratch {
    std::vector<PlacedBodies> to_evaluate;
    std::vector<PairAnswer> answers;
  };
  PlacedBodies placed_bodies(std::uint64_t pair, const BodyPoses& placement) const {
    if (plan_.query.reduce != Reduce::kAny) return {plan_.pairs.at(pair), &placement, plan_.query.max_distance};
    const double margin = plan_.margins.of(pair);
    return {plan_.pairs.at(pair), &placement, margin, margin};
  }
  void launch_ahead();
  void find_direct_columns();
  void place_fixed(const FixedBodies& fixed);
  int helpers_for(std::size_t bytes) const;
  // Input of the configurations, during its upload.
  struct Incoming {
    std::byte* pinned = nullptr;      // for all configurations; null if too large or unused
    std::optional<OrderedCopy> copy;  // the copy in progress
  };
  template <class T>
  void take_in(QueryWorkspace& workspace, Given given, std::span<const T> all);
  template <class T>
  const T* give(QueryWorkspace& workspace, int slot, Given given, std::span<const T> all, std::uint64_t first,
                std::uint64_t count);

  Incoming incoming_[2];                            // by kind of input
  std::deque<OrderedCopy> copies_;                  // added for copy_all()
  std::optional<MovedChains> moved_;                // empty if the query moves nothing
  std::optional<DeviceUncertainty> uncertainties_;  // empty if no body of the query is uncertain
  std::optional<DeviceMovers> movers_;              // empty without gradients by joints
  std::vector<RestScratch> scratch_;
  std::vector<Evaluator> evaluators_;
};

/// Whether teams of threads decide a query's configurations (decide_kernel.cuh).
bool is_for_teams(const engine::Scene& scene, const Plan& plan);

std::unique_ptr<DeviceQuery> make_dense_device_query(const JobContext& context, Plan&& plan, const ReplyView& reply);
/// Null, with the plan untouched, if the device does not hold all bodies.
std::unique_ptr<DeviceQuery> make_motion_device_query(const JobContext& context, Plan& plan, const ReplyView& reply);
/// Null, with the plan untouched, if the device does not hold all bodies.
std::unique_ptr<DeviceQuery> make_reduced_device_query(const JobContext& context, Plan& plan, const ReplyView& reply);

}  // namespace clearance::cuda
