// The thread of tasks in the background: its priority, its end, and no teams of threads.
#include <gtest/gtest.h>
#include <omp.h>
#include <sys/resource.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <future>
#include <memory>
#include <thread>
#include <vector>

#include "engine/cache/background_worker.h"
#include "tests/patience.h"

namespace clearance {
namespace {

int own_priority() {
  return getpriority(PRIO_PROCESS, static_cast<id_t>(gettid()));
}

// Whether this process may raise the priority of its threads (CAP_SYS_NICE, or RLIMIT_NICE).
bool may_raise(int priority) {
  bool may = false;
  std::thread([&] {
    const auto thread = static_cast<id_t>(gettid());
    may = setpriority(PRIO_PROCESS, thread, 19) == 0 && setpriority(PRIO_PROCESS, thread, priority) == 0;
  }).join();
  return may;
}

// A task that works until it is stopped, and then until its thread has a priority.
class EndlessTask final : public BackgroundTask {
 public:
  explicit EndlessTask(int wanted) : wanted_(wanted) {}
  Result read() const override { return nullptr; }
  Result make(const std::atomic<bool>& stopped) const override {
    at_work = own_priority();
    has_begun = true;
    while (!stopped) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    const auto until = std::chrono::steady_clock::now() + kPatience;
    while (own_priority() != wanted_ && std::chrono::steady_clock::now() < until)
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    at_end = own_priority();
    return nullptr;
  }
  void take(Result, std::chrono::nanoseconds) override {}

  mutable std::atomic<bool> has_begun{false};
  mutable std::atomic<int> at_work{0}, at_end{0};

 private:
  const int wanted_;
};

TEST(BackgroundWorker, WorksAtTheLowestPriorityAndEndsAtThatOfItsOwner) {
  if (!may_raise(own_priority())) GTEST_SKIP() << "raising a priority needs CAP_SYS_NICE or RLIMIT_NICE";
  const auto task = std::make_shared<EndlessTask>(own_priority());
  {
    BackgroundWorker worker;
    worker.add({task});
    while (!task->has_begun) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  EXPECT_EQ(task->at_work, 19);
  EXPECT_EQ(task->at_end, own_priority());
}

/// Its result is the number of threads of a team, where it is made.
class TeamTask final : public BackgroundTask {
 public:
  std::future<int> threads() { return threads_.get_future(); }

  Result read() const override { return nullptr; }
  Result make(const std::atomic<bool>&) const override {
    threads_.set_value(omp_get_max_threads());
    return std::make_shared<const int>(0);
  }
  void take(Result, std::chrono::nanoseconds) override {}

 private:
  mutable std::promise<int> threads_;
};

TEST(BackgroundWorker, StartsNoTeamsOfThreads) {
  if (omp_get_max_threads() == 1) GTEST_SKIP() << "on one core OpenMP has one thread anyway";
  const auto task = std::make_shared<TeamTask>();
  std::future<int> threads = task->threads();
  BackgroundWorker worker;
  worker.add({task});
  EXPECT_EQ(threads.get(), 1);
}

}  // namespace
}  // namespace clearance
