// Samples of a latency benchmark, and how they are taken.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace clearance::cli {

/// Every sample is kept, so that percentiles are exact; a run ends early rather than keep more than kMost.
class Samples {
 public:
  static constexpr std::size_t kMost = 4'000'000;

  void add(std::int64_t ns) {
    values_.push_back(ns);
    sorted_ = false;
  }
  std::size_t size() const { return values_.size(); }
  bool full() const { return values_.size() >= kMost; }

  /// The least sample that a part `p` (0 to 1) of all samples does not exceed (nearest rank), in microseconds; NaN:
  /// none.
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

/// What one exchange with a server says of itself.
struct Exchanged {
  bool answered = true;
  std::int64_t server_ns = 0;
  std::int64_t engine_ns = 0;
};

/// What a series of exchanges took.
struct Series {
  Samples latency;    ///< closed loop: from the request to the reply; fixed rate: from when the request was due
  Samples server;     ///< as the server says: from the request's receipt to the reply being whole
  Samples engine;     ///< as the server says: inside the engine
  Samples transport;  ///< from the request being sent to the reply, less the server's time
  std::uint64_t lost = 0;
  std::uint64_t unsent = 0;  ///< fixed rate: due before the end, but still waiting for their turn by then
  double seconds = 0;        ///< that the series went on

  double throughput() const { return seconds > 0 ? static_cast<double>(latency.size()) / seconds : 0; }
};

/// Waits for a moment: sleeps while it is far, spins at the end, since a sleeper wakes up late.
void wait_until(std::chrono::steady_clock::time_point when);

/// Calls `exchange` (returning Exchanged) for `seconds` and adds to `series`.
///
/// \param rate_hz 0: closed loop, each request as soon as the last reply is there. Else each request is due at a fixed
/// moment, whatever became of the ones before, and its latency counts from that moment: what waits behind a slow reply
/// is charged with the wait (no coordinated omission).
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
