#include "engine/api/background.h"

namespace clearance {

void BackgroundJob::run() {
  constexpr std::chrono::milliseconds kSlice{10};  // until a cancelled job ends
  std::optional<Result> result;
  std::exception_ptr error;
  try {
    const auto begin = std::chrono::steady_clock::now();
    while (!is_cancelled_ && !job_.advance(kSlice)) {
    }
    if (is_cancelled_) return;
    result = ResultMemory::result(std::move(memory_), job_.info(), std::chrono::steady_clock::now() - begin);
  } catch (...) {
    error = std::current_exception();
  }
  {
    const std::lock_guard lock(mutex_);
    result_ = std::move(result);
    error_ = error;
    is_done_ = true;
  }
  changed_.notify_all();
  if (when_done_) when_done_();
}

bool BackgroundJob::wait_for(std::chrono::nanoseconds timeout) {
  constexpr std::chrono::hours kForever{24 * 365};  // beyond it, the deadline would overflow
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, std::min<std::chrono::nanoseconds>(timeout, kForever), [this] { return is_done_; });
}

Result BackgroundJob::get() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return is_done_; });
  if (error_) std::rethrow_exception(error_);
  return std::move(*result_);
}

void Background::work() {
  while (true) {
    std::shared_ptr<BackgroundJob> job;
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [this] { return is_closed_ || !jobs_.empty(); });
      if (is_closed_) return;
      job = std::move(jobs_.front());
      jobs_.pop_front();
    }
    job->run();
  }
}

void Background::add(std::shared_ptr<BackgroundJob> job) {
  {
    const std::lock_guard lock(mutex_);
    jobs_.push_back(std::move(job));
    if (!thread_.joinable()) thread_ = std::thread([this] { work(); });
  }
  changed_.notify_one();
}

Background::~Background() {
  {
    const std::lock_guard lock(mutex_);
    is_closed_ = true;
  }
  changed_.notify_one();
  if (thread_.joinable()) thread_.join();
}

}  // namespace clearance
