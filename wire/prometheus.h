// A daemon's counters in Prometheus' text format.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace clearance {

/// Prefix of the counters of queries by latency; "latency_us.8" counts those of 4 to 8 us.
inline constexpr const char* kLatencyCounters = "latency_us.";

/// Name of the counter of their total latency, in nanoseconds.
inline constexpr const char* kLatencySum = "queries.latency_sum_ns";

/// Queries by latency: ascending pairs of an upper bound in microseconds, if any, and a count.
using Latencies = std::vector<std::pair<std::optional<double>, std::uint64_t>>;
Latencies latencies_of(const std::vector<std::pair<std::string, std::uint64_t>>& counters);

/// https://prometheus.io/docs/instrumenting/exposition_formats/: each counter as clearance_NAME_total, each gauge as
/// clearance_NAME, and the histogram clearance_latency_seconds, all with HELP and TYPE.
std::string prometheus_text(const std::vector<std::pair<std::string, std::uint64_t>>& counters);

}  // namespace clearance
