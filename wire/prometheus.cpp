#include "prometheus.h"

#include <algorithm>
#include <cctype>
#include <sstream>

namespace clearance {
namespace {

bool is_latency(const std::string& name) {
  return name.rfind(kLatencyCounters, 0) == 0;
}

}  // namespace

Latencies latencies_of(const std::vector<std::pair<std::string, std::uint64_t>>& counters) {
  Latencies all;
  for (const auto& [name, value] : counters) {
    if (!is_latency(name)) continue;
    const std::string bound = name.substr(std::string(kLatencyCounters).size());
    all.push_back({bound == "more" ? std::nullopt : std::optional(std::stod(bound)), value});
  }
  std::sort(all.begin(), all.end(), [](const auto& a, const auto& b) {
    return b.first ? a.first && *a.first < *b.first : a.first.has_value();
  });
  return all;
}

std::string prometheus_text(const std::vector<std::pair<std::string, std::uint64_t>>& counters) {
  std::ostringstream text;
  for (const auto& [name, value] : counters) {
    if (is_latency(name)) continue;
    std::string metric = "clearance_" + name;
    std::replace_if(metric.begin(), metric.end(), [](unsigned char c) { return !std::isalnum(c); }, '_');
    text << metric << ' ' << value << '\n';
  }
  text << "# HELP clearance_latency_seconds From a query's arrival to its reply.\n"
          "# TYPE clearance_latency_seconds histogram\n";
  std::uint64_t sum = 0;
  for (const auto& [bound, count] : latencies_of(counters)) {
    sum += count;
    text << "clearance_latency_seconds_bucket{le=\"";
    if (bound)
      text << 1e-6 * *bound;
    else
      text << "+Inf";
    text << "\"} " << sum << '\n';
  }
  text << "clearance_latency_seconds_count " << sum << '\n';
  return text.str();
}

}  // namespace clearance
