// A query on the device that the CPU takes over where the device fails.
#include "device_query.h"

namespace clearance::cuda {

namespace {

[[noreturn]] void refuse(const std::string& error) {
  throw QueryError(QueryErrorCode::kNotSupported, "the device cannot answer, and the CPU may not take over: " + error);
}

class FallbackJob final : public Job::State {
 public:
  FallbackJob(const JobContext& context, std::unique_ptr<DeviceQuery> query, const ReplyView& reply)
      : context_(context), reply_(reply), query_(std::move(query)), size_(query_->size()) {}

  bool advance(std::chrono::nanoseconds budget) override {
    if (!on_cpu_) {
      try {
        const bool done = query_->advance(budget);
        info = query_->info;
        return done;
      } catch (const DeviceError& error) {
        context_.device->note(error);
        if (!context_.device->fallback()) refuse(error.what());
        Plan plan = query_->give_up();
        query_.reset();
        context_.device->queries_on_cpu.fetch_add(1, std::memory_order_relaxed);
        on_cpu_ = make_cpu_job(context_, std::move(plan), reply_);  // rows that came are written again
      }
    }
    const bool done = on_cpu_->advance(budget);
    info = on_cpu_->info;
    return done;
  }

  const QuerySize& size() const override { return size_; }

 private:
  JobContext context_;
  ReplyView reply_;
  std::unique_ptr<DeviceQuery> query_;
  std::unique_ptr<Job::State> on_cpu_;
  QuerySize size_;
};

std::unique_ptr<DeviceQuery> begin_on_device(const JobContext& context, Plan& plan, const ReplyView& reply) {
  auto query = plan.query.reduce == Reduce::kNone ? make_dense_device_query(context, std::move(plan), reply)
                                                  : make_reduced_device_query(context, plan, reply);
  if (!query) return nullptr;
  try {
    query->begin();
  } catch (const DeviceError&) {
    plan = query->give_up();
    throw;
  }
  return query;
}

}  // namespace

std::unique_ptr<Job::State> make_device_job(const JobContext& context, Plan& plan, const ReplyView& reply) {
  DeviceBackend& backend = *context.device;
  if (backend.usable()) {
    try {
      if (auto query = begin_on_device(context, plan, reply))
        return std::make_unique<FallbackJob>(context, std::move(query), reply);
    } catch (const DeviceError& error) {
      backend.note(error);
      if (!backend.fallback()) refuse(error.what());
    }
  } else if (!backend.fallback()) {
    refuse(backend.error());
  }
  backend.queries_on_cpu.fetch_add(1, std::memory_order_relaxed);
  return nullptr;
}

}  // namespace clearance::cuda
