#include "server/base/stats.h"

#include <algorithm>
#include <bit>

namespace clearance {

Stats::Stats() {
  for (int i = 0; i < kLatencyBuckets; ++i)
    latency_[i] = &named_["latency_us." + (i + 1 < kLatencyBuckets ? std::to_string(1u << i) : "more")];
}

void Stats::count_latency(std::uint64_t ns) {
  const std::uint64_t us = (ns + 999) / 1000;
  latency_sum_ns += ns;
  ++*latency_[std::min<int>(std::bit_width(us > 0 ? us - 1 : 0), kLatencyBuckets - 1)];
}

void Stats::count_error(const std::string& code, const std::string& text) {
  ++named_["errors"];
  ++named_["errors." + code];
  errors_.note(code, text);
}

void Stats::hand_out(Named counters) {
  MetricsSnapshot metrics{std::move(counters), errors_.entries()};
  {
    const std::lock_guard lock(mutex_);
    wanted_ = false;
    metrics_ = std::move(metrics);
  }
  there_.notify_all();
}

std::optional<Stats::MetricsSnapshot> Stats::read(std::chrono::nanoseconds patience,
                                                  const std::function<void()>& wake) {
  std::unique_lock lock(mutex_);
  metrics_.reset();
  wanted_ = true;
  wake();
  there_.wait_for(lock, patience, [this] { return metrics_.has_value(); });
  return metrics_;
}

}  // namespace clearance
