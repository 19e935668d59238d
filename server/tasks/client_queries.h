// Small queries of clients. A client that repeats one in other configurations pays neither for parsing nor for preparing
// it again.
#pragma once

#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <span>
#include <unordered_map>
#include <vector>

#include "engine/engine.h"
#include "engine/query/job_pool.h"
#include "server/requests/transport.h"
#include "wire/wire.h"

namespace clearance {

/// A parsed query, with what follows from it in any configurations.
struct ClientQuery {
  wire::QueryParts parts;
  QueryCost cost;
  std::shared_ptr<JobPool> jobs;  ///< of this query; null if none are kept
};

/// The last queries of each client. A client's queries replace its own alone. Used on the loop's thread.
class ClientQueries {
 public:
  static constexpr std::size_t kJobs = 2;  ///< of a query, since a client may send the next one early

  /// Returns the query in a payload of at most kLargePayload bytes whose first one lies on a multiple of 8. It is valid
  /// until the next call, and while the payload is. Keeps it unless the client's end is not seen at once. Throws
  /// WireError.
  const ClientQuery& read(const ReplySink& sink, const wire::FrameHeader& header, std::span<const std::byte> payload,
                          const engine::Engine& engine);
  /// Frees the queries of clients that are gone.
  void drop_gone();

 private:
  /// Bytes of a payload.
  struct Range {
    std::size_t begin, bytes;
    std::size_t end() const { return begin + bytes; }
  };
  /// A query with a copy of its payload. Another payload is the same query if they differ in its inputs alone: the stamp
  /// that it waits for, and its configurations. The other bytes determine where these are.
  struct Kept {
    Kept(const wire::FrameHeader& request, std::span<const std::byte> payload);
    bool is_of(const wire::FrameHeader& request, std::span<const std::byte> payload) const;
    void take_inputs(std::span<const std::byte> payload);

    wire::FrameHeader header;
    std::vector<std::uint64_t> copy;
    Range configurations, positions, velocities, twists;
    std::uint64_t scene_revision = 0;  ///< of the cost
    ClientQuery query;
  };
  struct Client {
    std::function<bool()> is_there;
    std::list<Kept> queries;  ///< the last one is at the front
  };
  /// Null for a client whose end is not seen at once.
  Client* client_of(const ReplySink& sink);

  std::unordered_map<std::uint64_t, Client> clients_;
  ClientQuery unkept_;
};

}  // namespace clearance
