// A private LCM network for each test, on this host alone.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/lcm/lcm_network.h"
#include "tests/lcm/sample_query.h"
#include "tests/patience.h"

namespace clearance {

/// Skips tests if packets do not come back (no multicast route); test_lcm_route covers such machines.
class LcmTest : public testing::Test {
 protected:
  void SetUp() override {
    address_.port = free_udp_port();
    try {
      check_multicast(address_);
    } catch (const std::runtime_error& error) {
      GTEST_SKIP() << error.what();
    }
  }
  std::string url(const std::string& options = "") const { return address_.url() + options; }

  /// Handles the bus's messages until `done`, or fails the test after kPatience.
  static bool pump(LcmBus& bus, const std::function<bool()>& done) {
    const auto deadline = std::chrono::steady_clock::now() + kPatience;
    while (!done()) {
      if (!bus.wait(deadline)) return false;
      while (!done() && bus.handle()) {
      }
    }
    return true;
  }

  /// Repeats a call whose reply was lost (a busy machine drops packets); a wrong answer is not repeated.
  template <class Call>
  static auto patiently(Client& client, Call call) {
    client.set_timeout(std::chrono::seconds(3));
    for (const auto end = std::chrono::steady_clock::now() + kPatience; std::chrono::steady_clock::now() < end;) {
      try {
        return call();
      } catch (const TimeoutError&) {
      }
    }
    return call();
  }

  LcmAddress address_;
};

}  // namespace clearance
