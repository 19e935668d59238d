// Conditions under which the loop polls, sleeps and wakes up.
#include <gtest/gtest.h>

#include <thread>

#include "tests/server/core/loop_fixture.h"
#include "wire/spin_gate.h"

namespace clearance {
namespace {

TEST(SpinGate, IsGivenUpWhereItDoesNotPayAndTriedAgain) {
  SpinGate gate;
  for (int i = 0; i < SpinGate::kMisses; ++i) {
    EXPECT_TRUE(gate.opens()) << i;
    gate.missed();
  }
  int opened = 0;
  for (unsigned i = 0; i < 10 * SpinGate::kProbeEvery; ++i)
    if (gate.opens()) ++opened, gate.missed();
  EXPECT_EQ(opened, 10) << "one wait of 64";
  while (!gate.opens()) {
  }
  gate.paid();
  EXPECT_TRUE(gate.opens());
  EXPECT_TRUE(gate.opens());
}

TEST_F(LoopTest, SleepsWakesAndStops) {
  Loop::Options options;
  options.spin = 0ns;
  options.tick = 10s;  // only the descriptor can wake it in time
  start(small_scene(), options);
  std::thread server([&] { loop_->run(); });
  for (int i = 0; i < 20; ++i) {
    const int before = transport_->sleeps;
    transport_->send(a_, small_query().frame(1));
    transport_->wait_for_reply();
    while (transport_->sleeps == before) std::this_thread::sleep_for(100us);
  }
  loop_->stop();
  server.join();
  EXPECT_EQ(a_.replies.size(), 20u);
  EXPECT_GE(loop_->counter("loop.sleeps"), 20u);
}

/// Counts the loop's ticks.
class TickingTransport final : public Transport {
 public:
  std::string url() const override { return "ticking://"; }
  std::vector<int> descriptors() const override { return {}; }
  int poll(RequestHandler&) override { return 0; }
  void tick(RequestHandler&) override { ++ticks; }
  std::atomic<int> ticks{0};
};

TEST_F(LoopTest, OnceWokenItSleepsAgain) {
  Loop::Options options;
  options.spin = 0ns;
  options.tick = 20ms;
  start(small_scene(), options);
  loop_->reload_by([] { return std::make_unique<engine::Engine>(small_scene()); });
  auto ticking = std::make_unique<TickingTransport>();
  const TickingTransport& transport = *ticking;
  loop_->add(std::move(ticking));
  std::thread server([&] { loop_->run(); });
  const auto sleeps_in_five_ticks = [&] {
    const int first = transport.ticks;
    while (transport.ticks < first + 1) std::this_thread::sleep_for(1ms);  // the work that woke it is done
    const int begin = transport_->sleeps, tick = transport.ticks;
    while (transport.ticks < tick + 5) std::this_thread::sleep_for(1ms);
    return transport_->sleeps - begin;
  };
  // Only the next tick ends an idle loop's sleep, however much a busy machine delays it.
  EXPECT_LE(sleeps_in_five_ticks(), 15) << "nothing has woken it";
  EXPECT_TRUE(loop_->read_metrics(30s));
  EXPECT_LE(sleeps_in_five_ticks(), 15) << "after a look at its figures";
  loop_->reload();
  const auto reloads = [&] {
    const auto metrics = loop_->read_metrics(30s);
    for (const auto& [name, value] : metrics->counters)
      if (name == "reloads") return value;
    return std::uint64_t{0};
  };
  while (reloads() == 0) std::this_thread::sleep_for(1ms);
  EXPECT_LE(sleeps_in_five_ticks(), 15) << "after a reload";
  loop_->stop();
  server.join();
}

/// Its descriptor stays readable, like a listener's if there is no descriptor to accept with.
class NaggingTransport final : public Transport {
 public:
  NaggingTransport() : fd_(eventfd(1, EFD_CLOEXEC)) {}
  ~NaggingTransport() override { close(fd_); }
  std::string url() const override { return "nagging://"; }
  std::vector<int> descriptors() const override { return {fd_}; }
  int poll(RequestHandler&) override {
    ++polls;
    return 0;
  }
  std::atomic<std::uint64_t> polls{0};

 private:
  int fd_;
};

TEST_F(LoopTest, ADescriptorThatStaysReadableDoesNotKeepItBusy) {
  Loop::Options options;
  options.spin = 0ns;
  start(small_scene(), options);
  auto nagging = std::make_unique<NaggingTransport>();
  NaggingTransport& transport = *nagging;
  loop_->add(std::move(nagging));
  std::thread server([&] { loop_->run(); });
  const auto begin = std::chrono::steady_clock::now();
  while (transport.polls < 300)
    std::this_thread::sleep_for(1ms);  // 100 of them without a pause, then one per millisecond
  const auto wall = std::chrono::steady_clock::now() - begin;
  loop_->stop();
  server.join();
  EXPECT_GE(wall, 150ms);
}

}  // namespace
}  // namespace clearance
