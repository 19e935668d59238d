// Warm state: where GJK ended for each pair of a client's last query, to begin there in its next one.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

namespace clearance {

/// Warm state of one piece pair: the simplex it ended with, as vertex indices. Only a guess: any indices would do.
struct WarmSimplex {
  std::uint32_t a[3] = {}, b[3] = {};
  std::uint8_t size = 0;
};

/// Of a dense query: one for each configuration and pair, (K, P).
struct WarmTable {
  std::uint64_t client = 0, question = 0;
  std::vector<WarmSimplex> simplices;
};

/// The tables of the clients that asked last. Thread-safe; a table belongs to one job at a time.
class WarmStore {
 public:
  static constexpr std::size_t kClients = 64;              ///< more clients: the one longest silent begins cold again
  static constexpr std::size_t kMostSimplices = 1u << 22;  ///< larger questions are always cold (28 bytes each)

  /// The table that `client` left for the same question, or an empty one of the size; null where the size is 0 or too large.
  std::unique_ptr<WarmTable> take(std::uint64_t client, std::uint64_t question, std::uint64_t size);
  void put_back(std::unique_ptr<WarmTable> table);
  std::uint64_t bytes() const;

 private:
  mutable std::mutex mutex_;
  std::vector<std::unique_ptr<WarmTable>> tables_;  ///< the latest last
};

}  // namespace clearance
