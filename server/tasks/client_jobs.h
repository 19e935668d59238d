// Jobs of clients that repeat a query in other configurations.
#pragma once

#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <unordered_map>

#include "engine/query/job_pool.h"
#include "server/requests/transport.h"
#include "server/tasks/query_key.h"

namespace clearance {

/// The last queries of each client, with pools of their jobs. A client's queries replace its own alone. Used on the
/// loop's thread.
class ClientJobs {
 public:
  static constexpr std::size_t kQueries = 8;    ///< of a client
  static constexpr std::size_t kJobs = 2;       ///< of a query, since a client may send the next one early
  static constexpr std::size_t kBodies = 8192;  ///< of the scene, times queries: a job has up to 1 KB for each

  /// Returns the pool of a client's query, or null for a client whose end is not detected.
  /// @param bodies number of bodies in the scene
  std::shared_ptr<JobPool> pool_of(const ReplySink& sink, const QueryView& query, std::size_t bodies);
  /// Frees the jobs of clients that are gone.
  void drop_gone();

 private:
  struct Kept {
    QueryKey key;
    std::shared_ptr<JobPool> pool;
  };
  struct Client {
    std::function<bool()> is_there;
    std::list<Kept> queries;  // the last one is at the front
  };
  std::unordered_map<std::uint64_t, Client> clients_;
};

}  // namespace clearance
