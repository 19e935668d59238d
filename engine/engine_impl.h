// Members of Engine.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <utility>

#include "engine/cost/query_cost.h"
#include "engine/cover/cover_store.h"
#include "engine/device/device_job.h"
#include "engine/device/router.h"
#include "engine/engine.h"
#include "engine/joint_table/joint_table_store.h"
#include "engine/query/job_state.h"
#include "engine/query/recent_queries.h"
#include "engine/state/pose_store.h"
#include "wire/fork_guard.h"

namespace clearance::engine {

struct Engine::Impl {
  Impl(Scene&& s, const Options& o) : scene(std::move(s)), options(o), poses(scene, o.max_stamp_lead) {}

  Scene scene;
  Options options;
  bool reference = false;
  const LaneKernel* lanes = nullptr;
  bool light = false;
  NearBy near_by = NearBy::kAuto;
  std::shared_ptr<BoxTreeStore> trees = std::make_shared<BoxTreeStore>();
  std::unique_ptr<cuda::DeviceBackend> device;
  std::string rejected_device;  // reason that the device is not used, or empty
  std::unique_ptr<cuda::Router> router;
  PoseStore poses;
  SceneCost scene_cost{scene};
  bool jobs_may_repeat = JobPool::allows(scene);
  mutable std::mutex recent_mutex;
  mutable RecentQueries recent{8};          // jobs of concurrent calls; after `trees`, to which they return theirs
  std::shared_ptr<CoverStore> covers;       // null if off
  std::shared_ptr<JointTableStore> tables;  // likewise
  TaskOwner owner = std::make_shared<char>();
  ForkGuard process;
  mutable std::atomic<std::uint64_t> queries{0}, repeated{0}, pairs_evaluated{0}, contradictions{0}, teams{0};
  mutable std::atomic<std::uint64_t> answered_again{0};  // queries not counted by the two above
  std::atomic<std::uint64_t> pose_updates{0}, bad_poses{0}, joint_updates{0}, bad_joints{0}, point_updates{0};

  JobContext context(const Scene& of) const {
    return {&of,         options.threads, reference,    lanes,  light,        &pairs_evaluated, &contradictions,
            trees.get(), near_by,         device.get(), &teams, covers.get(), tables.get()};
  }

  // The given pool, or the one of a query that its caller has not prepared but may repeat; null if no job may be kept.
  std::shared_ptr<JobPool> pool_of(const QueryView& query, const std::shared_ptr<JobPool>& given) const {
    if (!may_keep_job_of(query)) return nullptr;
    if (given) return given;
    const std::lock_guard lock(recent_mutex);
    return recent.pool_of(query, scene.bodies().size());
  }
  // Whether a pool may keep the job of a query; such jobs run on the CPU. With a device, only those of Reduce::kAny may,
  // where the CPU may answer at all: it takes less time for a small decision than a launch on the device.
  bool may_keep_job_of(const QueryView& query) const {
    return jobs_may_repeat && (!device || (router && query.reduce == Reduce::kAny)) && JobPool::allows(query);
  }

  // Requests covers of the bodies that may move.
  void request_covers() const;
  // Requests a cover of the present points of a body that may move.
  void request_cover_of_points(std::uint32_t body) const;

  // Backend of a query.
  struct Route {
    cuda::QueryKind kind;
    std::uint64_t pairs;
    bool to_device;
    cuda::Router* router;  // learns from the answer; null if there was no choice
  };
  // Throws QueryError if the device does not support the query and the CPU may not replace it.
  Route route_of(const Plan& plan, bool keep_on_cpu) const;
  // Whether a pool keeps a job, which then stays on the CPU: a device may answer large ones sooner.
  bool keeps(const JobPool& pool, const QuerySize& size) const;

  // OpenMP's threads do not survive a fork, so a child that used them would hang.
  void check_process() const {
    if (process.forked()) throw std::logic_error("this engine belongs to the process before fork(); make a new one");
  }
};

}  // namespace clearance::engine
