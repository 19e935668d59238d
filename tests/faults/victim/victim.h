// A client that dies or freezes at a named point of its communication with the daemon.
#pragma once

#include <signal.h>

#include <cstddef>
#include <cstdint>
#include <random>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace clearance::faults {

/// The points of each transport, in the order in which a client reaches them.
inline constexpr std::string_view kShmPoints[] = {
    // handshake
    "connected", "hello_sent", "segment_received", "mapped",
    // writing a request
    "frame_half_written", "frame_written", "entry_written", "posted", "woken",
    // reading replies
    "reply_there", "reply_half_read", "many_posted", "grow_sent", "grown", "posted_in_second", "all_there", "retired"};
inline constexpr std::string_view kZmqPoints[] = {
    "connected",   "greeting_cut", "greeted",     "ready_cut", "ready",      "header_cut", "header_sent",
    "payload_cut", "sent",         "reply_begun", "reply_cut", "reply_read", "many_sent",  "many_begun"};
inline constexpr std::string_view kLcmPoints[] = {"opened",      "poses_sent",  "part_sent", "sent",
                                                  "reply_begun", "reply_there", "many_sent", "query_sent"};

/// Raises a signal at one point: SIGKILL ends the process, SIGSTOP suspends it until it is continued.
class Fate {
 public:
  Fate(std::string point, int signal) : point_(std::move(point)), signal_(signal) {}
  void at(std::string_view point) const {
    if (point == point_) ::raise(signal_);
  }

 private:
  std::string point_;
  int signal_;
};

/// A whole kQuery frame: every pair of the scene at its current poses, with points, and a reply of hundreds of KB.
std::vector<std::byte> large_request(std::uint64_t id);
/// A whole kQuery frame for the pairs of body 1, which is moved in this many configurations.
std::vector<std::byte> request_of(std::uint64_t id, std::uint32_t configurations, std::mt19937_64& random);

/// Each communicates with the daemon without the client library, step by step, to the end. Throws std::runtime_error if
/// the daemon breaks the protocol.
void talk_shm(const std::string& socket_path, const Fate& fate, std::mt19937_64& random);
void talk_zmq(const std::string& socket_path, const Fate& fate, std::mt19937_64& random);
void talk_lcm(const std::string& url, const Fate& fate, std::mt19937_64& random);

/// Connects over shared memory repeatedly and overwrites it, randomly and deliberately, while the daemon uses it. Runs
/// until it is killed.
[[noreturn]] void scribble(const std::string& socket_path, std::mt19937_64& random);
/// Sends requests of all sizes through the client library without end.
[[noreturn]] void request_without_end(const std::string& url, std::mt19937_64& random);

}  // namespace clearance::faults
