// The inside of a Job: a plan carried out in slices, in parallel.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>

#include "engine/evaluate/evaluate.h"
#include "engine/narrow/lanes.h"
#include "engine/narrow/warm.h"
#include "engine/narrow/work_meter.h"
#include "engine/query/job.h"
#include "engine/reduce/near_pairs.h"
#include "engine/selection/plan.h"

namespace clearance {

namespace cuda {
class DeviceBackend;  // engine/device/device_job.h
}  // namespace cuda

class KeptJobs;

/// What the engine gives each job.
struct JobContext {
  const Scene* scene;
  int threads;
  bool reference;
  const LaneKernel* lanes;
  bool light;                                   ///< all bodies are single pieces: a pair takes well under 1 us, not 10
  std::atomic<std::uint64_t>* pairs_evaluated;  ///< the engine's counter
  std::atomic<std::uint64_t>* contradictions;   ///< likewise
  WarmStore* warm = nullptr;
  BoxTreeStore* trees = nullptr;
  NearBy near_by = NearBy::kAuto;
  cuda::DeviceBackend* device = nullptr;        ///< null: the CPU alone
  KeptJobs* kept = nullptr;                     ///< where jobs go that may be asked again
  std::atomic<std::uint64_t>* teams = nullptr;  ///< counts the teams of threads that were started; null: nothing does
};

struct Job::State {
  virtual ~State() = default;
  virtual bool advance(const WorkBudget& budget) = 0;
  virtual const QuerySize& size() const = 0;
  ReplyInfo info;
  std::uint64_t units = 0;  ///< of work, so far
  /// Told once how long the work took: the calls of advance() together. Empty: nobody asks.
  std::function<void(const ReplyInfo&, std::chrono::nanoseconds)> when_done;
  std::chrono::nanoseconds took{0};

  /// Of a job that may be asked again (kept_jobs.h); null: it may not.
  virtual Plan* plan_to_ask_again() { return nullptr; }
  /// Begins anew with the plan's configurations as they are now; the snapshot is the one it was made for.
  virtual void begin_again(const ReplyView& /*reply*/) {}
  KeptJobs* keeper = nullptr;  ///< who takes it back; null: nobody
  bool is_whole = false;       ///< the answer is
};

/// On the CPU.
std::unique_ptr<Job::State> make_cpu_job(const JobContext& context, Plan plan, const ReplyView& reply);

}  // namespace clearance
