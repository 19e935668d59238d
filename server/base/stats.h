// The daemon's metrics: counters by name, latencies of queries, distinct errors. Only the loop's thread counts, without
// a lock; another thread requests a copy and waits for it.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/base/error_log.h"
#include "wire/prometheus.h"

namespace clearance {

class Stats {
 public:
  using Named = std::vector<std::pair<std::string, std::uint64_t>>;
  /// A copy of all metrics.
  struct MetricsSnapshot {
    Named counters;
    std::vector<ErrorLog::Entry> errors;
  };

  Stats();
  Stats(const Stats&) = delete;
  Stats& operator=(const Stats&) = delete;

  /// Counter by name, made on first use. The reference stays valid.
  std::uint64_t& operator[](const std::string& name) { return named_[name]; }
  /// Counts a query by its time from arrival to reply: "latency_us.N" has those above N/2 and up to N microseconds,
  /// "latency_us.more" the slower ones.
  void count_latency(std::uint64_t ns);
  /// Counts a rejected request and keeps its text.
  void count_error(const std::string& code, const std::string& text);
  /// Appends all counters to a list.
  void append_to(Named& list) const { list.insert(list.end(), named_.begin(), named_.end()); }

  /// Whether a thread waits in read().
  bool are_wanted() const { return wanted_.load(std::memory_order_relaxed); }
  /// Passes the metrics to the threads that wait in read().
  /// @param counters all counters
  void hand_out(Named counters);
  /// Returns the metrics as of the next hand_out(), or nothing after `patience`. From any thread but the loop's.
  /// @param wake wakes the loop, which then calls hand_out()
  std::optional<MetricsSnapshot> read(std::chrono::nanoseconds patience, const std::function<void()>& wake);

 private:
  std::map<std::string, std::uint64_t> named_;  // a map, whose references stay valid

 public:
  // Counters of every request, without a look-up by name.
  // frames = replies + errors + requests.dropped (their client is gone) + requests.waiting
  std::uint64_t &frames = named_["frames"], &replies = named_["replies"], &dropped = named_["requests.dropped"],
                &queries = named_["queries"], &answered = named_["queries.answered"], &rows = named_["rows"],
                &records_ignored = named_["records.ignored"], &latency_sum_ns = named_[kLatencySum];
  // Longest time, and most units of work (engine/narrow/work_meter.h), between two polls of the transports.
  std::uint64_t &longest_section_ns = named_["loop.longest_section_ns"],
                &longest_section_units = named_["loop.longest_section_units"];

 private:
  static constexpr int kLatencyBuckets = 24;
  std::array<std::uint64_t*, kLatencyBuckets> latency_;
  ErrorLog errors_;
  std::atomic<bool> wanted_{false};
  std::mutex mutex_;
  std::condition_variable there_;
  std::optional<MetricsSnapshot> metrics_;  // guarded by mutex_
};

}  // namespace clearance
