#include "engine/cost/helping_threads.h"

#include <pthread.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <exception>
#include <memory>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

namespace clearance {

/// Threads that wait for work, of all callers.
class HelpingThreads::Pool {
 public:
  void begin(HelpingThreads& caller) {
    const std::lock_guard lock(mutex_);
    callers_.push_back(&caller);
    requested_ += caller.helpers_;
    try {
      for (; threads_ < std::min(requested_, kMostThreads); ++threads_) std::thread([this] { help(); }).detach();
    } catch (const std::exception&) {  // the system has no more threads, or memory: those that there are help
    }
    wanted_.notify_all();  // one call of the system
  }
  /// No helper begins from here; waits for those that have begun.
  void end(HelpingThreads& caller) {
    std::unique_lock lock(mutex_);
    std::erase(callers_, &caller);
    requested_ -= caller.helpers_;
    lock.unlock();
    for (int turn = 0; turn < kPatience && caller.working_.load(std::memory_order_acquire) > 0; ++turn) {
    }
    if (caller.working_.load(std::memory_order_acquire) == 0) return;
    lock.lock();
    ended_.wait(lock, [&] { return caller.working_.load(std::memory_order_acquire) == 0; });
  }

 private:
  static constexpr int kMostThreads = 256;  // more callers than that share them
  static constexpr int kPatience = 20'000;  // some 20 us: most work ends within them

  [[noreturn]] void help() {
    std::unique_lock lock(mutex_);
    for (;;) {
      const auto wants = [](const HelpingThreads* caller) { return caller->begun_ < caller->helpers_; };
      auto found = callers_.end();
      wanted_.wait(lock, [&] { return (found = std::ranges::find_if(callers_, wants)) != callers_.end(); });
      HelpingThreads& caller = **found;
      ++caller.begun_;
      caller.working_.fetch_add(1, std::memory_order_relaxed);
      lock.unlock();
      caller.work_();
      lock.lock();
      if (caller.working_.fetch_sub(1, std::memory_order_release) == 1)
        ended_.notify_all();  // the caller may be gone now
    }
  }

  std::mutex mutex_;
  std::condition_variable wanted_, ended_;
  std::vector<HelpingThreads*> callers_;
  int requested_ = 0;  // helpers, by the callers
  int threads_ = 0;
};

namespace {

// Never destroyed, since queries may outlast main(). Null in a forked child, which has none of the threads.
std::atomic<HelpingThreads::Pool*> the_pool{nullptr};

// Allocates nothing: another thread may have held an allocator's lock at the fork.
void forget_pool() {
  the_pool.store(nullptr, std::memory_order_relaxed);
}

}  // namespace

HelpingThreads::Pool& HelpingThreads::pool() {
  static const int is_registered = pthread_atfork(nullptr, nullptr, forget_pool);
  static_cast<void>(is_registered);
  Pool* pool = the_pool.load(std::memory_order_acquire);
  if (pool) return *pool;
  auto made = std::make_unique<Pool>();
  if (!the_pool.compare_exchange_strong(pool, made.get(), std::memory_order_acq_rel)) return *pool;
  return *made.release();
}

HelpingThreads::HelpingThreads(int helpers, std::function<void()> work)
    : work_(std::move(work)), helpers_(std::max(helpers, 0)) {
  if (helpers_ > 0) pool().begin(*this);
}
HelpingThreads::~HelpingThreads() {
  if (helpers_ > 0) pool().end(*this);
}

}  // namespace clearance
