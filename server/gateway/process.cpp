#include "server/gateway/process.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <stdexcept>
#include <utility>

#include "engine/base/helper_program.h"
#include "engine/narrow/work_meter.h"
#include "server/access/fd_filter_proxy.h"
#include "server/base/log.h"
#include "server/base/log_text.h"

namespace clearance::gateway {
namespace {

using std::chrono::milliseconds;

constexpr auto kStartPatience = std::chrono::seconds(30);
/// A process that has lived this long is restarted at once; otherwise the pause grows.
constexpr auto kLongLife = std::chrono::seconds(1);
constexpr auto kFirstPause = milliseconds(50), kLongestPause = milliseconds(400);
constexpr auto kCheckInterval = milliseconds(500);
/// A process that has not answered for this long is hung.
constexpr auto kHang = std::chrono::seconds(5);
constexpr int kSendBuffer = 1 << 20;

const char* const kProgram = "clearance-gateway";

std::string ending_of(int status) {
  if (WIFSIGNALED(status)) return std::string("signal ") + std::to_string(WTERMSIG(status));
  return "code " + std::to_string(WEXITSTATUS(status));
}

}  // namespace

Process::Process(ProcessOptions options) : options_(std::move(options)) {
  try {
    start();
    wait_until_ready();
  } catch (const Broken&) {
    reap(true);
    throw std::runtime_error(options_.url + ": " + kProgram + " ended at its start");
  } catch (const std::runtime_error& error) {
    reap(true);
    throw std::runtime_error(options_.url + ": " + error.what());
  }
}

Process::~Process() {
  reap(true);
}

void Process::start() {
  int ends[2];
  if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0, ends) != 0)
    throw std::runtime_error(std::string("cannot create a socket pair: ") + std::strerror(errno));
  shm::UniqueFd ours(ends[0]), theirs(ends[1]);
  for (const int fd : ends) ::setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &kSendBuffer, sizeof kSendBuffer);
  reject_descriptors(ours.get());
  std::vector<int> descriptors{theirs.get()};
  if (options_.listener) descriptors.push_back(options_.listener.get());
  const std::string program =
      helper_program(kProgram, "CLEARANCE_OUTSIDE", nullptr, ", which handles network traffic,");
  pid_ = start_helper(program,
                      {options_.what, std::to_string(options_.memory_bytes), std::to_string(options_.connections)},
                      descriptors);
  // Bodies of several clients may be under way at once. The gateway has the same limits.
  link_.emplace(std::move(ours), Link::Limits{.message_bytes = message_bytes(),
                                              .coming_bytes = options_.memory_bytes,
                                              .waiting_bytes = options_.memory_bytes});
  ready_ = false;
  started_ = last_alive_ = Clock::now();
  link_->send(options_.start);
}

void Process::wait_until_ready() {
  const auto deadline = Clock::now() + kStartPatience;
  while (!ready_ && !lost_) {
    pollfd waiting{link_->descriptor(), POLLIN, 0};
    const auto left = std::chrono::ceil<milliseconds>(deadline - Clock::now()).count();
    if (left <= 0) throw std::runtime_error(std::string(kProgram) + " does not answer");
    ::poll(&waiting, 1, static_cast<int>(left));
    link_->turn();
    while (!ready_ && !failed_)
      if (std::optional<Message> message = link_->receive())
        take_own(std::move(*message));
      else
        break;
    if (failed_) throw std::runtime_error(*failed_);
  }
}

bool Process::turn(RequestHandler& handler) {
  if (link_) {
    link_->drop_by([&handler](std::shared_ptr<void> memory) { handler.drop(std::move(memory)); });
    try {
      count_copied(link_->turn_bytes());
      link_->turn();
    } catch (const Broken& broken) {
      lose(broken.what());
    }
  }
  if (!std::exchange(lost_, false)) return false;
  // Messages received in part are freed on a worker.
  if (link_) handler.drop(std::make_shared<Link>(std::move(*link_)));
  link_.reset();
  const auto now = Clock::now();
  pause_ = now - started_ > kLongLife ? Clock::duration()
                                      : std::clamp<Clock::duration>(2 * pause_, kFirstPause, kLongestPause);
  next_start_ = now + pause_;
  ++handler.counter("gateway.restarts");
  log::warn("event=gateway_ended url={} pid={} pause_ms={} why=\"{}\"", log_text(options_.url), pid_,
            std::chrono::duration_cast<milliseconds>(pause_).count(), log_text(why_lost_));
  ::kill(pid_, SIGKILL);
  ending_.push_back(std::exchange(pid_, -1));
  tick(handler);
  return true;
}

