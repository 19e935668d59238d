#include "wire/prometheus.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdio>
#include <sstream>
#include <string_view>

namespace clearance {
namespace {

enum class MetricKind { kCounterMetric, kGaugeMetric };

/// Description of a counter, or of all counters with a prefix that ends in '.'.
struct Metric {
  std::string_view name;
  MetricKind kind;
  std::string_view help;
};

constexpr MetricKind kCounterMetric = MetricKind::kCounterMetric, kGaugeMetric = MetricKind::kGaugeMetric;
constexpr auto kMetrics = std::to_array<Metric>({
    {"uptime_s", kGaugeMetric, "Seconds since the daemon started."},
    {"heap.used_bytes", kGaugeMetric, "Allocated memory of the daemon's heaps, in bytes."},
    {"heap.kept_bytes", kGaugeMetric, "Freed memory that the heaps keep for later requests, in bytes."},
    {"frames", kCounterMetric, "Requests received."},
    {"replies", kCounterMetric, "Requests answered."},
    {"rows", kCounterMetric, "Rows of answers."},
    {"requests.waiting", kGaugeMetric, "Requests under way."},
    {"requests.dropped", kCounterMetric, "Requests whose client was gone before the answer."},
    {"records.ignored", kCounterMetric, "Optional records of requests that are unknown to this daemon."},
    {"queries", kCounterMetric, "Queries received."},
    {"queries.answered", kCounterMetric, "Queries answered."},
    {"queries.waiting", kGaugeMetric, "Queries under way."},
    {"queries.held", kGaugeMetric, "Queries that wait for poses."},
    {"queries.held_back", kCounterMetric, "Queries that had to wait for poses."},
    {"queries.dropped", kCounterMetric, "Queries whose client was gone before the answer."},
    {"queries.handed_over", kCounterMetric, "Queries that the loop began and a worker finished."},
    {"errors", kCounterMetric, "Requests rejected."},
    {"errors.unsent", kCounterMetric, "Rejections that could not be sent."},
    {"errors.transport", kCounterMetric, "Failures of a transport."},
    {"errors.", kCounterMetric, "Requests rejected with this error code."},
    {"poses.batches", kCounterMetric, "Updates of poses and joints."},
    {"poses.applied", kCounterMetric, "Poses and joint positions applied."},
    {"poses.bad", kCounterMetric,
     "Poses and joint positions stored as bad: not finite, out of range or not normalisable."},
    {"poses.unknown", kCounterMetric, "Poses and joint positions left out: the scene has no such body or joint."},
    {"poses.fixed", kCounterMetric, "Poses left out: the body is static."},
    {"points.updates", kCounterMetric, "Clouds of points replaced."},
    {"points.applied", kCounterMetric, "Points received with them."},
    {"attachments", kCounterMetric, "Bodies attached or set free."},
    {"pairs.allowed", kCounterMetric, "Requests that let pairs touch."},
    {"pairs.forbidden", kCounterMetric, "Requests that enabled pairs again."},
    {"reloads", kCounterMetric, "Reloads of the scene file."},
    {"reloads.failed", kCounterMetric, "Reloads that failed; the old scene stayed."},
    {"scene_edits", kCounterMetric, "Bodies added or removed."},
    {"scene_edits.failed", kCounterMetric, "Additions and removals of bodies that failed."},
    {"plans.open", kGaugeMetric, "Device plans that clients have open."},
    {"plans.bytes", kGaugeMetric, "Device memory of these plans, in bytes."},
    {"plans.opened", kCounterMetric, "Device plans opened."},
    {"plans.closed", kCounterMetric, "Device plans closed."},
    {"plans.runs", kCounterMetric, "Runs of device plans."},
    {"loop.longest_section_ns", kGaugeMetric,
     "Longest time between two polls of the transports by the loop, in nanoseconds."},
    {"loop.longest_section_units", kGaugeMetric, "Most units of work between two such polls."},
    {"loop.sleeps", kCounterMetric, "Times that the loop slept."},
    {"shm.frames", kCounterMetric, "Requests received over shared memory."},
    {"ipc.frames", kCounterMetric, "Requests received over ZeroMQ, Unix sockets."},
    {"tcp.frames", kCounterMetric, "Requests received over ZeroMQ, TCP."},
    {"udpm.frames", kCounterMetric, "Requests received over LCM."},
    {"shm.clients", kGaugeMetric, "Clients connected over shared memory."},
    {"shm.connections", kCounterMetric, "Connections accepted over shared memory."},
    {"shm.rejected", kCounterMetric, "Connections rejected over shared memory."},
    {"shm.violations", kCounterMetric, "Clients disconnected for breaking the protocol of shared memory."},
    {"shm.over_quota", kCounterMetric, "Requests over shared memory beyond a client's quota."},
    {"shm.segment_bytes", kGaugeMetric, "Shared memory of all clients, in bytes."},
    {"shm.pinned_bytes", kGaugeMetric, "Shared memory that is pinned for a device, in bytes."},
    {"shm.pin_failures", kCounterMetric, "Segments that could not be pinned."},
    {"zmq.clients", kGaugeMetric, "Clients known over ZeroMQ."},
    {"zmq.replies_dropped", kCounterMetric, "Replies that ZeroMQ did not take."},
    {"zmq.over_quota", kCounterMetric, "Requests over ZeroMQ beyond a client's quota."},
    {"zmq.keys_accepted", kCounterMetric, "TCP clients whose key was accepted."},
    {"zmq.rejected", kCounterMetric, "TCP clients rejected."},
    {"gateway.restarts", kCounterMetric, "Gateway processes started again."},
    {"gateway.memory_bytes", kGaugeMetric, "Memory of the gateway processes, in bytes."},
    {"lcm.messages", kCounterMetric, "LCM messages received."},
    {"lcm.bad_messages", kCounterMetric, "LCM messages rejected as malformed."},
    {"lcm.pose_messages", kCounterMetric, "LCM messages of poses and joints."},
    {"lcm.unknown_bodies", kCounterMetric, "Names and ids in LCM messages that the scene does not have."},
    {"lcm.gaps", kCounterMetric, "LCM messages of publishers that are missing."},
    {"lcm.reordered", kCounterMetric, "LCM messages left out as older than their publisher's last."},
    {"lcm.repeated", kCounterMetric, "LCM messages left out as repeated."},
    {"lcm.restarts", kCounterMetric, "LCM publishers whose count began again."},
    {"lcm.contested", kCounterMetric, "Bodies and joints that two LCM publishers moved in turn."},
    {"lcm.bad_stamps", kCounterMetric,
     "LCM messages left out whole: a stamp out of range or late, a joint named twice."},
    {"lcm.poses_not_allowed", kCounterMetric, "Poses and joint positions that are not accepted from LCM."},
    {"lcm.publishers", kGaugeMetric, "LCM publishers known."},
    {"lcm.queries", kCounterMetric, "LCM messages of queries."},
    {"lcm.frames", kCounterMetric, "Frames received whole over LCM."},
    {"lcm.clouds", kCounterMetric, "Clouds received whole over LCM."},
    {"lcm.frames_given_up", kCounterMetric, "Frames and clouds of which a part was lost over LCM."},
    {"lcm.replies", kCounterMetric, "Replies sent over LCM."},
    {"lcm.replies_dropped", kCounterMetric, "Replies that LCM had no room for."},
    {"lcm.sent", kCounterMetric, "LCM messages sent."},
    {"lcm.send_errors", kCounterMetric, "LCM messages that could not be sent."},
    {"lcm.other_daemons", kCounterMetric, "Messages of another daemon under the same prefix."},
    {"engine.bodies", kGaugeMetric, "Bodies of the scene."},
    {"engine.pieces", kGaugeMetric, "Convex parts of the scene."},
    {"engine.vertices", kGaugeMetric, "Vertices of these parts."},
    {"engine.points", kGaugeMetric, "Points of all clouds."},
    {"engine.pairs", kGaugeMetric, "Enabled pairs."},
    {"engine.threads", kGaugeMetric, "Threads of the engine."},
    {"engine.newest_pose_age_ns", kGaugeMetric, "Age of the newest pose among the movable bodies that received one."},
    {"engine.oldest_pose_age_ns", kGaugeMetric, "Age of the oldest pose among the movable bodies that received one."},
    {"engine.bodies_without_pose", kGaugeMetric, "Bodies that have no pose: queries do not answer for them."},
    {"engine.bodies_with_bad_pose", kGaugeMetric, "Bodies whose pose is bad: queries do not answer for them."},
    {"engine.teams", kCounterMetric, "Teams of threads that were started for queries."},
    {"engine.box_trees", kCounterMetric, "Trees of boxes built."},
    {"engine.box_tree_bytes", kGaugeMetric, "Memory of these trees, in bytes."},
    {"engine.covers", kGaugeMetric, "Covers made."},
    {"engine.covers_pending", kGaugeMetric, "Covers still to be made."},
    {"engine.covers_impossible", kGaugeMetric, "Bodies' shapes whose cover could not be made."},
    {"engine.cover_bytes", kGaugeMetric, "Memory of the covers, in bytes."},
    {"engine.joint_tables", kGaugeMetric, "Joint tables made."},
    {"engine.joint_tables_pending", kGaugeMetric, "Joint tables still to be made."},
    {"engine.joint_table_bytes", kGaugeMetric, "Memory of the joint tables, in bytes."},
    {"engine.queries", kCounterMetric, "Queries that the engine began."},
    {"engine.jobs_reused", kCounterMetric, "Queries that a job of an earlier one answered."},
    {"engine.pairs_evaluated", kCounterMetric, "Pairs evaluated."},
    {"engine.contradictions", kCounterMetric,
     "Pairs whose bounds contradicted each other; answered again, or unconverged."},
    {"engine.pose_revision", kGaugeMetric, "Revision of the newest poses."},
    {"engine.pose_updates", kCounterMetric, "Poses applied."},
    {"engine.bad_poses", kCounterMetric, "Poses stored as bad."},
    {"engine.joint_updates", kCounterMetric, "Joint positions applied."},
    {"engine.bad_joints", kCounterMetric, "Joint positions stored as bad."},
    {"engine.point_updates", kCounterMetric, "Clouds replaced."},
    {"engine.stamps_out_of_range", kCounterMetric, "Updates rejected for a stamp out of range."},
    {"engine.stamps_late", kCounterMetric, "Updates rejected for a stamp older than their publisher's last."},
    {"route.", kCounterMetric, "Queries of this kind: answered by this backend, or tried again on the other one."},
    {"cuda.usable", kGaugeMetric, "1 while the device can be used, else 0."},
    {"cuda.scene_bytes", kGaugeMetric, "Device memory of the scene, in bytes."},
    {"cuda.query_bytes", kGaugeMetric, "Device memory of queries, in bytes."},
    {"cuda.pinned_bytes", kGaugeMetric, "Pinned host memory, in bytes."},
    {"cuda.allocations", kCounterMetric, "Allocations of device memory."},
    {"cuda.kernel_ns", kCounterMetric, "Time in kernels, in nanoseconds."},
    {"cuda.broad_phase_ns", kCounterMetric, "Time in the broad phase, in nanoseconds."},
    {"cuda.chunks", kCounterMetric, "Chunks of queries launched."},
    {"cuda.queries", kCounterMetric, "Queries answered by the device."},
    {"cuda.queries_on_cpu", kCounterMetric, "Queries that the CPU answered for the device."},
    {"cuda.queries_without_memory", kCounterMetric, "Queries for which the device had too little memory."},
    {"cuda.pairs_converged", kCounterMetric, "Pairs that the device finished."},
    {"cuda.pairs_finished_on_cpu", kCounterMetric, "Pairs that the CPU finished for the device."},
    {"cuda.motions_finished_on_cpu", kCounterMetric, "Motions that the CPU finished for the device."},
    {"cuda.reply_bytes_copied", kCounterMetric, "Bytes of answers copied from pinned memory."},
});

bool is_latency(const std::string& name) {
  return name.rfind(kLatencyCounters, 0) == 0;
}

/// Returns the description of a counter. For an unknown counter, such as one of a newer daemon, derives the type from
/// the name.
Metric metric_of(const std::string& name) {
  for (const Metric& metric : kMetrics)
    if (metric.name == name) return metric;
  for (const Metric& metric : kMetrics)
    if (metric.name.ends_with('.') && name.starts_with(metric.name)) return metric;
  for (const std::string_view gauge : {"bytes", "usable", "_age_ns", ".clients", ".waiting"})
    if (name.ends_with(gauge)) return {name, kGaugeMetric, "A metric of the daemon that has no description."};
  return {name, kCounterMetric, "A counter of the daemon that has no description."};
}

/// Returns the metric's name without the suffix of its type.
std::string prometheus_name(const std::string& name) {
  std::string metric = "clearance_" + name;
  std::replace_if(metric.begin(), metric.end(), [](unsigned char c) { return !std::isalnum(c); }, '_');
  return metric;
}

/// Formats seconds as an exact decimal.
std::string decimal_seconds(std::uint64_t ns) {
  char text[40];
  std::snprintf(text, sizeof text, "%llu.%09llu", static_cast<unsigned long long>(ns / 1'000'000'000),
                static_cast<unsigned long long>(ns % 1'000'000'000));
  return text;
}

void write_metric(std::ostream& out, const std::string& name, std::uint64_t value) {
  constexpr std::string_view kAge = "_age_ns";
  const Metric metric = metric_of(name);
  const bool is_age = metric.kind == kGaugeMetric && name.ends_with(kAge);
  const std::string shown = prometheus_name(is_age ? name.substr(0, name.size() - 3) + "_seconds" : name) +
                            (metric.kind == kCounterMetric ? "_total" : "");
  out << "# HELP " << shown << ' ' << metric.help << (is_age ? " In seconds." : "") << "\n# TYPE " << shown
      << (metric.kind == kCounterMetric ? " counter\n" : " gauge\n") << shown << ' '
      << (is_age ? decimal_seconds(value) : std::to_string(value)) << '\n';
}

void write_latency(std::ostream& out, const std::vector<std::pair<std::string, std::uint64_t>>& counters) {
  out << "# HELP clearance_latency_seconds From a query's arrival to its reply.\n"
         "# TYPE clearance_latency_seconds histogram\n";
  std::uint64_t sum = 0, ns = 0;
  bool is_endless = false;  // the last bucket must have no bound
  for (const auto& [bound, count] : latencies_of(counters)) {
    sum += count;
    is_endless = !bound;
    out << "clearance_latency_seconds_bucket{le=\"";
    if (bound)
      out << decimal_seconds(static_cast<std::uint64_t>(1e3 * *bound));
    else
      out << "+Inf";
    out << "\"} " << sum << '\n';
  }
  if (!is_endless) out << "clearance_latency_seconds_bucket{le=\"+Inf\"} " << sum << '\n';
  for (const auto& [name, value] : counters)
    if (name == kLatencySum) ns = value;
  out << "clearance_latency_seconds_sum " << decimal_seconds(ns) << "\nclearance_latency_seconds_count " << sum << '\n';
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
  for (const auto& [name, value] : counters)
    if (!is_latency(name) && name != kLatencySum) write_metric(text, name, value);
  write_latency(text, counters);
  return text.str();
}

}  // namespace clearance
