// Random faults of all kinds for a given duration, on two daemons: one that must survive, and one that is killed.
#pragma once

#include <chrono>
#include <cstdint>
#include <list>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "tests/faults/arena.h"

namespace clearance::faults {

class Soak {
 public:
  using Clock = std::chrono::steady_clock;

  /// Observations while only the witnesses are active.
  struct Sample {
    double seconds = 0;
    double cpu = 0;  ///< share of one core used by the surviving daemon since the last sample
    Census census;
    Stats stats;
    Witness::Counts living, mortal;  ///< sums over the witnesses
    std::map<std::string, std::uint64_t> faults;
    std::string trouble;  ///< current problem, or empty
  };

  /// \param load share of the time in which each witness of the surviving daemon sends queries
  Soak(std::uint64_t seed, double load);

  /// Applies one random fault.
  void fault();
  /// Ends all activity, waits until the daemon holds its initial resources, and checks everything.
  Sample keep_still();
  /// Stops both daemons. Describes a problem, or returns an empty string.
  std::string end();
  /// The first few errors of the witnesses.
  std::vector<std::string> complaints() const;

 private:
  struct Frozen {
    Victim victim;
    Clock::time_point until;
    bool goes_on;
  };
  struct Scribbler {
    Victim victim;
    Clock::time_point until;
  };

  void kill_client(Arena& arena, const char* name);
  void kill_client_at_any_moment();
  void freeze_client();
  void start_scribbler();
  void take_descriptors();
  void take_memory();
  void limit_file_size();
  void reload();
  void kill_daemon();
  void release_due(Clock::time_point now);
  std::uint64_t below(std::uint64_t limit) { return random_() % limit; }
  const std::string& any_url(const Arena& arena) { return arena.urls()[below(arena.urls().size())]; }
  void expect(bool holds, const std::string& else_trouble);

  std::mt19937_64 random_;
  Exam exam_;
  Arena living_, mortal_;
  Witnesses living_witnesses_, mortal_witnesses_;
  Client counters_;  ///< of the surviving daemon
  Census before_;
  std::list<Frozen> frozen_;
  std::list<Scribbler> scribblers_;
  std::map<std::string, std::uint64_t> faults_;
  std::string trouble_;
  Clock::time_point begin_ = Clock::now(), last_sample_ = begin_;
  double cpu_before_ = 0;
};

}  // namespace clearance::faults
