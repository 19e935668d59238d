// Waits of a client: detection of a hang, with simulated clocks and heartbeats, and the choice of the spin time.
#include <gtest/gtest.h>

#include "client/channel/hang_watch.h"
#include "client/channel/reply_spin.h"

namespace clearance {
namespace {

using namespace std::chrono_literals;

/// A channel that only shows signs of life, or none.
class Signs final : public Channel {
 public:
  std::byte* begin(std::uint64_t, std::uint64_t) override { return nullptr; }
  void send() override {}
  std::unique_ptr<Frame> receive(std::uint64_t, Deadline) override { return nullptr; }
  void forget(std::uint64_t) override {}
  std::string url() const override { return ""; }
  std::uint64_t sign_of_life() override {
    ++requested;
    return sign;
  }
  std::uint64_t sign = 7;
  int requested = 0;
};

class Watched : public testing::Test {
 protected:
  /// Checks whenever it is due. Returns the time until the channel counts as hung, or zero if it does not within a
  /// minute.
  template <class Live>
  std::chrono::nanoseconds until_hung(Live live) {
    const Deadline begin = now_;
    while (now_ < begin + 60s) {
      now_ = std::max(now_ + 1ms, watch_.due());
      live();
      if (watch_.look(signs_, now_)) return now_ - begin;
    }
    return 0ns;
  }
  HangWatch watch_{800ms};
  Signs signs_;
  Deadline now_{1000h};
};

TEST_F(Watched, SignsThatStandStillAreAHang) {
  const auto took = until_hung([] {});
  EXPECT_GE(took, 800ms);
  EXPECT_LE(took, 1000ms + 1ms);
}

TEST_F(Watched, SignsThatMoveAreNone) {
  int looks = 0;
  EXPECT_EQ(until_hung([&] { signs_.sign += ++looks % 7 == 0; }), 0ns) << "once in seven looks is enough";
  EXPECT_GT(looks, 100);
}

TEST_F(Watched, ADaemonThatShowsNoneIsNotTakenForDead) {
  signs_.sign = 0;
  EXPECT_EQ(until_hung([] {}), 0ns);
}

TEST_F(Watched, TimeInWhichWeDidNotRunDoesNotCount) {
  EXPECT_FALSE(watch_.look(signs_, now_)) << "nobody waited before";
  EXPECT_EQ(signs_.requested, 0);
  for (int i = 0; i < 100; ++i) {
    now_ += 10s;  // stopped, or suspended together with the daemon
    EXPECT_FALSE(watch_.look(signs_, now_));
  }
  EXPECT_NE(until_hung([] {}), 0ns) << "now it runs";
}

TEST_F(Watched, WhatQueuesUpBehindLargeFramesIsWaitedFor) {
  watch_.expect(1000);
  EXPECT_LE(until_hung([] {}), 1001ms) << "small ones take no time";
  HangWatch patient(800ms);
  watch_ = patient;
  now_ = Deadline::clock::now();
  watch_.expect(100 << 20);  // 10 s at 10 MB/s
  const auto took = until_hung([] {});
  EXPECT_GE(took, 10s);
  EXPECT_LE(took, 13s);
}

TEST(HangWatch, IsOffWithoutPatience) {
  EXPECT_EQ(HangWatch(0ns).due(), Deadline::max());
}

TEST(ReplySpin, LastsAsLongAsRequestsOfThatSizeTook) {
  ReplySpin spins(20us);
  EXPECT_EQ(spins.next(1000), 20us) << "nothing is known";
  for (int i = 0; i < 40; ++i) spins.replied(1000, 140us);
  const auto spin = spins.next(1000);
  EXPECT_TRUE(spins.is_long(spin));
  EXPECT_GT(spin, 140us);
  EXPECT_LT(spin, 300us);
  EXPECT_EQ(spins.next(2000), 20us) << "another request";
  for (int i = 0; i < 40; ++i) spins.replied(1000, 5us);
  EXPECT_EQ(spins.next(1000), 20us) << "short ones keep the base time";
}

TEST(ReplySpin, DoesNotBurnACoreForLongRequests) {
  ReplySpin spins(20us);
  for (int i = 0; i < 40; ++i) spins.replied(1000, ReplySpin::kLongest + 100us);
  EXPECT_EQ(spins.next(1000), 20us);
}

TEST(ReplySpin, YieldsTheCoreToOtherThreads) {
  ReplySpin spins(20us);
  for (int i = 0; i < 40; ++i) spins.replied(1000, 140us);
  ASSERT_TRUE(spins.is_long(spins.next(1000)));
  spins.preempted();
  unsigned shorter = 0;
  while (!spins.is_long(spins.next(1000))) ASSERT_LT(++shorter, 10 * ReplySpin::kPause);
  EXPECT_EQ(shorter, ReplySpin::kPause - 1) << "then it tries again";
}

TEST(ReplySpin, StopsWhereItDoesNotPay) {
  ReplySpin spins(20us);
  for (int i = 0; i < 40; ++i) spins.replied(1000, 140us);
  for (int i = 0; i < SpinGate::kMisses; ++i) spins.spun(spins.next(1000), false);
  EXPECT_EQ(spins.next(1000), 20us) << "long spins stop, short ones have not failed yet";
  for (int i = 0; i < SpinGate::kMisses; ++i) spins.spun(20us, false);
  EXPECT_EQ(spins.next(1000), 0us);
}

TEST(ReplySpin, NeverSpinsWithABaseOfZero) {
  ReplySpin spins(0us);
  for (int i = 0; i < 40; ++i) spins.replied(1000, 140us);
  EXPECT_EQ(spins.next(1000), 0us);
}

}  // namespace
}  // namespace clearance
