// A daemon with its three transports, witnesses that check it, and victims that are harmed.
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

/// The process fault_victim (victim/main.cpp). Killed with this object if it still runs.
class Victim {
 public:
  explicit Victim(std::vector<std::string> arguments);
  ~Victim();
  Victim(Victim&& other) noexcept;
  Victim(const Victim&) = delete;

  /// Waits until a signal has stopped it; false if it ended instead.
  bool await_stop();
  /// Waits for its end. Returns its exit code, or minus the signal that ended it.
  int await_end();
  void signal(int number) const;

 private:
  pid_t pid_ = -1;
  int ended_with_ = 0;
};

class Arena {
 public:
  /// Starts a daemon.
  /// \param options further command line options
  explicit Arena(std::vector<std::string> options = {}, const std::string& scene = kScene);

  const std::string& shm() const { return urls_[0]; }
  const std::string& zmq() const { return urls_[1]; }
  const std::string& lcm() const { return urls_[2]; }
  const std::vector<std::string>& urls() const { return urls_; }
  /// Returns false if LCM messages do not come back (no multicast route); the last URL is then missing.
  bool has_lcm() const { return urls_.size() > 2; }

  Daemon& daemon() { return *daemon_; }
  /// Kills the daemon, and starts another at the same endpoints.
  void kill_and_restart();
  /// Returns whether the daemon has ended by itself.
  bool has_ended() const;
  /// Ends the daemon regularly and returns its exit code.
  int end();

  /// Resources that the daemon holds now.
  Census census() const;
  /// Waits until the daemon holds no more than before, at most kPatience. Describes the excess, or returns an empty
  /// string.
  std::string await_census(const Census& before) const;

  /// A client that ends, or stops, at a point of victim.h.
  Victim talk(const std::string& url, std::string_view point, int signal, std::uint64_t seed) const;
  std::string folder() const { return folder_.path(); }

 private:
  TestFolder folder_, temporary_;
  std::vector<std::string> command_, urls_;
  std::unique_ptr<Daemon> daemon_;
};

/// The points of the transport that a URL names.
std::vector<std::string_view> points_of(const std::string& url);

using Stats = std::map<std::string, std::uint64_t>;
Stats stats_of(Client& client);
/// Waits until the daemon makes no covers: the allocator keeps memory mappings of theirs.
void await_covers(Client& client);
/// Checks that every received request was answered, rejected, dropped with its client, or waits. Describes the
/// imbalance, or returns an empty string.
std::string unbalanced(const Stats& stats);

}  // namespace clearance::faults
