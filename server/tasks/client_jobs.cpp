#include "server/tasks/client_jobs.h"

namespace clearance {

std::shared_ptr<JobPool> ClientJobs::pool_of(const ReplySink& sink, const QueryView& query, std::size_t bodies) {
  if (!JobPool::allows(query)) return nullptr;
  auto client = clients_.find(sink.client());
  if (client == clients_.end()) {
    if (!sink.sees_end()) return nullptr;
    client = clients_.emplace(sink.client(), Client{sink.watch(), RecentQueries(kJobs)}).first;
  }
  return client->second.queries.pool_of(query, bodies);
}

void ClientJobs::drop_gone() {
  std::erase_if(clients_, [](const auto& client) { return !client.second.is_there(); });
}

}  // namespace clearance
