// A query on the device that the CPU takes over if the device fails.
#include <algorithm>
#include <cassert>
#include <cmath>
#include <string>

#include "engine/device/query/body_kinds.h"
#include "engine/device/query/device_query.h"
#include "engine/motion/motion_job.h"

namespace clearance::cuda {

namespace {

[[noreturn]] void reject(const std::string& error) {
  throw engine::QueryError(QueryErrorCode::kNotSupported,
                           "the device cannot answer, and the CPU may not take over: " + error);
}

std::unique_ptr<DeviceQuery> make_device_query(const JobContext& context, Plan& plan, const ReplyView& reply) {
  if (plan.query.max_evaluations > 0) return make_motion_device_query(context, plan, reply);
  return plan.query.reduce == Reduce::kNone ? make_dense_device_query(context, std::move(plan), reply)
                                            : make_reduced_device_query(context, plan, reply);
}

// Null, with the plan untouched, if the CPU has to answer it. Throws QueryError if fallback is off.
std::unique_ptr<DeviceQuery> begin_on_device(const JobContext& context, Plan& plan, const ReplyView& reply) {
  DeviceBackend& backend = *context.device;
  while (backend.usable()) {
    std::unique_ptr<DeviceQuery> query;
    try {
      query = make_device_query(context, plan, reply);
      if (query) query->begin();
      return query;
    } catch (const DeviceError& error) {
      if (query) plan = query->give_up();
      backend.note(error);
      if (error.kind == DeviceError::kOneLost) continue;  // try the remaining devices
      if (!backend.fallback()) reject(error.what());
      return nullptr;
    }
  }
  if (!backend.fallback()) reject(backend.error());
  return nullptr;
}

class FallbackJob final : public Job::State {
 public:
  FallbackJob(const JobContext& context, std::unique_ptr<DeviceQuery> query, const ReplyView& reply)
      : context_(context), reply_(reply), query_(std::move(query)), size_(query_->size()) {}

  bool advance(const WorkBudget& budget) override {
    while (query_) {
      try {
        const bool done = query_->advance(budget);
        info = query_->info;
        units = query_->units;
        return done;
      } catch (const DeviceError& error) {
        restart(error);
      }
    }
    assert(!query_);
    if (!on_cpu_) reject(context_.device->error());  // repeats the error
    const bool done = on_cpu_->advance(budget);
    info = on_cpu_->info;
    units = on_cpu_->units;
    return done;
  }

  const QuerySize& size() const override { return size_; }

 private:
  // Restarts on the remaining devices or on the CPU. Rows already written are written again.
  void restart(const DeviceError& error) {
    DeviceBackend& backend = *context_.device;
    backend.note(error);
    const bool others_are_left = error.kind == DeviceError::kOneLost;
    if (!others_are_left && !backend.fallback()) reject(error.what());
    Plan plan = query_->give_up();
    query_.reset();
    if (others_are_left) query_ = begin_on_device(context_, plan, reply_);
    if (query_) return;
    backend.queries_on_cpu.fetch_add(1, std::memory_order_relaxed);
    on_cpu_ = (plan.query.max_evaluations > 0 ? make_motion_job : make_cpu_job)(context_, std::move(plan), reply_);
  }

  JobContext context_;
  ReplyView reply_;
  std::unique_ptr<DeviceQuery> query_;
  std::unique_ptr<Job::State> on_cpu_;
  QuerySize size_;
};

}  // namespace

std::string beyond_the_device(const Plan& plan) {
  if (plan.query.fields & kFieldFreeScale) return "the column free_scale";
  if (plan.query.fields & kSecondOrderFields)
    return "a column of second order (hessian_joints, rate, rate_bounds, curvature, smooth_radius)";
  if (plan.query.k > 0) return "k of reduce nearest";
  if (plan.query.max_evaluations == 0) return "";
  if (plan.query.control_points > 2) return "more than two control_points";
  if (plan.query.reduce != Reduce::kAny && plan.query.reduce != Reduce::kMin)
    return "max_evaluations with reduce: none";
  if (plan.query.reduce == Reduce::kMin && (plan.query.fields & kFieldPairLower))
    return "the column pair_lower of motions";
  if (plan.query.reduce == Reduce::kMin && plan.query.max_distance < INFINITY) return "a max_distance of motions";
  return plan.given_bodies > 0 || plan.joints.empty() ? "motions of bodies by their poses" : "";
}

namespace {

[[noreturn]] void reject_query(const std::string& what) {
  throw engine::QueryError(QueryErrorCode::kNotSupported,
                           what + ": backend cuda does not answer it, and the CPU may not");
}

// Rejects a query that the CPU would answer, or whose pairs it would, before any work.
void reject_unsupported(const JobContext& context, const Plan& plan) {
  reject_beyond_the_device(plan);
  const QueryView& q = plan.query;
  const bool with_elements = q.reduce != Reduce::kNone && q.max_evaluations == 0 && !q.signed_distance;
  const std::string pair = unsupported_pair(*context.scene, context.device->device(), plan, with_elements);
  if (!pair.empty()) reject_query(pair);
}

}  // namespace

void reject_beyond_the_device(const Plan& plan) {
  if (const std::string beyond = beyond_the_device(plan); !beyond.empty()) reject_query(beyond);
}

std::unique_ptr<Job::State> make_device_job(const JobContext& context, Plan& plan, const ReplyView& reply) {
  const bool is_strict = !context.device->fallback() && plan.size.rows > 0;
  if (is_strict && context.device->usable()) reject_unsupported(context, plan);
  auto query = beyond_the_device(plan).empty() ? begin_on_device(context, plan, reply) : nullptr;
  if (query) return std::make_unique<FallbackJob>(context, std::move(query), reply);
  if (is_strict && plan.size.pairs > 0)
    reject_query(plan.query.max_evaluations > 0
                     ? "motions of several devices, of more than 65536 pairs, or of robots that carry each other"
                     : "clouds and meshes on several devices, or within a whole scene");
  context.device->queries_on_cpu.fetch_add(1, std::memory_order_relaxed);
  return nullptr;
}

}  // namespace clearance::cuda
