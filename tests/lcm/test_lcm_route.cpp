// A machine without a multicast route: reported before anything is opened, with a remedy that works.
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/wait.h>

#include <cstdlib>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>

#include "client/channel/channel.h"
#include "client/client.h"
#include "tests/lcm/lcm_fixture.h"
#include "wire/lcm/lcm_bus.h"

namespace clearance {
namespace {

/// Runs `body` in a child with an empty network, in which even the loopback is down, and returns its result. Returns
/// nothing if this user may not create such a network.
std::optional<std::string> in_empty_network(const std::function<std::string()>& body) {
  int ends[2];
  if (::pipe(ends) != 0) return std::nullopt;
  const pid_t child = ::fork();
  if (child == 0) {
    ::close(ends[0]);
    if (::unshare(CLONE_NEWNET) != 0 && ::unshare(CLONE_NEWUSER | CLONE_NEWNET) != 0) ::_exit(77);
    const std::string text = body();
    const bool written = ::write(ends[1], text.data(), text.size()) == static_cast<ssize_t>(text.size());
    ::_exit(written ? 0 : 1);
  }
  ::close(ends[1]);
  std::string text;
  char buffer[4096];
  for (ssize_t size = 0; (size = ::read(ends[0], buffer, sizeof buffer)) > 0;) text.append(buffer, size);
  ::close(ends[0]);
  int status = 0;
  ::waitpid(child, &status, 0);
  if (WIFEXITED(status) && WEXITSTATUS(status) == 77) return std::nullopt;
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
  return text;
}

std::string error_of(const std::function<void()>& call) {
  try {
    call();
    return "no error";
  } catch (const std::exception& error) {
    return error.what();
  }
}

const std::string kRemedy =
    "; to keep LCM on this host, run (as root):  ip link set lo up; ip route add 239.255.76.67/32 dev lo";

TEST(LcmRoute, IsMissing) {
  const auto text = in_empty_network([] {
    return error_of([] { LcmBus bus{LcmAddress()}; }) + "\n" +
           error_of([] { open_lcm_channel("udpm://239.255.76.67:7667?ttl=0", "", Deadline::clock::now()); });
  });
  if (!text) GTEST_SKIP() << "this user may not make a network namespace";
  const std::string what =
      "LCM: no multicast route to 239.255.76.67: cannot send there (Network is unreachable)" + kRemedy;
  EXPECT_EQ(*text, what + "\nudpm://239.255.76.67:7667?ttl=0: " + what);
}

TEST(LcmRoute, TheRemedyWorks) {
  const auto text = in_empty_network([&] {
    const std::string commands = kRemedy.substr(kRemedy.find("ip link"));
    if (std::system((commands + " 2>/dev/null").c_str()) != 0) return std::string("no ip");
    return error_of([] {
      LcmBus bus{LcmAddress()};
      int got = 0;
      bus.subscribe("A", 1, [&](std::span<const std::byte>) { ++got; });
      bus.publish("A", {});
      if (!bus.wait(std::chrono::steady_clock::now() + std::chrono::seconds(10)) || !bus.handle() || got != 1) {
        throw std::runtime_error("nothing came back");
      }
    });
  });
  if (!text) GTEST_SKIP() << "this user may not make a network namespace";
  if (*text == "no ip") GTEST_SKIP() << "no ip command that may change routes";
  EXPECT_EQ(*text, "no error");
}

TEST(LcmRoute, TheGroupCannotBeJoined) {
  // A route alone is not enough: this kernel does not allow joining a group.
  const auto text = in_empty_network([] {
    if (std::system("{ ip link set lo up && ip route add 239.255.76.67/32 dev lo && "
                    "echo 0 > /proc/sys/net/ipv4/igmp_max_memberships; } 2>/dev/null") != 0) {
      return std::string("no ip");
    }
    return error_of([] { check_multicast(LcmAddress()); });
  });
  if (!text || *text == "no ip") GTEST_SKIP() << "no network namespace, or no ip command that may change routes";
  EXPECT_EQ(*text, "LCM: no multicast route to 239.255.76.67: the group cannot be joined (No buffer space available)" +
                       kRemedy);
}

}  // namespace
}  // namespace clearance
