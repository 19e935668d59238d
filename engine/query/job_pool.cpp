#include "engine/query/job_pool.h"

#include <algorithm>
#include <new>
#include <utility>

namespace clearance {

namespace {

// Limits of one kept job, some MB at most.
constexpr std::uint64_t kMostPairs = 4096;  // pair-configurations, and pairs and margins in the query
constexpr std::size_t kMostBodies = 4096;   // of the scene, since a job has a pose of each

}  // namespace

void Job::LetGo::operator()(State* state) const {
  std::unique_ptr<State> own(state);
  const std::shared_ptr<JobPool> pool = std::move(own->pool);
  if (pool && own->is_whole) pool->put_back(std::move(own));
}

bool JobPool::allows(const engine::Scene& scene) {
  return scene.bodies().size() <= kMostBodies && std::none_of(scene.bodies().begin(), scene.bodies().end(),
                                                              [](const Body& body) { return body.max_speed > 0; });
}

bool JobPool::allows(const QueryView& query) {
  return query.max_pose_age_ns == 0 &&
         std::max({query.pairs.size(), query.margins.size(), query.pair_margins.size()}) <= kMostPairs;
}

bool JobPool::allows(const QuerySize& size) {
  return size.pairs <= kMostPairs && size.configurations * size.pairs <= kMostPairs;
}

Job::StatePtr JobPool::take(const QueryView& query, const std::shared_ptr<const PoseSnapshot>& snapshot) {
  Job::StatePtr job;
  {
    const std::lock_guard lock(mutex_);
    const auto found = std::find_if(jobs_.rbegin(), jobs_.rend(), [&](const Kept& kept) {
      return kept.job->repeatable_plan()->query.configuration_count == query.configuration_count &&
             kept.snapshot.lock() == snapshot;
    });
    if (found == jobs_.rend()) return job;
    job.reset(found->job.release());
    jobs_.erase(std::next(found).base());
  }
  job->pool = shared_from_this();
  Plan& plan = *job->repeatable_plan();
  plan.snapshot = snapshot;
  plan.take_configurations(query);
  return job;
}

void JobPool::put_back(std::unique_ptr<Job::State> job) {
  const std::shared_ptr<const PoseSnapshot> snapshot = std::move(job->repeatable_plan()->snapshot);
  const std::lock_guard lock(mutex_);
  std::erase_if(jobs_, [](const Kept& kept) { return kept.snapshot.expired(); });
  if (jobs_.size() == most_) jobs_.erase(jobs_.begin());
  try {
    jobs_.push_back({std::move(job), snapshot});
  } catch (const std::bad_alloc&) {
    // This job is not kept.
  }
}

}  // namespace clearance
