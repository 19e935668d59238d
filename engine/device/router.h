// Backend auto: sends each query to the CPU or the device by measured times of similar queries.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <mutex>

#include "engine/base/counters.h"
#include "engine/selection/query.h"

namespace clearance::cuda {

/// Kinds of queries with different running times.
enum class QueryKind : std::uint8_t {
  kDense,           ///< a row per pair
  kNear,            ///< dense with a max_distance
  kDepth,           ///< dense with penetration depths
  kTable,           ///< nearest or min, at the current poses
  kWithin,          ///< within a distance, at the current poses
  kConfigurations,  ///< reduced, over configurations
  kDecision,        ///< reduced to whether each pair is beyond its margin
  kMotion,          ///< the same over whole motions
  kLeastMotion,     ///< the least distance over motions
};
inline constexpr int kQueryKinds = 9;
/// The costliest property decides: depth before max_distance.
QueryKind kind_of(const QueryView& query);

/// Learns the time of each kind and size of query on each backend and sends the next one to the faster. Both give the
/// same bits, so only time is affected. An unseen size is estimated from the nearest one seen, initially from one
/// machine's measurements. To correct wrong estimates, the slower backend is retried at the 2nd, 4th, ... 256th query of
/// a kind and size, and every 256th from there, unless it is known to be much slower. Thread-safe.
class Router {
 public:
  /// \param threads of the CPU
  explicit Router(int threads) : threads_(threads) {}

  /// Whether the device answers a query of this many pair-configurations.
  bool to_device(QueryKind kind, std::uint64_t pairs);
  /// Records the time of a query on its backend.
  void learn(QueryKind kind, std::uint64_t pairs, bool on_device, std::chrono::nanoseconds took);
  /// Adds the counters shown by stats(): queries per backend, and retries of the slower one.
  void append(Counters& counters) const;

 private:
  enum Backend { kCpu, kDevice };
  static constexpr int kSizes = 41;  // powers of two: 1, 2-3, 4-7, ...
  static constexpr double kUnknown = 0;
  struct Kind {
    std::array<std::array<double, kSizes>, 2> ns{};  // time of a query of each size, by backend; kUnknown if not seen
    std::array<std::array<std::uint64_t, kSizes>, 2> answered{};  // per size, by backend
    std::array<std::uint64_t, kSizes> queries{};
    std::uint64_t to_device = 0, to_cpu = 0, tried_again = 0;
  };

  double guess(QueryKind kind, Backend backend, double pairs) const;
  double estimate(QueryKind kind, Backend backend, int size) const;

  const int threads_;
  mutable std::mutex mutex_;
  std::array<Kind, kQueryKinds> kinds_;
};

}  // namespace clearance::cuda
