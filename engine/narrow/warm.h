// Warm state: for each pair of a client's last query the simplex where GJK ended, as a start for the next query.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

namespace clearance {

/// Warm state of one pair of convex parts: its last simplex, as vertex indices. Only a guess: any indices are valid.
struct WarmSimplex {
  std::uint32_t a[3] = {}, b[3] = {};
  std::uint8_t size = 0;
};

/// Warm state of a dense query: one for each configuration and pair, (K, P).
struct WarmTable {
  std::uint64_t client = 0, question = 0;
  std::vector<WarmSimplex> simplices;  // never another size
  std::uint64_t bytes() const { return simplices.size() * sizeof(WarmSimplex); }
};

/// One table for each of the most recent clients. Thread-safe; a table belongs to one job at a time.
/// \tparam Table has a `client`
template <class Table>
class LatestTables {
 public:
  explicit LatestTables(std::size_t clients) : clients_(clients) {}  ///< evicts the least recently used beyond these

  /// Takes the table of a client, or null.
  std::unique_ptr<Table> take(std::uint64_t client) {
    const std::lock_guard lock(mutex_);
    const auto found = std::find_if(tables_.begin(), tables_.end(), [&](const auto& t) { return t->client == client; });
    if (found == tables_.end()) return nullptr;
    std::unique_ptr<Table> table = std::move(*found);
    tables_.erase(found);
    return table;
  }
  void put_back(std::unique_ptr<Table> table) {
    const std::lock_guard lock(mutex_);
    std::erase_if(tables_, [&](const auto& t) { return t->client == table->client; });
    if (tables_.size() >= clients_) tables_.erase(tables_.begin());
    tables_.push_back(std::move(table));
  }
  /// Takes the table of the least recently used client, or null.
  std::unique_ptr<Table> take_oldest() {
    const std::lock_guard lock(mutex_);
    if (tables_.empty()) return nullptr;
    std::unique_ptr<Table> table = std::move(tables_.front());
    tables_.erase(tables_.begin());
    return table;
  }
  template <class Visit>
  void for_each(Visit visit) const {
    const std::lock_guard lock(mutex_);
    for (const auto& t : tables_) visit(*t);
  }

 private:
  std::size_t clients_;
  mutable std::mutex mutex_;
  std::vector<std::unique_ptr<Table>> tables_;  // the latest last
};

/// The tables of the most recent clients, and of the jobs that use them. A job without a table begins cold, which costs
/// time only. Thread-safe.
class WarmStore {
 public:
  static constexpr std::size_t kClients = 64;              ///< evicts the least recently used beyond these
  static constexpr std::size_t kMostSimplices = 1u << 22;  ///< larger queries are always cold (28 bytes each)

  explicit WarmStore(std::uint64_t limit) : limit_(limit) {}  ///< bytes of all tables

  /// Takes the table that `client` left for the same query, or an empty one of the size. Null if the size is 0 or too
  /// large, or without space. Tables of the least recently used clients are evicted, but not those that jobs use.
  std::unique_ptr<WarmTable> take(std::uint64_t client, std::uint64_t question, std::uint64_t size);
  void put_back(std::unique_ptr<WarmTable> table);
  /// Takes the table of `client` if it is larger than `room` bytes.
  std::unique_ptr<WarmTable> trim(std::uint64_t client, std::uint64_t room);
  std::uint64_t bytes() const;         ///< of all tables
  std::uint64_t without_room() const;  ///< number of tables that did not fit

 private:
  std::uint64_t kept_bytes() const;

  const std::uint64_t limit_;
  mutable std::mutex mutex_;  // of the members below
  LatestTables<WarmTable> tables_{kClients};
  std::uint64_t in_use_ = 0;  // bytes, by jobs
  std::uint64_t without_room_ = 0;
};

}  // namespace clearance
