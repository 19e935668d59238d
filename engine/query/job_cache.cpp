#include "engine/query/job_cache.h"

#include <algorithm>
#include <utility>

namespace clearance {

namespace {

// Limits of one kept job, some MB at most.
constexpr std::uint64_t kMostPairs = 4096;  // pair-configurations, and pairs and margins in the query
constexpr std::size_t kMostBodies = 4096;   // of the scene, since a job has a pose of each

}  // namespace

void Job::LetGo::operator()(State* state) const {
  std::unique_ptr<State> own(state);
  if (own->keeper && own->is_whole) own->keeper->put_back(std::move(own));
}

JobCache::JobCache(const engine::Scene& scene)
    : keeps_any_(scene.bodies().size() <= kMostBodies &&
                 std::none_of(scene.bodies().begin(), scene.bodies().end(),
                              [](const Body& body) { return body.max_speed > 0; })) {
  jobs_.reserve(kJobs);  // so that put_back() allocates nothing
}

bool JobCache::keeps(const QueryView& query) const {
  return keeps_any_ && query.max_pose_age_ns == 0 && query.weights.empty() &&
         std::max({query.pairs.size(), query.margins.size(), query.pair_margins.size()}) <= kMostPairs;
}

bool JobCache::keeps(const QuerySize& size) {
  return size.pairs <= kMostPairs && size.configurations * size.pairs <= kMostPairs;
}

Job::StatePtr JobCache::take(const QueryView& query, const std::shared_ptr<const PoseSnapshot>& snapshot) {
  Job::StatePtr job;
  {
    const std::lock_guard lock(mutex_);
    const auto found = std::find_if(jobs_.rbegin(), jobs_.rend(), [&](const Kept& kept) {
      return kept.job->cached_plan()->question->is_of(query) && kept.snapshot.lock() == snapshot;
    });
    if (found == jobs_.rend()) return job;
    job.reset(found->job.release());
    jobs_.erase(std::next(found).base());
    ++requested_again_;
  }
  Plan& plan = *job->cached_plan();
  plan.snapshot = snapshot;
  plan.take_configurations(query);
  return job;
}

void JobCache::put_back(std::unique_ptr<Job::State> job) {
  const std::shared_ptr<const PoseSnapshot> snapshot = std::move(job->cached_plan()->snapshot);
  const std::lock_guard lock(mutex_);
  std::erase_if(jobs_, [](const Kept& kept) { return kept.snapshot.expired(); });
  if (jobs_.size() == kJobs) jobs_.erase(jobs_.begin());
  jobs_.push_back({std::move(job), snapshot});
}

std::uint64_t JobCache::cache_hits() const {
  const std::lock_guard lock(mutex_);
  return requested_again_;
}

}  // namespace clearance
