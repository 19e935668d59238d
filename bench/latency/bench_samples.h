// Samples of a latency benchmark, and the loop that takes them.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace clearance::cli {

/// Keeps every sample, so that percentiles are exact. A run ends early at kMost samples.
class Samples {
 public:
  static constexpr std::size_t kMost = 4'000'000;

  void add(std::int64_t ns) {
    values_.push_back(ns);
    sorted_ = false;
  }
  std::size_t size() const { return values_.size(); }
  bool full() const { return values_.size() >= kMost; }

  /// The smallest sample that is at least as large as a share `p` in [0, 1] of all samples (nearest rank), in
  /// microseconds; NaN if there are none.
  double percentile_us(double p) const {
    if (values_.empty()) return std::nan("");
    if (!sorted_) {
      std::sort(values_.begin(), values_.end());
      sorted_ = true;
    }
    const double rank = std::ceil(p * static_cast<double>(values_.size()));
    const auto index = static_cast<std::size_t>(std::max(rank, 1.0)) - 1;
    return 1e-3 * static_cast<double>(values_[std::min(index, values_.size() - 1)]);
  }
  double max_us() const { return percentile_us(1); }

 private:
  mutable std::vector<std::int64_t> values_;
  mutable bool sorted_ = true;
};

/// Times of one exchange as reported by the server.
struct Exchanged {
  bool answered = true;
  std::int64_t server_ns = 0;
  std::int64_t engine_ns = 0;
};

/// Measurements of a series of exchanges.
struct Series {
  Samples latency;    ///< from the request (closed loop) or its due time (fixed rate) to the reply
  Samples server;     ///< reported by the server: from receipt of the request until the reply is complete
  Samples engine;     ///< reported by the server: time in the engine
  Samples transport;  ///< from sending the request to the reply, minus the server's time
  std::uint64_t lost = 0;
  std::uint64_t unsent = 0;  ///< fixed rate: requests due before the end that were never sent
  double seconds = 0;        ///< duration of the series

  double throughput() const { return seconds > 0 ? static_cast<double>(latency.size()) / seconds : 0; }
};

/// Waits until a time: sleeps at first, then spins, because a sleeping thread wakes up late.
void wait_until(std::chrono::steady_clock::time_point when);

/// Calls `exchange` (returning Exchanged) for `seconds` and adds to `series`.
///
/// \param rate_hz 0 for a closed loop, in which each request follows the last reply. Otherwise each request is due at a
/// fixed time and its latency counts from then, so that a request delayed by a slow reply includes the delay (no
/// coordinated omission).
template <class Exchange>
void drive(Exchange&& exchange, double rate_hz, double seconds, Series& series) {
  using Clock = std::chrono::steady_clock;
  const auto since = [](Clock::time_point from, Clock::time_point to) {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(to - from).count();
  };
  const auto begin = Clock::now();
  const auto end = begin + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
  auto now = begin;
  std::uint64_t begun = 0;
  for (std::uint64_t i = 0; now < end && !series.latency.full(); ++i) {
    auto due = now;
    if (rate_hz > 0) {
      due = begin + std::chrono::duration_cast<Clock::duration>(
                        std::chrono::duration<double>(static_cast<double>(i) / rate_hz));
      if (due >= end) break;
      begun = i + 1;
      wait_until(due);
    }
    const auto sent = Clock::now();
    if (rate_hz <= 0) due = sent;
    const Exchanged exchanged = exchange();
    now = Clock::now();
    if (!exchanged.answered) {
      ++series.lost;
      continue;
    }
    series.latency.add(since(due, now));
    series.server.add(exchanged.server_ns);
    series.engine.add(exchanged.engine_ns);
    series.transport.add(since(sent, now) - exchanged.server_ns);
  }
  if (rate_hz > 0 && !series.latency.full()) {
    const auto due = static_cast<std::uint64_t>(std::ceil(seconds * rate_hz * (1 - 1e-12)));
    series.unsent += due - std::min(due, begun);
  }
  series.seconds += 1e-9 * static_cast<double>(since(begin, Clock::now()));
}

}  // namespace clearance::cli
