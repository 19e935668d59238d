// A client that dies or freezes at a named point of its talk with the daemon.
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

/// The points of each transport, in the order in which a client comes by them.
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

/// Raises a signal at one point. SIGKILL: the end; SIGSTOP: goes on once somebody continues it.
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

/// A whole kQuery frame: every pair of the scene at its current poses, points too: a reply of hundreds of KB.
std::vector<std::byte> large_request(std::uint64_t id);
/// A whole kQuery frame of the pairs of body 1, put elsewhere in so many configurations.
std::vector<std::byte> request_of(std::uint64_t id, std::uint32_t configurations, std::mt19937_64& random);

/// Each talks to the daemon by hand, step by step, to the end. Throws std::runtime_error if the daemon does not keep to
/// its part.
void talk_shm(const std::string& socket_path, const Fate& fate, std::mt19937_64& random);
void talk_zmq(const std::string& socket_path, const Fate& fate, std::mt19937_64& random);
void talk_lcm(const std::string& url, const Fate& fate, std::mt19937_64& random);

/// Connects over shared memory again and again and writes over what it was given, by chance and by design, while the
/// daemon works on it. Until it is killed.
[[noreturn]] void scribble(const std::string& socket_path, std::mt19937_64& random);
/// Asks through the client library without end, requests of all sizes.
[[noreturn]] void ask_without_end(const std::string& url, std::mt19937_64& random);

}  // namespace clearance::faults
