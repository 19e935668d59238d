#include "engine/query/job_pool.h"

#include <algorithm>
#include <new>
#include <utility>

namespace clearance {

namespace {

// Limits of a pool, some MB as a rule.
constexpr std::uint64_t kMostPairs = 4096;  // pairs and margins in the query
constexpr std::size_t kMostBodies = 4096;   // of the scene, since a job has a pose of each

std::uint64_t rows_of(const QuerySize& size) {
  return size.configurations * size.pairs;
}

}  // namespace

void Job::LetGo::operator()(State* state) const {
  std::unique_ptr<State> own(state);
  const std::shared_ptr<JobPool> pool = std::move(own->pool);
  if (pool && own->is_whole) pool->put_back(std::move(own));
}

void Job::State::rest() {
  const std::shared_ptr<const PoseSnapshot> snapshot = std::move(repeatable_plan()->snapshot);
  if (kept_for.expired()) kept_for = snapshot;  // each job has one
}

void Job::State::take(const QueryView& query, std::shared_ptr<const PoseSnapshot>& snapshot) {
  Plan& plan = *repeatable_plan();
  plan.take_configurations(query);
  plan.snapshot = std::move(snapshot);
}

bool JobPool::allows(const engine::Scene& scene) {
  return scene.bodies().size() <= kMostBodies && std::none_of(scene.bodies().begin(), scene.bodies().end(),
                                                              [](const Body& body) { return body.max_speed > 0; });
}

bool JobPool::allows(const QueryView& query) {
  return query.max_pose_age_ns == 0 &&
         std::max({query.pairs.size(), query.margins.size(), query.pair_margins.size()}) <= kMostPairs;
}

bool JobPool::allows(const QuerySize& size, std::uint64_t most) {
  return size.pairs <= kMostPairs && rows_of(size) <= most;
}

namespace {

bool is_of(const std::weak_ptr<const PoseSnapshot>& kept, const std::shared_ptr<const PoseSnapshot>& snapshot) {
  return !kept.owner_before(snapshot) && !snapshot.owner_before(kept);
}

}  // namespace

// The mutex is locked.
JobPool::Jobs::const_reverse_iterator JobPool::find(std::uint32_t configurations,
                                                    const std::shared_ptr<const PoseSnapshot>& snapshot) const {
  return std::find_if(jobs_.rbegin(), jobs_.rend(), [&](const std::unique_ptr<Job::State>& job) {
    return job->repeatable_plan()->query.configuration_count == configurations && is_of(job->kept_for, snapshot);
  });
}

bool JobPool::has(std::uint32_t configurations, const std::shared_ptr<const PoseSnapshot>& snapshot) const {
  const std::lock_guard lock(mutex_);
  return find(configurations, snapshot) != jobs_.rend();
}

Job::StatePtr JobPool::take(const QueryView& query, std::shared_ptr<const PoseSnapshot>& snapshot) {
  const std::lock_guard lock(mutex_);
  const auto found = find(query.configuration_count, snapshot);
  if (found == jobs_.rend()) return nullptr;
  const auto place = jobs_.begin() + (std::next(found).base() - jobs_.cbegin());
  (*place)->take(query, snapshot);
  Job::StatePtr job(place->release());
  jobs_.erase(place);
  return job;
}

void JobPool::keep_plan(std::unique_ptr<Planner> planner) {
  const std::shared_ptr<const PoseSnapshot> snapshot = std::move(planner->plan().snapshot);
  const std::lock_guard lock(mutex_);
  planned_ = std::move(planner);
  planned_for_ = snapshot;
}

std::unique_ptr<Planner> JobPool::take_plan(const QueryView& query,
                                            const std::shared_ptr<const PoseSnapshot>& snapshot) {
  const std::lock_guard lock(mutex_);
  const bool fits = planned_ && is_of(planned_for_, snapshot) &&
                    planned_->plan().query.configuration_count == query.configuration_count;
  if (!fits) planned_.reset();
  if (!planned_) return nullptr;
  planned_->plan().take_configurations(query);
  planned_->plan().snapshot = snapshot;
  return std::move(planned_);
}

void JobPool::put_back(std::unique_ptr<Job::State> job) {
  job->rest();
  if (job->kept_for.expired()) return;
  const std::lock_guard lock(mutex_);
  std::erase_if(jobs_, [](const std::unique_ptr<Job::State>& kept) { return kept->kept_for.expired(); });
  if (planned_for_.expired()) planned_.reset();
  std::uint64_t rows = rows_of(job->size());
  for (const std::unique_ptr<Job::State>& kept : jobs_) rows += rows_of(kept->size());
  while (!jobs_.empty() && (jobs_.size() == most_ || rows > most_rows())) {
    rows -= rows_of(jobs_.front()->size());
    jobs_.erase(jobs_.begin());
  }
  try {
    jobs_.push_back(std::move(job));
  } catch (const std::bad_alloc&) {
    // This job is not kept.
  }
}

}  // namespace clearance
