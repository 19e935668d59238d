#include "engine/query/job.h"

#include <utility>

#include "engine/base/fp_environment.h"
#include "engine/query/job_pool.h"
#include "engine/query/job_state.h"

namespace clearance {

std::unique_ptr<Job::State> make_cpu_job(const JobContext& context, Plan plan, const ReplyView& reply) {
  plan.keep_configurations();
  const auto make = plan.query.k > 0                     ? make_nearest_pairs_job
                    : covers_may_decide(context, plan)   ? make_decision_job
                    : covers_may_bound(context, plan)    ? make_distance_job
                    : plan.query.reduce == Reduce::kNone ? make_dense_job
                                                         : make_reduced_job;
  return make(context, std::move(plan), reply);
}

PreparedQuery::PreparedQuery(std::unique_ptr<Planner> planner) : planner_(std::move(planner)) {}
PreparedQuery::PreparedQuery(Job::StatePtr kept) : kept_(std::move(kept)) {}
PreparedQuery::PreparedQuery(PreparedQuery&&) noexcept = default;
PreparedQuery& PreparedQuery::operator=(PreparedQuery&&) noexcept = default;
PreparedQuery::~PreparedQuery() = default;
const Plan& PreparedQuery::plan() const {
  return kept_ ? *kept_->repeatable_plan() : planner_->plan();
}
bool PreparedQuery::advance(const WorkBudget& budget) {
  if (kept_) return true;
  const FpEnvironment environment;
  WorkMeter slice(budget);
  const bool is_ready = planner_->advance(slice);
  units_of_this_thread += slice.spent();
  return is_ready;
}
const QuerySize& PreparedQuery::size() const {
  return plan().size;
}
void PreparedQuery::copy_pairs(std::uint64_t begin, std::uint64_t count, BodyPair* out) const {
  plan().pairs.copy(begin, count, out);
}
std::uint64_t PreparedQuery::bytes() const {
  const Plan& p = plan();
  return p.pairs.list().size_bytes() + p.configurations.size_bytes() + p.positions.size_bytes() +
         p.velocities.size_bytes() + p.twists.size_bytes() + p.growths.size_bytes();
}
void PreparedQuery::keep_on_cpu() {
  keep_on_cpu_ = true;
}

Job::Job(StatePtr state) : state_(std::move(state)) {}
Job::Job(Job&&) noexcept = default;
Job& Job::operator=(Job&&) noexcept = default;
Job::~Job() = default;
bool Job::advance(const WorkBudget& budget) {
  const FpEnvironment environment;
  const std::uint64_t before = state_->units;
  const bool timed = state_->when_done != nullptr;
  using Clock = std::chrono::steady_clock;
  const Clock::time_point begin = timed ? Clock::now() : Clock::time_point();
  const bool done = state_->advance(budget);
  units_of_this_thread += state_->units - before;
  if (!timed) return done;
  state_->took += Clock::now() - begin;
  if (done) std::exchange(state_->when_done, nullptr)(state_->info, state_->took);
  return done;
}
std::uint64_t Job::units() const {
  return state_->units;
}
const QuerySize& Job::size() const {
  return state_->size();
}
const ReplyInfo& Job::info() const {
  return state_->info;
}
bool Job::rest() {
  if (!state_->pool || !state_->is_whole) return false;
  state_->rest();
  return true;
}

}  // namespace clearance
