// A daemon with its three transports, witnesses beside it, and victims to harm.
#pragma once

#include <sys/types.h>

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tests/faults/census.h"
#include "tests/faults/witness.h"
#include "tests/server/daemon_fixture.h"

namespace clearance::faults {

extern const std::string kScene;  ///< scenes/random_100

/// fire_victim (victim_main.cpp) as a process. Killed with this object, if it still runs.
class Victim {
 public:
  explicit Victim(std::vector<std::string> arguments);
  ~Victim();
  Victim(Victim&& other) noexcept;
  Victim(const Victim&) = delete;

  /// Waits until a signal stopped it; false if it ended instead.
  bool await_stop();
  /// Waits for its end: its exit code, or minus the signal that ended it.
  int await_end();
  void signal(int number) const;

 private:
  pid_t pid_ = -1;
  int ended_with_ = 0;
};

class Arena {
 public:
  /// Starts a daemon. \param options more of its command line.
  explicit Arena(std::vector<std::string> options = {}, const std::string& scene = kScene);

  const std::string& shm() const { return urls_[0]; }
  const std::string& zmq() const { return urls_[1]; }
  const std::string& lcm() const { return urls_[2]; }
  const std::vector<std::string>& urls() const { return urls_; }
  /// Whose url comes last is left out where LCM messages do not come back (no multicast route).
  bool has_lcm() const { return urls_.size() > 2; }

  Daemon& daemon() { return *daemon_; }
  /// Kills it, and starts another at the same places.
  void kill_and_restart();
  /// Whether it has ended by itself.
  bool has_ended() const;
  /// Ends it as it should be ended; its exit code.
  int end();

  /// What the daemon holds now.
  Census census() const;
  /// Waits until the daemon holds what it held, at most kPatience. Returns what is left behind, or an empty text.
  std::string settle(const Census& before) const;

  /// A talk that ends, or stops, at a point of victim.h.
  Victim talk(const std::string& url, std::string_view point, int signal, std::uint64_t seed) const;
  std::string folder() const { return folder_.path(); }

 private:
  TestFolder folder_, temporary_;
  std::vector<std::string> command_, urls_;
  std::unique_ptr<Daemon> daemon_;
};

/// The points of the transport that a url names.
std::vector<std::string_view> points_of(const std::string& url);

using Stats = std::map<std::string, std::uint64_t>;
Stats stats_of(Client& client);
/// Whether every request that came in was answered, refused, dropped with its client, or waits. Returns what does not
/// add up, or an empty text.
std::string unbalanced(const Stats& stats);

}  // namespace clearance::faults
