#include "server/tasks/query_task.h"

#include <algorithm>
#include <utility>

namespace clearance {
namespace {

/// More pairs than memory holds, so that the count of their bytes does not overflow.
constexpr std::uint64_t kMostListed = std::uint64_t{1} << 56;

}  // namespace

void QueryTask::take_options(const QueryOptions& options, const QueryCost& cost) {
  options_ = options;
  cost_ = cost;
  has_options_ = true;
  if (options.deadline_ns == 0) return;
  deadline_ = received_ + std::chrono::nanoseconds(options.deadline_ns);
  const auto now = Clock::now();
  check_deadline(now);
  daemon_.forecast.check(cost_class(), deadline_ - now, std::chrono::nanoseconds(options.deadline_ns));
}

void QueryTask::check_deadline(Clock::time_point now) const {
  if (now >= deadline_) throw deadline_passed(std::chrono::nanoseconds(options_.deadline_ns), in_engine_);
}

void QueryTask::begin_on_loop(const wire::QueryParts& parts, std::uint64_t payload_bytes,
                              std::unique_ptr<ReplySink>& sink, const std::shared_ptr<JobPool>& jobs) {
  worked_ = Clock::now();
  const auto begun = worked_;
  on_loop_ = true;
  payload_bytes_ = payload_bytes;
  prepare(parts, jobs);
  list({});
  prepared_->keep_on_cpu();
  reserve(*sink);
  start();
  worked_ = Clock::now();
  in_engine_ = worked_ - begun;
  pending_.sink = std::move(sink);  // last, as the caller needs it after an exception
}

void QueryTask::begin_on_worker(std::function<OwnPayload()> fetch, std::uint64_t payload_bytes,
                                std::uint64_t listed_pairs, std::unique_ptr<ReplySink>& sink) {
  const std::uint64_t bytes = payload_bytes + std::min(listed_pairs, kMostListed) * sizeof(BodyPair);
  daemon_.quotas.check_bytes(client(), service_class(), bytes, sink->unsent_bytes());
  fetch_ = std::move(fetch);
  payload_bytes_ = payload_bytes;
  pending_.share = daemon_.quotas.take(client(), service_class(), bytes);
  pending_.sink = std::move(sink);
}

bool QueryTask::advance(std::chrono::nanoseconds budget, Clock::time_point& now) {
  failure_ = ReplyWriter::rejection_of(pending_.header, [&] {
    check_deadline(now);
    work(std::min<std::chrono::nanoseconds>(budget, deadline_ - now));
  });
  if (failure_ || step_ == Step::kPublish || step_ == Step::kOver) free_memory();
  worked_ = Clock::now();
  in_engine_ += worked_ - now;
  now = worked_;
  return failure_ || (step_ != Step::kList && step_ != Step::kRun) || on_loop_;
}

void QueryTask::work(std::chrono::nanoseconds budget) {
  switch (step_) {
    case Step::kRead:
      return read();
    case Step::kList:
      return list({.time = budget});
    case Step::kRun:
      return run(budget);
    case Step::kCopy:
      return copy();
    default:
      return;
  }
}

void QueryTask::work_on_loop() {
  switch (step_) {
    case Step::kSetOptions:
      return set_options();
    case Step::kReserve:
      return reserve(*pending_.sink);
    case Step::kReserveFinal:
      return reserve_final();
    case Step::kPublish:
      return publish();
    default:
      return;
  }
}

bool QueryTask::advance_on_loop() {
  if (step_ == Step::kOver) return true;
  if (is_ended_) {
    end();
    return false;
  }
  if (!pending_.sink->alive()) {
    ++daemon_.stats.dropped;
    ++daemon_.stats["queries.dropped"];
    end();
  } else if (failure_) {
    reject(*failure_);
    return true;
  } else {
    const bool is_last = step_ == Step::kPublish;
    if (!daemon_.answers.guard(*pending_.sink, pending_.header, [&] { work_on_loop(); })) end();
    if (is_last || !pending_.sink) return true;  // answered, or deferred
  }
  if (on_loop_ && step_ == Step::kRun) ++daemon_.stats["queries.handed_over"];
  on_loop_ = false;
  return false;
}

void QueryTask::reject(const RejectedRequest& failure) {
  if (failure.code == wire::ErrorCode::kDeadline && in_engine_.count() > 0)
    daemon_.forecast.note(cost_class(), in_engine_, false);
  daemon_.answers.reject(*pending_.sink, pending_.header, failure);
}

/// Returns the query to a worker once more, which frees its memory.
void QueryTask::end() {
  is_ended_ = true;
  step_ = Step::kOver;
}

void QueryTask::free_memory() {
  fetch_ = nullptr;
  prepared_.reset();
  job_.reset();
  payload_ = {};
  aligned_ = {};
  reply_.free_own_memory();
  engine_.reset();  // freeing a replaced scene may take long
}

/// Only before the reply has memory, which a worker may be writing to. Afterwards check_deadline() ends the query after
/// its slice.
void QueryTask::expire() {
  if (reply_.is_reserved() || is_ended_) return;
  daemon_.answers.reject(*pending_.sink, pending_.header,
                         deadline_passed(std::chrono::nanoseconds(options_.deadline_ns), std::chrono::nanoseconds(0)));
  is_ended_ = true;
  gone_.store(true, std::memory_order_relaxed);
}

void QueryTask::read() {
  if (fetch_) payload_ = std::exchange(fetch_, nullptr)();
  const wire::QueryParts parts = wire::parse_query(pending_.header, aligned(payload_.span(), aligned_));
  daemon_.answers.check_epoch(pending_.header, parts.epoch);
  const QueryOptions& options = parts.options;
  if (!has_options_ && (options.min_pose_stamp_ns != 0 || options.deadline_ns != 0)) {
    options_ = options;
    cost_ = engine_->cost(view_of(parts, pending_.header.scene_revision));
    step_ = Step::kSetOptions;
    return;
  }
  prepare(parts);
  step_ = Step::kList;
}

/// Goes on at once if the poses that the query waits for have arrived, else begins again when they have.
void QueryTask::set_options() {
  pending_.share.give_back();  // a deferred query has its own
  if (options_.min_pose_stamp_ns != 0 &&
      daemon_.hold(pending_.header, service_class(), options_, payload_, pending_.sink, received_))
    return;
  pending_.share = daemon_.quotas.take(client(), service_class(), payload_bytes_);
  take_options(options_, cost_);
  step_ = Step::kRead;
}

void QueryTask::prepare(const wire::QueryParts& parts, const std::shared_ptr<JobPool>& jobs) {
  QueryView query = view_of(parts, pending_.header.scene_revision);
  if (!has_options_) {
    options_ = parts.options;
    cost_ = engine_->cost(query);
  }
  daemon_.limits.check(cost_);
  // The engine keeps the configurations and the pairs, unless these are the scene's whole table.
  whole_table_ = parts.header.all_pairs && parts.bodies.size() == 0 && parts.joints.size() == 0;
  const bool by_joints = query.fields & kJointFields;
  reply_.begin(query, daemon_.answers.records(parts.passed_over, by_joints ? query.joints.size() : 0));
  prepared_ = engine_->begin_preparing(query, jobs);
}

void QueryTask::list(const WorkBudget& budget) {
  if (!prepared_->advance(budget)) return;
  reply_.set_size(prepared_->size());
  daemon_.limits.check(reply_.size());
  step_ = Step::kReserve;
}

/// Takes quota for the request, its pairs and the largest reply.
void QueryTask::reserve(ReplySink& sink) {
  const std::uint64_t bytes = reply_.most_bytes() + payload_bytes_ + engine_->list_bytes(*prepared_) +
                              (whole_table_ ? 0 : reply_.size().pairs * sizeof(BodyPair));
  pending_.share.give_back();
  daemon_.quotas.check_bytes(client(), service_class(), bytes, sink.unsent_bytes());
  pending_.share = daemon_.quotas.take(client(), service_class(), bytes);
  reply_.reserve(sink);
  step_ = Step::kRun;
}

/// Starts the job, which copies the request as far as needed.
void QueryTask::start() {
  job_ = engine_->start(std::move(*prepared_), reply_.view());
  prepared_.reset();
  payload_ = {};
  aligned_ = {};
}

void QueryTask::run(std::chrono::nanoseconds budget) {
  if (!job_) start();
  const bool shares_with_control = daemon_.limits.has_control && service_class() != ServiceClass::kControl;
  const bool is_motion = options_.max_evaluations > 0;  // it may need any number of evaluations, and mostly needs few
  const WorkBudget& on_loop =
      shares_with_control || is_motion ? daemon_.limits.on_loop_briefly : daemon_.limits.on_loop;
  const bool done = job_->advance(on_loop_ ? on_loop : WorkBudget{.time = budget});
  units_ = job_->units();
  if (!done) return;
  reply_.close_up(job_->info());
  step_ = reply_.is_in_own_memory() ? Step::kReserveFinal : Step::kPublish;
}

void QueryTask::reserve_final() {
  reply_.reserve_final(*pending_.sink);
  step_ = Step::kCopy;
}

void QueryTask::copy() {
  reply_.copy();
  step_ = Step::kPublish;
}

void QueryTask::publish() {
  if (!on_loop_) worked_ = Clock::now();
  check_deadline(worked_);
  daemon_.forecast.note(cost_class(), in_engine_, true);
  const auto in_server = std::chrono::nanoseconds(worked_ - received_);
  reply_.publish(*pending_.sink, pending_.header, {in_engine_, in_server});
  daemon_.answers.count_query(static_cast<std::uint64_t>(in_server.count()), reply_.rows());
}

}  // namespace clearance
