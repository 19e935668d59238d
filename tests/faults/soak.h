// All faults at random, for as long as is asked for, on two daemons: one that must live, and one that is killed.
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

  /// What was seen while everybody but the witnesses kept still.
  struct Sample {
    double seconds = 0;
    double cpu = 0;  ///< of one core, by the daemon that lives, since the last sample
    Census census;
    Stats stats;
    Witness::Counts living, mortal;  ///< sums over the witnesses
    std::map<std::string, std::uint64_t> faults;
    std::string trouble;  ///< what is wrong now; empty: nothing
  };

  /// \param load part of the time that each witness of the living daemon asks.
  Soak(std::uint64_t seed, double load);

  /// One fault, drawn at random.
  void fault();
  /// Ends what is under way, waits until the daemon holds what it held at the beginning, and looks at everything.
  Sample keep_still();
  /// Stops both daemons. Returns what is wrong, or an empty text.
  std::string end();
  /// What witnesses complained of, the first few.
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
  Client counters_;  ///< of the living daemon
  Census before_;
  std::list<Frozen> frozen_;
  std::list<Scribbler> scribblers_;
  std::map<std::string, std::uint64_t> faults_;
  std::string trouble_;
  Clock::time_point begin_ = Clock::now(), last_sample_ = begin_;
  double cpu_before_ = 0;
};

}  // namespace clearance::faults
