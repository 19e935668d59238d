// A daemon's counters in the text format that Prometheus reads.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace clearance {

/// Begins the names of the counters of queries by how long they took: "latency_us.8" has those of 4 to 8 us.
inline constexpr const char* kLatencyCounters = "latency_us.";

/// The name of the counter of how long they took in all, nanoseconds.
inline constexpr const char* kLatencySum = "queries.latency_sum_ns";

/// Queries by how long they took: pairs of an upper bound in microseconds (none: there is none) and how many,
/// ascending.
using Latencies = std::vector<std::pair<std::optional<double>, std::uint64_t>>;
Latencies latencies_of(const std::vector<std::pair<std::string, std::uint64_t>>& counters);

/// https://prometheus.io/docs/instrumenting/exposition_formats/: each counter as clearance_NAME_total, each gauge as
/// clearance_NAME, and the histogram clearance_latency_seconds, all with HELP and TYPE.
std::string prometheus_text(const std::vector<std::pair<std::string, std::uint64_t>>& counters);

}  // namespace clearance