std::optional<Message> Process::receive() {
  while (link_ && !lost_) try {
      std::optional<Message> message = link_->receive();
      if (!message) return std::nullopt;
      if ((message = take_own(std::move(*message)))) return message;
    } catch (const Broken& broken) {
      lose(broken.what());
    } catch (const std::bad_alloc&) {
      lose("there is no memory for its message");
    }
  return std::nullopt;
}

/// Handles messages about the process itself, and returns all others.
std::optional<Message> Process::take_own(Message message) {
  switch (message.kind) {
    case Kind::kReady:
      ready_ = true;
      if (message.body.bytes && !std::exchange(reported_unfiltered_, true))
        log::warn("event=gateway_unfiltered url={} text=\"{}\"", log_text(options_.url),
                  log_text(message.body.text().substr(0, 200)));
      return std::nullopt;
    case Kind::kAlive:
      last_alive_ = Clock::now();
      return std::nullopt;
    case Kind::kFailed:
      failed_ = message.body.text().substr(0, 500);
      lose(*failed_);
      return std::nullopt;
    default:
      return message;
  }
}

void Process::send(Message message) {
  if (!link_ || lost_) return;
  try {
    link_->send(std::move(message));
  } catch (const Broken& broken) {
    lose(broken.what());
  }
}

void Process::lose(const std::string& why) {
  if (!std::exchange(lost_, true)) why_lost_ = why;
}

void Process::tick(RequestHandler& handler) {
  reap(false);
  const auto now = Clock::now();
  if (!link_ && now >= next_start_) try {
      start();
    } catch (const std::runtime_error& error) {
      link_.reset();
      next_start_ = now + kLongestPause;
      log::error("event=gateway_not_started url={} error=\"{}\"", log_text(options_.url), log_text(error.what()));
    }
  if (now < next_check_) return;
  next_check_ = now + kCheckInterval;
  count_memory(handler, resident_bytes());
  if (!link_) return;
  if (now - last_alive_ > kHang) return lose("it hangs");
  send({Kind::kPing, 0, {}, {}, {}});
}

/// @param wait for all of them to end
void Process::reap(bool wait) {
  if (wait && pid_ > 0) {
    ::kill(pid_, SIGKILL);
    ending_.push_back(std::exchange(pid_, -1));
  }
  std::erase_if(ending_, [&](pid_t pid) {
    int status = 0;
    pid_t reaped;
    do reaped = ::waitpid(pid, &status, wait ? 0 : WNOHANG);
    while (reaped < 0 && errno == EINTR);
    if (reaped == pid && !wait) log::info("event=gateway_reaped pid={} by=\"{}\"", pid, ending_of(status));
    return reaped != 0;
  });
}

/// Counts all gateways together.
void Process::count_memory(RequestHandler& handler, std::uint64_t bytes) {
  handler.counter("gateway.restarts") += 0;  // makes the counter visible before the first restart
  std::uint64_t& all = handler.counter("gateway.memory_bytes");
  all += bytes - memory_counted_;
  memory_counted_ = bytes;
}

std::uint64_t Process::resident_bytes() const {
  if (pid_ <= 0) return 0;
  char path[40], text[80] = {};
  std::snprintf(path, sizeof path, "/proc/%d/statm", static_cast<int>(pid_));
  const shm::UniqueFd file(::open(path, O_RDONLY | O_CLOEXEC));
  unsigned long size = 0, resident = 0;
  if (!file || ::read(file.get(), text, sizeof text - 1) <= 0 || std::sscanf(text, "%lu %lu", &size, &resident) != 2)
    return 0;
  return std::uint64_t{resident} * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
}

}  // namespace clearance::gateway
