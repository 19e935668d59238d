// Backend auto: whether the CPU or the device answers a query, by how long each took for others like it.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>

#include "engine/base/counters.h"
#include "engine/device/device.h"
#include "engine/query/plan.h"

namespace clearance::cuda {

/// Time that a query of so many pair-configurations took.
struct CostSample {
  double pairs = 0, cpu_ns = 0, device_ns = 0;
};
inline constexpr int kCostSamples = 5;

/// Kinds of queries that take different time.
enum class QueryKind : std::uint8_t {
  kDense,           ///< a row for each pair
  kWarm,            ///< the same, begun where the client's last one ended
  kNear,            ///< the same, with a max_distance
  kDepth,           ///< the same, with penetration depths
  kTable,           ///< nearest, or least, of the current poses
  kWithin,          ///< within a distance, likewise
  kConfigurations,  ///< reduced, over configurations
};
inline constexpr int kQueryKinds = 7;
/// Depth before max_distance before warm: what costs most decides.
QueryKind kind_of(const QueryView& query);
/// Hulls of few vertices and of more.
inline constexpr int kHullSizes = 2;
inline constexpr double kSmallHull = 110;  ///< mean vertices up to which hulls are small

/// What bodies are made of, which queries take very different time with.
enum class Bodies { kOfOnePiece, kOfSeveral };
/// Those of a scene, by the greater part of them.
Bodies bodies_of(const Scene& scene);

/// Measured on one machine with a certain device.
struct Calibration {
  std::array<std::array<std::array<CostSample, kCostSamples>, kHullSizes>, kQueryKinds>
      samples;  ///< ascending in pairs

  /// The fewest pair-configurations from which on the device is faster, between samples as on a line; none: it never
  /// is.
  /// \param open_share of pairs that the CPU has to finish for the device.
  std::optional<double> device_from(QueryKind kind, int hull_size, double open_share) const;
};

class Router {
 public:
  Router(const Scene& scene, const Device& device, const Calibration& calibration);
  /// Whether the device is to answer. Counts what it says.
  bool to_device(const Plan& plan);
  /// Adds what stats() shows: how often, and from how many pair-configurations on.
  void append(Counters& counters) const;

 private:
  struct Choice {
    std::optional<double> device_from;
    std::atomic<std::uint64_t> to_device{0}, to_cpu{0};
  };
  std::array<Choice, kQueryKinds> choices_;
};

}  // namespace clearance::cuda
