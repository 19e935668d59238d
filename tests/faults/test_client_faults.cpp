// Clients that die, freeze or corrupt memory at any point, while witnesses check every bit.
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <cstdlib>
#include <thread>

#include "engine/base/sanitizers.h"
#include "tests/faults/arena.h"
#include "tests/faults/rounds.h"
#include "tests/patience.h"

namespace clearance::faults {
namespace {

using namespace std::chrono_literals;

class ClientFaults : public testing::Test {
 protected:
  void SetUp() override {
    for (const std::string& url : arena_.urls())
      witnesses_.push_back(std::make_unique<Witness>(url, exam_, 10 + witnesses_.size(), 0.3));
    before_ = arena_.census();
  }

  /// Checks the state that must hold after any fault of clients.
  void expect_unharmed() {
    EXPECT_EQ(arena_.await_census(before_), "");
    ASSERT_EQ(await_answers(witnesses_, 3), "");
    Client client = patient(arena_.zmq());
    const Stats stats = stats_of(client);
    EXPECT_EQ(unbalanced(stats), "");
    EXPECT_EQ(stats.contains("errors.transport"), false);
  }
  void expect_all_right() {
    for (const auto& witness : witnesses_) {
      const Witness::Counts counts = witness->counts();
      EXPECT_GT(counts.right, exam_.queries().size());
      EXPECT_EQ(counts.wrong, 0u);
      EXPECT_EQ(counts.lost + counts.busy + counts.others, 0u);
      if (!may_lose(witness->url())) {
        EXPECT_EQ(counts.late, 0u);
      }
      if (HasFailure())
        for (const std::string& complaint : witness->complaints()) ADD_FAILURE() << complaint;
    }
  }

