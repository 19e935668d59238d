// Restrictions of a gateway process: the system calls that it may use, and the messages that peers may send before
// authentication.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdint>
#include <fstream>
#include <thread>

#include "engine/base/sanitizers.h"
#include "server/gateway/confine.h"
#include "server/gateway/zmtp_gate.h"
#include "tests/server/gateway/raw_tcp.h"

namespace clearance::gateway {
namespace {

constexpr int kForbidden = 5, kDone = 0, kUnfiltered = 77;

/// Queries the kernel, so that a filter that it has but does not install counts as a failure.
bool kernel_has_filters() {
  std::uint32_t action = SECCOMP_RET_KILL_PROCESS;
  return ::syscall(SYS_seccomp, SECCOMP_GET_ACTION_AVAIL, 0, &action) == 0;
}

/// How a process ends that is confined and then calls `act`.
int ending(std::string (*confine)(), void (*act)()) {
  const pid_t child = ::fork();
  if (child == 0) {
    if (!confine().empty()) ::_exit(kUnfiltered);
    act();
    ::_exit(kDone);
  }
  int status = 0;
  EXPECT_EQ(::waitpid(child, &status, 0), child);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

void read_file() {
  (void)!::open("/etc/passwd", O_RDONLY);
}
void write_file() {
  (void)!::open("/tmp/clearance-gateway-test", O_WRONLY | O_CREAT, 0600);
}
void fork_off() {
  (void)!::fork();
}
void run_program() {
  ::execl("/bin/true", "true", nullptr);
}
void signal_another() {
  ::kill(::getppid(), 0);
}
void connect_by_tcp() {
  (void)!::socket(AF_INET, SOCK_STREAM, 0);
}
void connect_by_unix() {
  (void)!::socket(AF_UNIX, SOCK_STREAM, 0);
}
void copy_descriptor() {
  (void)!::fcntl(0, F_DUPFD, 50);
}
void trace() {
  ::prctl(PR_SET_DUMPABLE, 1);
}
void send_descriptors() {
  msghdr message{};
  ::sendmsg(kLinkFd, &message, 0);
}
void accept_elsewhere() {
  ::accept4(kLinkFd, nullptr, nullptr, 0);
}
void open_datagrams() {
  (void)!::socket(AF_INET, SOCK_DGRAM, 0);
}
void start_thread() {
  std::thread([] {}).join();
}
void live() {
  std::string memory(10 << 20, 'x');
  (void)!::write(1, memory.data(), 0);
}

TEST(Confined, DoesNothingButItsConnections) {
  if (!kernel_has_filters()) GTEST_SKIP() << "this kernel has no filters";
  EXPECT_EQ(ending(&confine_to_connections, &live), kDone);
  for (void (*act)() :
       {&read_file, &write_file, &fork_off, &run_program, &signal_another, &connect_by_tcp, &connect_by_unix,
        &open_datagrams, &copy_descriptor, &trace, &send_descriptors, &accept_elsewhere})
    EXPECT_EQ(ending(&confine_to_connections, act), kForbidden);
}

TEST(Confined, ToDatagramsItOpensThemAndBeginsThreadsAndWritesNoFile) {
  if (!kernel_has_filters()) GTEST_SKIP() << "this kernel has no filters";
  for (void (*act)() : {&live, &open_datagrams, &start_thread}) EXPECT_EQ(ending(&confine_to_datagrams, act), kDone);
  for (void (*act)() : {&write_file, &fork_off, &run_program, &signal_another, &connect_by_tcp, &connect_by_unix,
                        &copy_descriptor, &trace, &send_descriptors})
    EXPECT_EQ(ending(&confine_to_datagrams, act), kForbidden);
}

bool passes(std::string_view said, std::size_t at_a_time = 1'000'000) {
  ZmtpGate gate;
  for (; !said.empty(); said.remove_prefix(std::min(at_a_time, said.size())))
    if (!gate.pass(std::as_bytes(std::span(said.substr(0, at_a_time))))) return false;
  return true;
}

std::string command(std::size_t bytes) {
  return RawTcp::head(4, bytes) + std::string(bytes, 'x');
}
std::string short_command(std::size_t bytes) {
  return std::string("\4") + static_cast<char>(bytes) + std::string(bytes, 'x');
}

TEST(ZmtpGate, AHandshakePassesHoweverItIsCut) {
  const std::string greeting = RawTcp::greeting("CURVE");
  const std::string handshake = greeting + short_command(200) + command(300);
  for (const std::size_t cut : {1u, 2u, 7u, 64u, 65u, 1000u}) {
    EXPECT_TRUE(passes(handshake, cut)) << cut;
    EXPECT_TRUE(passes(handshake + RawTcp::head(0, 1 << 28), cut)) << "what comes then is libzmq's affair";
  }
  ZmtpGate gate;
  const std::string most = greeting + short_command(200) + command(300).substr(0, 308);
  EXPECT_TRUE(gate.pass(std::as_bytes(std::span(most))));
  EXPECT_FALSE(gate.is_open()) << "a byte is missing";
  EXPECT_TRUE(gate.pass(std::as_bytes(std::span(most)).first(1)));
  EXPECT_TRUE(gate.is_open());
}

TEST(ZmtpGate, WhatNoClientSaysBeforeAHandshakeDoesNot) {
  const std::string greeting = RawTcp::greeting("CURVE");
  std::string older = greeting;
  older[10] = 1;
  for (const std::size_t cut : {1u, 1000u}) {
    EXPECT_FALSE(passes("GET / HTTP/1.1\r\n", cut));
    EXPECT_FALSE(passes(older, cut));
    EXPECT_FALSE(passes(greeting + RawTcp::head(4, ZmtpGate::kMaxCommandBytes + 1), cut));
    EXPECT_FALSE(passes(greeting + RawTcp::head(4, ~std::uint64_t{0}), cut));
    EXPECT_FALSE(passes(greeting + RawTcp::head(4, 0), cut));
    EXPECT_FALSE(passes(greeting + RawTcp::head(0, 10), cut)) << "a message";
    EXPECT_FALSE(passes(greeting + RawTcp::head(1, 10), cut)) << "a part of one";
    EXPECT_FALSE(passes(greeting + short_command(200) + RawTcp::head(4, 1 << 28), cut));
  }
}

}  // namespace
}  // namespace clearance::gateway
