// A daemon that is killed repeatedly: clients reconnect by themselves, and its remains block nothing.
#include <gtest/gtest.h>
#include <signal.h>

#include <thread>

#include "tests/faults/arena.h"
#include "tests/faults/rounds.h"
#include "tests/patience.h"

namespace clearance::faults {
namespace {

using namespace std::chrono_literals;

TEST(DaemonFaults, KilledAtAnyMomentItIsFoundAgainByItsClients) {
  const Exam exam(kScene, 2);
  Arena arena;
  Witnesses witnesses;
  const auto witness = [&](const std::string& url, std::chrono::nanoseconds timeout) {
    witnesses.push_back(std::make_unique<Witness>(url, exam, 20 + witnesses.size(), 0.5, timeout));
  };
  witness(arena.shm(), kPatience);
  witness(arena.shm() + "?spin_us=0", kPatience);
  witness(arena.zmq(), kPatience);
  if (arena.has_lcm()) witness(arena.lcm(), 1s);  // for which a death is a timeout
  const Census before = arena.census();

  std::mt19937_64 random(4);
  const int kills = rounds(3);
  for (int kill = 0; kill < kills; ++kill) {
    // No call may hang: each client gets correct answers after each death, or this test fails.
    ASSERT_EQ(await_answers(witnesses, 2), "");
    std::this_thread::sleep_for(std::chrono::microseconds(random() % 20000));  // the moment is the fault
    arena.kill_and_restart();
    ASSERT_FALSE(testing::Test::HasFailure());
  }
  // All queries again, so that segments have the same size as before. Then the last daemon holds the same resources as
  // the first.
  ASSERT_EQ(await_answers(witnesses, 3 * exam.queries().size()), "");
  const Census now = arena.census();
  EXPECT_EQ(left_behind(before, now), "") << "at first " << before.text() << "; now " << now.text();
  Client client = patient(arena.shm());
  EXPECT_EQ(unbalanced(stats_of(client)), "");

  std::uint64_t in_flight = 0;
  for (const auto& w : witnesses) {
    w->stop();
    const Witness::Counts counts = w->counts();
    EXPECT_EQ(counts.wrong + counts.busy + counts.others, 0u) << w->url();
    const bool connected = w->url().rfind("udpm://", 0) != 0;
    if (connected) {
      EXPECT_GE(counts.lost, static_cast<std::uint64_t>(kills)) << w->url() << ": a death was passed over in silence";
      EXPECT_EQ(counts.late, 0u) << w->url() << ": a death was not noticed";
    }
    EXPECT_GE(counts.renewed, static_cast<std::uint64_t>(kills)) << w->url() << ": a new daemon was taken for the old";
    for (const std::string& text : w->complaints())
      in_flight += text.find("the daemon is gone") != std::string::npos || text.find("has gone") != std::string::npos;
    if (testing::Test::HasFailure())
      for (const std::string& text : w->complaints()) ADD_FAILURE() << text;
  }
  EXPECT_GT(in_flight, 0u) << "no call was ever under way when the daemon died";
  EXPECT_EQ(arena.end(), 0);
  EXPECT_EQ(entries_of(arena.folder()), std::vector<std::string>{}) << "the last daemon cleans up after all of them";
}

TEST(DaemonFaults, SignalledAllTheTimeItMissesNoRequest) {
  const Exam exam(kScene, 5);
  Arena arena;
  Witnesses witnesses;
  for (const std::string& url : arena.urls())
    witnesses.push_back(std::make_unique<Witness>(url, exam, 40 + witnesses.size()));
  Client client = patient(arena.zmq());
  Stats stats;
  std::mt19937_64 random(6);
  do {  // SIGHUP reloads the scene; interrupted calls must continue
    for (int i = 0; i < 50; ++i) {
      kill(arena.daemon().pid(), SIGHUP);
      std::this_thread::sleep_for(std::chrono::microseconds(random() % 500));
    }
    ASSERT_EQ(await_answers(witnesses, 1), "");
    stats = stats_of(client);
  } while (stats["reloads"] < static_cast<std::uint64_t>(rounds(100)));
  EXPECT_EQ(unbalanced(stats), "");
  EXPECT_EQ(stats["errors.internal"] + stats["errors.transport"] + stats["reloads.failed"], 0u);
  for (const auto& witness : witnesses) {
    witness->stop();
    const Witness::Counts counts = witness->counts();
    EXPECT_EQ(counts.wrong + counts.lost + counts.busy + counts.others, 0u) << witness->url();
  }
  EXPECT_EQ(arena.end(), 0);
}

}  // namespace
}  // namespace clearance::faults
