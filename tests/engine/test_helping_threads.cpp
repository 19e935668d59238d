// Threads that help with work which its caller can do alone.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <thread>
#include <vector>

#include "engine/cost/helping_threads.h"

namespace clearance::test {
namespace {

TEST(HelpingThreads, WaitsForTheHelpersThatHaveBegun) {
  std::atomic<int> begun{0}, ended{0};
  std::atomic<bool> may_end{false};
  const auto work = [&] {
    ++begun;
    while (!may_end) std::this_thread::yield();
    ++ended;
  };
  std::thread gate;
  {
    const HelpingThreads help(3, work);
    while (begun < 2) std::this_thread::yield();
    gate = std::thread([&] { may_end = true; });
  }
  const int then = begun;
  EXPECT_EQ(ended, then);
  EXPECT_LE(then, 3);
  gate.join();
  {
    const HelpingThreads other(1, [] {});
  }
  EXPECT_EQ(begun, then) << "none begins after the scope";
}

TEST(HelpingThreads, CallersDoNotWaitForThoseOfOthers) {
  std::atomic<bool> has_begun{false}, may_end{false};
  std::atomic<int> others{0};
  {
    const HelpingThreads first(1, [&] {
      has_begun = true;
      while (!may_end) std::this_thread::yield();
    });
    while (!has_begun) std::this_thread::yield();
    {
      const HelpingThreads second(3, [&] { ++others; });
      while (others == 0) std::this_thread::yield();  // it has helpers of its own
    }  // ends although the helper of the first is busy
    may_end = true;
  }
  EXPECT_LE(others, 3);
}

TEST(HelpingThreads, ManyCallersAtOnceGetEveryPartDone) {
  std::vector<std::thread> callers;
  std::atomic<int> wrong{0};
  for (int c = 0; c < 4; ++c)
    callers.emplace_back([&] {
      const std::thread::id caller = std::this_thread::get_id();
      for (int round = 0; round < 200; ++round) {
        std::vector<int> done(100);
        std::atomic<std::size_t> next{0};
        std::atomic<bool> is_helped{false};
        const auto work = [&] {
          if (std::this_thread::get_id() != caller) is_helped = true;
          for (std::size_t i; (i = next++) < done.size();) ++done[i];
        };
        {
          const HelpingThreads help(3, work);
          while (round % 20 == 0 && !is_helped) std::this_thread::yield();
          work();
        }
        for (const int times : done) wrong += times != 1;
      }
    });
  for (std::thread& caller : callers) caller.join();
  EXPECT_EQ(wrong, 0);
}

TEST(HelpingThreads, AForkedChildHasHelpersOfItsOwn) {
  {
    std::atomic<bool> has_begun{false};
    const HelpingThreads help(2, [&] { has_begun = true; });
    while (!has_begun) std::this_thread::yield();
  }
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    alarm(60);
    {
      std::atomic<bool> has_begun{false};
      const HelpingThreads help(2, [&] { has_begun = true; });
      while (!has_begun) std::this_thread::yield();
    }
    _exit(0);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
}

}  // namespace
}  // namespace clearance::test
