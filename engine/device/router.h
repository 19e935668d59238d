// Backend auto: whether the CPU or the device answers a query, by how long each took for queries like it.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <mutex>

#include "engine/base/counters.h"
#include "engine/selection/query.h"

namespace clearance::cuda {

/// Kinds of queries that take different time.
enum class QueryKind : std::uint8_t {
  kDense,           ///< a row for each pair
  kWarm,            ///< the same, begun where the client's last one ended
  kNear,            ///< the same, with a max_distance
  kDepth,           ///< the same, with penetration depths
  kTable,           ///< nearest, or least, of the current poses
  kWithin,          ///< within a distance, likewise
  kConfigurations,  ///< reduced, over configurations
  kDecision,        ///< reduced to whether each pair is farther than its margin
  kMotion,          ///< the same all along motions
  kLeastMotion,     ///< how near they come along motions
};
inline constexpr int kQueryKinds = 10;
/// Depth before max_distance before warm: what costs most decides.
QueryKind kind_of(const QueryView& query);

/// Learns from every query how long its kind and size take on each backend, and sends the next one to the faster. Both
/// give the same bits, so only time is at stake. A size that was not seen yet is guessed from the nearest that was, and
/// before there is any from figures of one machine. So that a wrong guess does not stay, the slower backend is tried
/// again at the 2nd, 4th, 8th ... query of a kind and size, unless it is known to be much slower. Thread-safe.
class Router {
 public:
  /// \param threads of the CPU
  explicit Router(int threads) : threads_(threads) {}

  /// Whether the device is to answer a query of so many pair-configurations.
  bool to_device(QueryKind kind, std::uint64_t pairs);
  /// How long a query took, where it was answered.
  void learn(QueryKind kind, std::uint64_t pairs, bool on_device, std::chrono::nanoseconds took);
  /// Adds what stats() shows: how often each backend was asked, and how often to try it again.
  void append(Counters& counters) const;

 private:
  enum Backend { kCpu, kDevice };
  static constexpr int kSizes = 41;  // powers of two: 1, 2-3, 4-7, ...
  static constexpr double kUnknown = 0;
  struct Kind {
    std::array<std::array<double, kSizes>, 2> ns{};  // that a query of a size takes, by backend; kUnknown: not seen
    std::array<std::array<std::uint64_t, kSizes>, 2> answered{};  // of a size, by backend
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
