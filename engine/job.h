// The inside of a Job: a plan carried out in slices, in parallel.
#pragma once

#include <atomic>
#include <chrono>
#include <memory>

#include "near_pairs.h"
#include "engine.h"
#include "evaluate.h"
#include "lanes.h"
#include "plan.h"
#include "warm.h"

namespace clearance {

namespace cuda {
class DeviceBackend;  // engine/cuda/device_job.h
class Router;         // engine/cuda/router.h
}

/// What the engine gives each job.
struct JobContext {
  const Scene* scene;
  int threads;
  bool reference;
  const LaneKernel* lanes;
  bool light;                 ///< all bodies are single pieces: a pair takes well under 1 us, not 10
  std::atomic<std::uint64_t>* pairs_evaluated;  ///< the engine's counter
  std::atomic<std::uint64_t>* contradictions;   ///< likewise
  WarmStore* warm = nullptr;
  BoxTreeStore* trees = nullptr;
  NearBy near_by = NearBy::kAuto;
  cuda::DeviceBackend* device = nullptr;        ///< null: the CPU alone
  cuda::Router* router = nullptr;               ///< null: whatever the device can answer is the device's
};

struct Job::State {
  virtual ~State() = default;
  virtual bool advance(std::chrono::nanoseconds budget) = 0;
  virtual const QuerySize& size() const = 0;
  ReplyInfo info;
};

/// On whatever answers it.
std::unique_ptr<Job::State> make_job(const JobContext& context, Plan plan, const ReplyView& reply);
/// On the CPU.
std::unique_ptr<Job::State> make_cpu_job(const JobContext& context, Plan plan, const ReplyView& reply);

}  // namespace clearance
