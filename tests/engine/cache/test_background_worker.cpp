// BackgroundWorker: tasks leave the cores to the threads of queries.
#include <gtest/gtest.h>
#include <omp.h>

#include <future>

#include "engine/cache/background_worker.h"

namespace clearance {
namespace {

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
  if (omp_get_max_threads() == 1) GTEST_SKIP() << "no thread does here";
  const auto task = std::make_shared<TeamTask>();
  std::future<int> threads = task->threads();
  BackgroundWorker worker;
  worker.add({task});
  EXPECT_EQ(threads.get(), 1);
}

}  // namespace
}  // namespace clearance
