// Queries of the installed Engine.
#include "engine/api/engine_impl.h"
#include "engine/base/body_pair.h"
#include "wire/api/decisions.h"

namespace clearance {

struct Engine::Impl::Request final : Pending::Request {
  Request(std::shared_ptr<Impl> of, std::shared_ptr<BackgroundJob> started)
      : engine(std::move(of)), job(std::move(started)) {}
  ~Request() override { job->cancel(); }
  bool wait_for(std::chrono::nanoseconds timeout) override { return job->wait_for(timeout); }
  Result get() override {
    return translated([&] { return job->get(); });
  }

  const std::shared_ptr<Impl> engine;  // outlives the job
  const std::shared_ptr<BackgroundJob> job;
};

Result Engine::Impl::run(const QueryView& query, LastRun& last) const {
  const auto memory_for = [&last](const QuerySize& size) -> const ReplyView& {
    if (last.memory && last.memory.use_count() == 1)
      last.memory->fit(size);
    else
      last.memory = std::make_shared<ResultMemory>(size);
    return last.memory->view();
  };
  const auto result = [&](const ReplyInfo& info) { return ResultMemory::result(last.memory, info, {}); };
  std::shared_ptr<engine::Engine> now = editor.same(last.engine);
  if (now && last.job && now->answer_again(*last.job, query, memory_for(last.job->size())))
    return result(last.job->info());
  last.job.reset();
  if (!now) last.engine = now = engine();
  PreparedQuery prepared = now->prepare(query, last.jobs);
  const ReplyView& reply = memory_for(prepared.size());
  Job job = now->start(std::move(prepared), reply);
  while (!job.advance()) {
  }
  Result answer = result(job.info());
  if (job.rest()) last.job.emplace(std::move(job));
  return answer;
}

Pending Engine::Impl::submit(const std::shared_ptr<Impl>& self, const QueryView& query, WhenDone when_done) {
  // Input of a job, until it is done.
  struct Inputs {
    std::shared_ptr<engine::Engine> engine;
    std::vector<double> positions, growths, velocities, twists;
    std::vector<Pose> configurations;
    std::shared_ptr<ResultMemory> memory;
  };
  const auto inputs = std::make_shared<Inputs>();
  inputs->engine = self->engine();
  inputs->positions.assign(query.positions.begin(), query.positions.end());
  inputs->growths.assign(query.growths.begin(), query.growths.end());
  inputs->configurations.assign(query.configurations.begin(), query.configurations.end());
  inputs->velocities.assign(query.velocities.begin(), query.velocities.end());
  inputs->twists.assign(query.twists.begin(), query.twists.end());
  QueryView own = query;
  own.positions = inputs->positions;
  own.growths = inputs->growths;
  own.velocities = inputs->velocities;
  own.twists = inputs->twists;
  own.configurations = inputs->configurations;
  PreparedQuery prepared = inputs->engine->prepare(own);
  inputs->memory = std::make_shared<ResultMemory>(prepared.size());
  Job job = inputs->engine->start(std::move(prepared), inputs->memory->view());
  const std::shared_ptr<const ResultMemory> memory(inputs, inputs->memory.get());
  auto started = std::make_shared<BackgroundJob>(std::move(job), memory, std::move(when_done));
  self->background.add(started);
  return Pending(std::make_unique<Request>(self, std::move(started)));
}

std::shared_ptr<const JointsInfo> Engine::Impl::joint_limits() const {
  const std::lock_guard lock(limits_mutex);
  if (!limits) limits = std::make_shared<const JointsInfo>(joints_of(*engine()));
  return limits;
}

Result Engine::distances(const Query& query) const {
  return translated([&] {
    Impl::LastRun none;
    return impl_->run(view_of(query), none);
  });
}

Check Engine::check(const Query& query) const {
  return check_with_limits(query, distances(as_check(query)), [this](bool is_now) {
    return is_now ? std::make_shared<const JointsInfo>(joint_states()) : impl_->joint_limits();
  });
}

Result Engine::motions(const Query& query) const {
  return distances(as_motions(query));
}

PathCheck Engine::check_path(const Query& query) const {
  return check_path_with(
      query, [this](const Query& motions) { return distances(motions); },
      [this](const Result&) { return impl_->joint_limits(); });
}

PreparedPath Engine::prepare_path(const Query& query) const {
  return {*this, query, query.joints.empty() ? JointsInfo() : joint_states()};
}

std::vector<double> Engine::free_scale(const Query& query, std::span<const double> weights) const {
  const Result result = distances(as_free_scale(query, weights));
  return {result.free_scale().begin(), result.free_scale().end()};
}

Pending Engine::submit(const Query& query, WhenDone when_done) const {
  return translated([&] { return Impl::submit(impl_, view_of(query), std::move(when_done)); });
}

std::vector<IdPair> Engine::pairs(const Query& query) const {
  return translated([&] {
    std::vector<IdPair> pairs;
    for (const BodyPair& pair : impl_->engine()->pairs(view_of(query))) pairs.push_back({pair.a, pair.b});
    return pairs;
  });
}

std::string Engine::certificate(const Query& query, std::optional<std::span<const std::uint64_t>> rows) const {
  return translated([&] { return impl_->engine()->certificate(view_of(query), rows); });
}

}  // namespace clearance
