#include "engine/cache/background_worker.h"

#include <omp.h>
#include <pthread.h>
#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>

#include <condition_variable>
#include <cstdlib>
#include <deque>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>

#include "engine/cache/sha256.h"

namespace clearance {

namespace {

using WorkClock = std::chrono::steady_clock;

/// Time without new results after a task is added, so that short programs and first answers are not disturbed, and tasks
/// that are replaced sooner cost nothing.
constexpr std::chrono::milliseconds kWorkGrace{100};

/// Gives the calling thread the lowest priority, no team of threads, which would compete with those of queries for all
/// cores, and leaves signals to other threads. Not SCHED_IDLE: on a machine whose planners take all cores, nothing would
/// ever be made.
void work_last() {
  omp_set_num_threads(1);
  sigset_t all;
  sigfillset(&all);
  pthread_sigmask(SIG_BLOCK, &all, nullptr);
  setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), 19);
}

}  // namespace

struct BackgroundWorker::State {
  /// The workers of this process, whose threads have to end before the libraries that they use do.
  struct Workers {
    std::mutex mutex;
    std::vector<State*> all;
  };

  State();
  ~State();
  static Workers& workers();
  static void stop_all();
  void start();
  void stop();
  void work();
  void drop_unowned();
  std::shared_ptr<BackgroundTask> next(int most_makers);
  bool wait_for_grace(const std::shared_ptr<BackgroundTask>& task);
  void run(const std::shared_ptr<BackgroundTask>& task, std::unique_lock<std::mutex>& lock, bool in_background);

  std::mutex mutex;  // guards all below
  std::condition_variable changed;
  std::deque<std::shared_ptr<BackgroundTask>> pending;
  std::atomic<std::uint64_t> pending_count{0};
  std::thread thread;
  bool is_running = false;
  pid_t thread_id = 0;  // of a running thread
  std::atomic<bool> is_stopping{false};
};

BackgroundWorker::State::Workers& BackgroundWorker::State::workers() {
  static Workers* const of_process = [] {
    Sha256().digest();  // libcrypto's cleanup is registered before stop_all(), and so runs after it
    std::atexit(stop_all);
    pthread_atfork([] { workers().mutex.lock(); }, [] { workers().mutex.unlock(); },
                   [] { workers().all.clear(), workers().mutex.unlock(); });
    return new Workers;
  }();
  return *of_process;
}

void BackgroundWorker::State::stop_all() {
  const std::lock_guard lock(workers().mutex);
  for (State* worker : workers().all) worker->stop();
}

BackgroundWorker::State::State() {
  const std::lock_guard lock(workers().mutex);
  workers().all.push_back(this);
}

BackgroundWorker::State::~State() {
  {
    const std::lock_guard lock(workers().mutex);
    std::erase(workers().all, this);
  }
  stop();
}

/// Starts the thread unless it runs. Without one, wait() does the tasks.
void BackgroundWorker::State::start() {
  if (is_running || is_stopping || pending.empty()) return;
  if (thread.joinable()) thread.join();
  try {
    thread = std::thread([this] { work(); });
    is_running = true;
  } catch (const std::system_error&) {
  }
}

void BackgroundWorker::State::stop() {
  {
    const std::lock_guard lock(mutex);
    is_stopping = true;
    // The caller's priority, where that is permitted: on a busy machine, the lowest one can delay the end by seconds.
    if (is_running && thread_id) setpriority(PRIO_PROCESS, static_cast<id_t>(thread_id), getpriority(PRIO_PROCESS, 0));
  }
  changed.notify_all();
  if (thread.joinable()) thread.join();
}

void BackgroundWorker::State::work() {
  std::unique_lock lock(mutex);
  thread_id = gettid();
  if (!is_stopping) work_last();  // stop() joins this thread, at the priority of its caller
  while (const auto task = is_stopping ? nullptr : next(0)) run(task, lock, true);
  is_running = false;
  thread_id = 0;
}

/// Removes tasks without a remaining owner.
void BackgroundWorker::State::drop_unowned() {
  std::erase_if(pending, [](const auto& task) { return task.use_count() == 1; });
  pending_count = pending.size();
}

/// The first pending task on which at most so many threads work, or null.
std::shared_ptr<BackgroundTask> BackgroundWorker::State::next(int most_makers) {
  drop_unowned();
  for (int makers = 0; makers <= most_makers; ++makers)
    for (const auto& task : pending)
      if (task->makers_ == makers) return task;
  return nullptr;
}

/// Returns whether something but this worker still holds the task.
bool BackgroundWorker::State::wait_for_grace(const std::shared_ptr<BackgroundTask>& task) {
  std::unique_lock lock(mutex);
  changed.wait_until(lock, task->added_ + kWorkGrace, [&] { return is_stopping || task->is_done_; });
  return task.use_count() > 1 + task->makers_;
}

void BackgroundWorker::State::run(const std::shared_ptr<BackgroundTask>& task, std::unique_lock<std::mutex>& lock,
                                  bool in_background) {
  ++task->makers_;
  lock.unlock();
  const WorkClock::time_point before = WorkClock::now();
  BackgroundTask::Result result;
  bool is_wanted = true;
  try {
    result = task->read();
    if (!result && in_background) is_wanted = wait_for_grace(task);
    if (!result && is_wanted && !is_stopping && !task->is_done_) result = task->make(is_stopping);
  } catch (const std::exception&) {  // no memory
  }
  lock.lock();
  --task->makers_;
  if (task->is_done_ || (!result && (is_stopping || !is_wanted))) return;
  task->is_done_ = true;
  task->take(std::move(result), WorkClock::now() - before);
  std::erase_if(pending, [&](const auto& other) { return other == task; });
  pending_count = pending.size();
  changed.notify_all();
}

BackgroundWorker::BackgroundWorker() : state_(std::make_unique<State>()), process_(getpid()) {}

BackgroundWorker::~BackgroundWorker() {
  if (getpid() != process_) static_cast<void>(state_.release());  // a lock or the condition may be in use for ever
}

void BackgroundWorker::add(const std::vector<std::shared_ptr<BackgroundTask>>& tasks) {
  const std::lock_guard lock(state_->mutex);
  for (const auto& task : tasks) task->added_ = WorkClock::now();
  state_->pending.insert(state_->pending.end(), tasks.begin(), tasks.end());
  state_->drop_unowned();
  state_->start();
}

bool BackgroundWorker::wait(std::chrono::nanoseconds timeout) {
  const WorkClock::time_point begin = WorkClock::now();
  const WorkClock::time_point until =
      timeout < WorkClock::time_point::max() - begin ? begin + timeout : WorkClock::time_point::max();
  std::unique_lock lock(state_->mutex);
  while (!state_->pending.empty() && WorkClock::now() < until) {
    if (const auto task = state_->next(1))
      state_->run(task, lock, false);
    else if (!state_->pending.empty())
      state_->changed.wait_until(lock, until);
  }
  return state_->pending.empty();
}

std::uint64_t BackgroundWorker::pending() const {
  return state_->pending_count;
}

}  // namespace clearance