  const Exam exam_{kScene, 1};
  Arena arena_;
  Witnesses witnesses_;
  Census before_;
};

TEST_F(ClientFaults, KilledAtEveryPointTheyLeaveNothingBehind) {
  std::uint64_t seed = 0;
  for (int round = 0; round < rounds(1); ++round)
    for (const std::string& url : arena_.urls()) {
      for (const std::string_view point : points_of(url))
        ASSERT_EQ(arena_.talk(url, point, SIGKILL, ++seed).await_end(), -SIGKILL)
            << url << ": the talk did not come to the point " << point;
      expect_unharmed();
      ASSERT_FALSE(HasFailure()) << "after round " << round << " over " << url;
    }
  EXPECT_EQ(arena_.talk(arena_.shm(), "", SIGKILL, 1).await_end(), 0) << "a talk that nothing happens to";
  EXPECT_EQ(arena_.talk(arena_.zmq(), "", SIGKILL, 1).await_end(), 0);
  RecordProperty("kills", static_cast<int>(seed));
  Client client = patient(arena_.zmq());
  EXPECT_GT(stats_of(client)["requests.dropped"], 0u) << "no request was ever under way when its client died";
  expect_all_right();
}

TEST_F(ClientFaults, KilledAtAnyMomentTheyLeaveNothingBehind) {
  std::mt19937_64 random(3);
  for (int round = 0; round < rounds(6); ++round) {
    for (const std::string& url : arena_.urls()) {
      Victim victim({"query", url, std::to_string(random())});
      // Between its start and a few requests later: the moment is the fault.
      std::this_thread::sleep_for(std::chrono::microseconds(random() % 40000));
      victim.signal(SIGKILL);
      ASSERT_EQ(victim.await_end(), -SIGKILL);
    }
    ASSERT_EQ(arena_.await_census(before_), "") << "after round " << round;
  }
  expect_unharmed();
  expect_all_right();
}

TEST_F(ClientFaults, FrozenAtEveryPointTheyKeepNoOthersWaiting) {
  for (const std::string& url : arena_.urls()) {
    const auto points = points_of(url);
    for (std::size_t first = 0; first < points.size(); first += 6) {
      std::vector<Victim> frozen;
      for (std::size_t i = first; i < std::min(first + 6, points.size()); ++i) {
        frozen.push_back(arena_.talk(url, points[i], SIGSTOP, i));
        ASSERT_TRUE(frozen.back().await_stop()) << url << ": the talk did not come to the point " << points[i];
      }
      ASSERT_EQ(await_answers(witnesses_, 5), "");
      for (std::size_t i = 0; i < frozen.size(); ++i) {
        frozen[i].signal(i % 2 ? SIGKILL : SIGCONT);
        const int code = frozen[i].await_end();
        // A connection that is silent for five seconds is closed, even if the client was stopped.
        const bool silent = points[first + i] == "connected";
        EXPECT_TRUE(code == (i % 2 ? -SIGKILL : 0) || (silent && code == 1))
            << url << ", frozen at " << points[first + i] << ": ended with " << code;
      }
    }
    expect_unharmed();
  }
  expect_all_right();
}

TEST_F(ClientFaults, ScribblingOverEveryByteTheyHurtOnlyThemselves) {
  const auto served = [&] {
    Client client = patient(arena_.zmq());
    return stats_of(client);
  };
  Stats begin = served(), now = begin;
  const auto grown = [&](const char* name) { return now[name] - begin[name]; };
  const auto wanted = static_cast<std::uint64_t>(rounds(1));
  {
    Victim one({"scribble", arena_.shm(), "5"}), other({"scribble", arena_.shm(), "6"});
    const auto deadline = std::chrono::steady_clock::now() + kPatience * rounds(1);
    do {
      ASSERT_EQ(await_answers(witnesses_, 5), "");
      now = served();
      ASSERT_LT(std::chrono::steady_clock::now(), deadline);
    } while (grown("shm.connections") < 25 * wanted || grown("shm.violations") < 3 * wanted ||
             grown("errors.bad_frame") < 5 * wanted || grown("errors.bad_query") < 2 * wanted ||
             grown("replies") < 100 * wanted);
    one.signal(SIGKILL);
    other.signal(SIGKILL);
    EXPECT_EQ(one.await_end(), -SIGKILL);
    EXPECT_EQ(other.await_end(), -SIGKILL);
  }
  expect_unharmed();
  expect_all_right();
  EXPECT_EQ(now["errors.internal"], 0u);
}

/// Serves clients over shared memory, one after the other, each with all queries of an exam whose answers are small.
/// The daemon keeps buffers of large ones.
void serve_small(const Arena& arena, const Exam& exam, int clients) {
  std::size_t served = 0;
  for (int i = 0; i < clients; ++i) {
    Client client = patient(arena.shm());
    for (const auto& known : exam.queries()) {
      if (known->answer.size() > 4096) continue;
      ASSERT_TRUE(is_right(client.distances(known->query), *known));
      ++served;
    }
  }
  ASSERT_GE(served, 3u * clients);
}

/// Waits until a daemon's counters meet a condition, at most kPatience, and returns them.
template <class Condition>
Stats await_stats(Client& counters, const Condition& condition) {
  const auto deadline = std::chrono::steady_clock::now() + kPatience;
  Stats now = stats_of(counters);
  while (!condition(now) && std::chrono::steady_clock::now() < deadline) {
    std::this_thread::sleep_for(20ms);
    now = stats_of(counters);
  }
  return now;
}

/// Counters of a daemon that has freed the sessions of clients over shared memory, and has read its heaps since then.
Stats without_sessions(Client& counters) {
  const Stats gone = await_stats(counters, [](Stats& now) {
    return now["shm.clients"] == 0 && now["requests.waiting"] == 1;  // that of the counters
  });
  EXPECT_EQ(gone.at("shm.clients"), 0u);
  // Heaps are read once a second, and the uptime is rounded down.
  return await_stats(counters, [&](Stats& now) { return now["uptime_s"] >= gone.at("uptime_s") + 2; });
}

TEST(ClientMemory, ClientsThatAreGoneLeaveNoneAllocated) {
#if defined(CLEARANCE_ASAN) || defined(CLEARANCE_TSAN)
  GTEST_SKIP() << "sanitizers replace the allocator whose counters this test reads";
#endif
  setenv("CLEARANCE_HEAP_COUNTERS", "1", 1);  // for this test's daemon
  constexpr int kClients = 300;               // more than the idle clients that the daemon's queues keep
  const Exam exam(kScene, 1);
  const Arena arena;
  Client counters = patient(arena.zmq());
  serve_small(arena, exam, kClients);
  const std::uint64_t before = without_sessions(counters).at("heap.used_bytes"), limit = before + 200 * kClients;
  EXPECT_GT(before, 0u);
  serve_small(arena, exam, kClients);
  without_sessions(counters);
  const Stats now = await_stats(counters, [&](Stats& stats) { return stats["heap.used_bytes"] < limit; });
  const std::uint64_t after = now.at("heap.used_bytes");
  EXPECT_LT(after, limit) << "bytes after " << kClients << " clients";
  unsetenv("CLEARANCE_HEAP_COUNTERS");
  RecordProperty("grown", static_cast<int>(after) - static_cast<int>(before));
}

}  // namespace
}  // namespace clearance::faults
