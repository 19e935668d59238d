// Jobs of clients that repeat a query in other configurations.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <unordered_map>

#include "engine/query/recent_queries.h"
#include "server/requests/transport.h"

namespace clearance {

/// The last queries of each client, with pools of their jobs. A client's queries replace its own alone. Used on the
/// loop's thread.
class ClientJobs {
 public:
  static constexpr std::size_t kJobs = 2;  ///< of a query, since a client may send the next one early

  /// Returns the pool of a client's query, or null for a client whose end is not seen at once.
  /// @param bodies number of bodies in the scene
  std::shared_ptr<JobPool> pool_of(const ReplySink& sink, const QueryView& query, std::size_t bodies);
  /// Frees the jobs of clients that are gone.
  void drop_gone();

 private:
  struct Client {
    std::function<bool()> is_there;
    RecentQueries queries;
  };
  std::unordered_map<std::uint64_t, Client> clients_;
};

}  // namespace clearance
