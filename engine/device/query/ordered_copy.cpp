#include "engine/device/query/ordered_copy.h"

#include <pthread.h>

#include <condition_variable>
#include <mutex>
#include <system_error>
#include <thread>

namespace clearance::cuda {

namespace {

/// Threads that wait for work.
class Helpers {
 public:
  /// Returns false while another copy has the helpers.
  bool begin(int wanted, const std::function<void()>& work) {
    const std::lock_guard lock(mutex_);
    if (is_taken_) return false;
    is_taken_ = true;
    work_ = &work;
    wanted_ = wanted;
    try {
      for (; threads_ < wanted_; ++threads_) std::thread([this] { help(); }).detach();
    } catch (const std::system_error&) {  // the system has no more threads: those that there are help
    }
    asked_.notify_all();  // one call of the system
    return true;
  }
  /// No helper begins from here; waits for those that have begun.
  void end() {
    {
      const std::lock_guard lock(mutex_);
      work_ = nullptr;
    }
    for (int turn = 0; turn < kPatience && working_.load(std::memory_order_acquire) > 0; ++turn) {
    }
    for (int now; (now = working_.load(std::memory_order_acquire)) > 0;) working_.wait(now);
    const std::lock_guard lock(mutex_);
    is_taken_ = false;
  }

 private:
  static constexpr int kPatience = 20'000;  // some 20 us: a block takes half of that

  [[noreturn]] void help() {
    std::unique_lock lock(mutex_);
    for (;;) {
      asked_.wait(lock, [&] { return work_ && wanted_ > 0; });
      --wanted_;
      ++working_;
      const std::function<void()>& work = *work_;
      lock.unlock();
      work();
      working_.fetch_sub(1, std::memory_order_release);
      working_.notify_one();
      lock.lock();
    }
  }

  std::mutex mutex_;
  std::condition_variable asked_;
  bool is_taken_ = false;                        // by a copy, until its last helper has ended
  const std::function<void()>* work_ = nullptr;  // null unless helpers may begin
  int wanted_ = 0;                               // helpers that may still begin
  int threads_ = 0;                              // that were started
  std::atomic<int> working_{0};
};

// Never destroyed, since queries may outlast main(). A forked child has none of the threads, and gets its own.
Helpers* all_helpers = nullptr;
void make_helpers() {
  all_helpers = new Helpers();
}
Helpers& helpers() {
  static std::once_flag once;
  std::call_once(once, [] {
    make_helpers();
    pthread_atfork(nullptr, nullptr, make_helpers);
  });
  return *all_helpers;
}

}  // namespace

CopyHelp::CopyHelp(int count, std::function<void()> work) : work_(std::move(work)) {
  if (count > 0) has_helpers_ = helpers().begin(count, work_);
}
CopyHelp::~CopyHelp() {
  if (has_helpers_) helpers().end();
}

}  // namespace clearance::cuda
