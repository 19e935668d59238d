#include "engine/device/router.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <string>

namespace clearance::cuda {

namespace {

// Initial estimate per kind: ns per pair-configuration on one CPU thread and on a device, and the fixed cost of a
// query. The magnitudes are those of measured machines (docs/results/gpu_*.csv), with ratios chosen too small rather
// than too large: only a backend estimated as not much slower is tried, and then its measured time counts.
struct Guess {
  double cpu, device;
};
constexpr std::array<Guess, kQueryKinds> kGuesses{
    {{400, 1}, {20, 1}, {2000, 30}, {20, 0.5}, {10, 0.3}, {60, 0.7}, {10, 0.3}, {500, 5}, {1000, 10}}};
constexpr double kCpuQueryNs = 1000, kDeviceQueryNs = 30'000;
constexpr double kPairsPerThread = 300;  // smaller shares are not worth waking a thread

// The slower backend is retried while its estimate is at most this many times as long.
constexpr double kMostSlower = 4;
// The limit until it has answered kKnown queries of a size: the first one is cold, and other load may have slowed it.
constexpr double kMostSlowerUnknown = 16;
constexpr std::uint64_t kKnown = 2;
constexpr std::uint64_t kMostQueries = 256;  // without a retry
// Weight of a query slower than the fastest of its size: load only ever adds to a time.
constexpr double kForget = 1.0 / 8;

int size_of(std::uint64_t pairs) {
  return static_cast<int>(std::bit_width(std::max<std::uint64_t>(pairs, 1))) - 1;
}

}  // namespace

QueryKind kind_of(const QueryView& q) {
  if (q.max_evaluations > 0) return q.reduce == Reduce::kAny ? QueryKind::kMotion : QueryKind::kLeastMotion;
  if (q.reduce == Reduce::kAny) return QueryKind::kDecision;
  if (q.reduce != Reduce::kNone) {
    if (q.configuration_count > 0) return QueryKind::kConfigurations;
    return q.reduce == Reduce::kWithin ? QueryKind::kWithin : QueryKind::kTable;
  }
  if (q.signed_distance) return QueryKind::kDepth;
  if (q.max_distance < INFINITY) return QueryKind::kNear;
  return QueryKind::kDense;
}

double Router::guess(QueryKind kind, Backend backend, double pairs) const {
  const Guess& each = kGuesses[static_cast<std::size_t>(kind)];
  if (backend == kDevice) return kDeviceQueryNs + each.device * pairs;
  return kCpuQueryNs + each.cpu * pairs / std::clamp(pairs / kPairsPerThread, 1.0, static_cast<double>(threads_));
}

// Estimate for an unseen size: the guess, corrected by its error at the nearest size seen.
double Router::estimate(QueryKind kind, Backend backend, int size) const {
  const auto& seen = kinds_[static_cast<std::size_t>(kind)].ns[backend];
  const double wanted = guess(kind, backend, std::ldexp(1.5, size));
  for (int away = 0; away < kSizes; ++away)
    for (const int near : {size - away, size + away})
      if (near >= 0 && near < kSizes && seen[static_cast<std::size_t>(near)] != kUnknown)
        return wanted * seen[static_cast<std::size_t>(near)] / guess(kind, backend, std::ldexp(1.5, near));
  return wanted;
}

bool Router::to_device(QueryKind kind, std::uint64_t pairs) {
  const std::lock_guard lock(mutex_);
  Kind& known = kinds_[static_cast<std::size_t>(kind)];
  const int size = std::min(size_of(pairs), kSizes - 1);
  const double ns[] = {estimate(kind, kCpu, size), estimate(kind, kDevice, size)};
  bool device = ns[kDevice] < ns[kCpu];
  const auto at = static_cast<std::size_t>(size);
  const double most = known.answered[device ? kCpu : kDevice][at] < kKnown ? kMostSlowerUnknown : kMostSlower;
  const std::uint64_t queries = ++known.queries[at];
  const bool is_time = (queries > 1 && std::has_single_bit(queries)) || queries % kMostQueries == 0;
  if (is_time && ns[device ? kCpu : kDevice] < most * ns[device ? kDevice : kCpu]) {
    device = !device;
    ++known.tried_again;
  }
  ++(device ? known.to_device : known.to_cpu);
  return device;
}

void Router::learn(QueryKind kind, std::uint64_t pairs, bool on_device, std::chrono::nanoseconds took) {
  const int size = size_of(pairs);
  if (size >= kSizes) return;
  // Scaled to the middle of the size class, so that its queries can be compared.
  const Backend backend = on_device ? kDevice : kCpu;
  const double middle = std::ldexp(1.5, size), count = static_cast<double>(std::max<std::uint64_t>(pairs, 1));
  const double ns = static_cast<double>(std::max<std::int64_t>(took.count(), 1)) * guess(kind, backend, middle) /
                    guess(kind, backend, count);
  const std::lock_guard lock(mutex_);
  Kind& of_kind = kinds_[static_cast<std::size_t>(kind)];
  ++of_kind.answered[backend][static_cast<std::size_t>(size)];
  double& known = of_kind.ns[backend][static_cast<std::size_t>(size)];
  known = known == kUnknown || ns < known ? ns : known + kForget * (ns - known);
}

void Router::append(Counters& counters) const {
  static constexpr const char* kNames[kQueryKinds] = {"dense",          "near", "depth",  "table",       "within",
                                                      "configurations", "any",  "motion", "least_motion"};
  const std::lock_guard lock(mutex_);
  for (std::size_t kind = 0; kind < kQueryKinds; ++kind) {
    const std::string name = std::string("route.") + kNames[kind];
    counters.emplace_back(name + ".to_cuda", kinds_[kind].to_device);
    counters.emplace_back(name + ".to_cpu", kinds_[kind].to_cpu);
    counters.emplace_back(name + ".tried_again", kinds_[kind].tried_again);
  }
}

}  // namespace clearance::cuda
