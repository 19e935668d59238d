#include "engine/query/parallel_job.h"

#include "engine/query/pose_ages.h"

namespace clearance {

namespace {

// Pair-configurations that are not worth more than one thread.
constexpr std::uint64_t kSerialBelow = 256;

int worker_count(const JobContext& context, const QuerySize& size) {
  return size.configurations * size.pairs < kSerialBelow ? 1 : context.threads;
}

}  // namespace

ParallelJob::ParallelJob(const JobContext& context, Plan&& plan, const ReplyView& reply, bool boxes)
    : context_(context),
      plan_(std::move(plan)),
      reply_(reply),
      runner_(worker_count(context, plan_.size), context.teams) {
  plan_.begun_ns = monotonic_ns();
  plan_.snapshot = with_stale_poses(scene(), plan_);
  plan_.uncertainties = uncertainties_of(scene(), *plan_.snapshot, plan_.begun_ns);
  if (plan_.size.fields & kFieldGradientJoints) joint_gradient_.emplace(scene(), plan_);
  options_ = evaluate_options(context, plan_.query, joint_gradient_ ? &*joint_gradient_ : nullptr);
  if (plan_.size.fields & kSecondOrderFields) options_.second_order = &second_order_.emplace(scene(), plan_);
  if (boxes) boxes_ = boxes_of_bodies(scene(), plan_);
  for (int i = 0; i < workers(); ++i) worker_poses_.emplace_back(scene(), plan_, boxes_);
  info = snapshot_info(plan_, context.reference);
}

bool ParallelJob::advance(const WorkBudget& budget) {
  WorkMeter slice(budget);
  is_whole = go_on(slice);
  units += slice.spent();
  return is_whole;
}

void ParallelJob::reset(const ReplyView& reply) {
  assert(is_whole);
  is_whole = false;
  ++plan_.round;
  plan_.keep_configurations();
  if (plan_.snapshot->oldest_receipt_ns != 0) plan_.begun_ns = monotonic_ns();  // of use for no other age (job_cache.h)
  reply_ = reply;
  units = 0;
  info = snapshot_info(plan_, context_.reference);
  rewind();
}

}  // namespace clearance
