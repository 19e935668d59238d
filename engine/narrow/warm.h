// Warm state: where GJK ended for each pair of a client's last query, to begin there in its next one.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <utility>
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
  std::vector<WarmSimplex> simplices;  // never another size
  std::uint64_t bytes() const { return simplices.size() * sizeof(WarmSimplex); }
};

/// One table of each of the clients that asked last. Thread-safe; a table belongs to one job at a time.
/// \tparam Table has a `client`.
template <class Table>
class LatestTables {
 public:
  explicit LatestTables(std::size_t clients) : clients_(clients) {}  ///< more: the one longest silent is let go

  /// The table that the client left; null: there is none.
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
  /// The table of the client that was silent for longest; null: there is none.
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

/// The tables of the clients that asked last, and of the jobs that work on them. A job that gets none begins cold,
/// which costs time only. Thread-safe.
class WarmStore {
 public:
  static constexpr std::size_t kClients = 64;              ///< more clients: the one longest silent begins cold again
  static constexpr std::size_t kMostSimplices = 1u << 22;  ///< larger questions are always cold (28 bytes each)

  explicit WarmStore(std::uint64_t limit) : limit_(limit) {}  ///< bytes of all tables

  /// The table that `client` left for the same question, or an empty one of the size; null where the size is 0 or too
  /// large, or there is no room: what clients have left makes way, the longest silent first, but not what jobs work on.
  std::unique_ptr<WarmTable> take(std::uint64_t client, std::uint64_t question, std::uint64_t size);
  void put_back(std::unique_ptr<WarmTable> table);
  /// What `client` left, if it takes more than `room` bytes.
  std::unique_ptr<WarmTable> trim(std::uint64_t client, std::uint64_t room);
  std::uint64_t bytes() const;         ///< of all tables
  std::uint64_t without_room() const;  ///< times that there was no room

 private:
  std::uint64_t kept_bytes() const;

  const std::uint64_t limit_;
  mutable std::mutex mutex_;  // of what follows
  LatestTables<WarmTable> tables_{kClients};
  std::uint64_t in_use_ = 0;  // bytes, by jobs
  std::uint64_t without_room_ = 0;
};

}  // namespace clearance
