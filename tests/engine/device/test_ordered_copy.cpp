// Parallel copies whose first part is used before the last part is copied.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <numeric>
#include <thread>

#include "engine/device/query/ordered_copy.h"

namespace clearance::test {
namespace {

TEST(OrderedCopy, HasWhatWasWaitedForWhateverTheOthersDo) {
  constexpr std::size_t kBlock = 1u << 16;
  for (const cuda::CopyReader reader : {cuda::CopyReader::kHost, cuda::CopyReader::kDevice})
    for (const std::size_t bytes :
         {std::size_t{0}, std::size_t{1}, kBlock - 1, kBlock, 12 * kBlock, 40 * kBlock + 4099})
      for (const int helpers : {0, 1, 3}) {
        std::vector<unsigned char> room_from(bytes + 3), to(bytes + 16);
        unsigned char* const from = room_from.data() + 3;  // unaligned
        std::iota(from, from + bytes, static_cast<unsigned char>(7));
        auto* const target = to.data() + (16 - reinterpret_cast<std::uintptr_t>(to.data()) % 16) % 16;
        cuda::OrderedCopy copy(from, target, bytes, reader);
        std::vector<std::thread> threads;
        for (int i = 0; i < helpers; ++i)
          threads.emplace_back([&] {
            while (copy.copy_block()) {
            }
          });
        for (std::size_t there = 0; there <= bytes; there += 3 * kBlock + 17) {
          copy.wait_for(there);
          EXPECT_EQ(std::memcmp(from, target, there), 0) << bytes << " bytes, " << there << " of them waited for";
        }
        copy.wait_for(bytes);
        EXPECT_EQ(std::memcmp(from, target, bytes), 0) << bytes << " bytes";
        for (std::thread& t : threads) t.join();
        EXPECT_FALSE(copy.copy_block()) << "none is left";
      }
}

TEST(CopyHelp, WaitsForTheHelpersThatHaveBegun) {
  std::atomic<int> begun{0}, ended{0};
  std::atomic<bool> may_end{false};
  const auto work = [&] {
    ++begun;
    while (!may_end) std::this_thread::yield();
    ++ended;
  };
  std::thread gate;
  {
    const cuda::CopyHelp help(3, work);
    while (begun < 2) std::this_thread::yield();
    gate = std::thread([&] { may_end = true; });
  }
  const int then = begun;
  EXPECT_EQ(ended, then);
  EXPECT_LE(then, 3);
  gate.join();
  {
    const cuda::CopyHelp other(1, [] {});
  }
  EXPECT_EQ(begun, then) << "none begins after the scope";
}

TEST(CopyHelp, OneCopyHasTheHelpers) {
  std::atomic<bool> has_begun{false}, may_end{false};
  std::atomic<int> others{0};
  {
    const cuda::CopyHelp help(1, [&] {
      has_begun = true;
      while (!may_end) std::this_thread::yield();
    });
    while (!has_begun) std::this_thread::yield();
    {
      const cuda::CopyHelp second(3, [&] { ++others; });
    }  // at once, although the helper of the first is busy
    may_end = true;
  }
  EXPECT_EQ(others, 0);
  {
    const cuda::CopyHelp third(3, [&] { ++others; });
    while (others == 0) std::this_thread::yield();
  }
}

TEST(CopyHelp, AForkedChildHasHelpersOfItsOwn) {
  {
    std::atomic<bool> has_begun{false};
    const cuda::CopyHelp help(2, [&] { has_begun = true; });
    while (!has_begun) std::this_thread::yield();
  }
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    alarm(60);
    {
      std::atomic<bool> has_begun{false};
      const cuda::CopyHelp help(2, [&] { has_begun = true; });
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
