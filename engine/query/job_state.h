// State of a Job, and the resources that the engine gives each job.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>

#include "engine/evaluate/evaluate.h"
#include "engine/narrow/lanes.h"
#include "engine/narrow/work_meter.h"
#include "engine/query/job.h"
#include "engine/reduce/near_pairs.h"
#include "engine/selection/plan.h"

namespace clearance {

namespace cuda {
class DeviceBackend;  // engine/device/device_job.h
}  // namespace cuda

class CoverStore;  // engine/cover/cover_store.h
class JobPool;
class JointTableStore;  // engine/joint_table/joint_table_store.h

/// Resources of the engine that a job uses.
struct JobContext {
  const engine::Scene* scene;
  int threads;
  bool reference;
  const LaneKernel* lanes;
  bool light;  ///< all bodies are single parts, so that a pair takes less than 1 us instead of 10
  std::atomic<std::uint64_t>* pairs_evaluated;  ///< counter of the engine
  std::atomic<std::uint64_t>* contradictions;   ///< counter of the engine
  BoxTreeStore* trees = nullptr;
  NearBy near_by = NearBy::kAuto;
  cuda::DeviceBackend* device = nullptr;        ///< null to use the CPU alone
  std::atomic<std::uint64_t>* teams = nullptr;  ///< counts the teams of threads that were started; may be null
  const CoverStore* covers = nullptr;           ///< null if the engine has none
  const JointTableStore* tables = nullptr;      ///< likewise
};

struct Job::State {
  virtual ~State() = default;
  virtual bool advance(const WorkBudget& budget) = 0;
  virtual const QuerySize& size() const = 0;
  ReplyInfo info;
  std::uint64_t units = 0;  ///< of work so far
  /// Called once with the time of all calls of advance(); may be empty.
  std::function<void(const ReplyInfo&, std::chrono::nanoseconds)> when_done;
  std::chrono::nanoseconds took{0};

  /// The plan of a job that can answer again (job_pool.h), otherwise null.
  virtual Plan* repeatable_plan() { return nullptr; }
  /// Releases the snapshot of a complete answer, so that a job that waits keeps no old one alive.
  void rest();
  /// Takes a query's configurations and its snapshot, for reset(). Throws QueryError for configurations that do not fit.
  /// \param snapshot moved into the plan
  void take(const QueryView& query, std::shared_ptr<const PoseSnapshot>& snapshot);
  /// Restarts with the plan's present configurations on the same snapshot.
  virtual void reset(const ReplyView& /*reply*/) {}
  std::shared_ptr<JobPool> pool;  ///< takes the job back; may be null
  /// Snapshot of the plan, while the job waits.
  std::weak_ptr<const PoseSnapshot> kept_for;
  bool is_whole = false;  ///< whether the answer is complete
};

/// Makes a job that runs on the CPU.
std::unique_ptr<Job::State> make_cpu_job(const JobContext& context, Plan plan, const ReplyView& reply);
std::unique_ptr<Job::State> make_dense_job(const JobContext& context, Plan&& plan, const ReplyView& reply);
/// For Reduce::kNearest with a k.
/// Bytes that it takes for each pair, on each thread.
inline constexpr std::uint64_t kBytesOfNearest = 24;
std::unique_ptr<Job::State> make_nearest_pairs_job(const JobContext& context, Plan&& plan, const ReplyView& reply);
/// Whether covers may decide states of a plan.
bool covers_may_decide(const JobContext& context, const Plan& plan);
std::unique_ptr<Job::State> make_decision_job(const JobContext& context, Plan&& plan, const ReplyView& reply);
/// Whether covers may bound the distances of a plan's states.
bool covers_may_bound(const JobContext& context, const Plan& plan);
std::unique_ptr<Job::State> make_distance_job(const JobContext& context, Plan&& plan, const ReplyView& reply);
std::unique_ptr<Job::State> make_reduced_job(const JobContext& context, Plan&& plan, const ReplyView& reply);

}  // namespace clearance
