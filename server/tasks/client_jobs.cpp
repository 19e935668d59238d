#include "server/tasks/client_jobs.h"

#include <algorithm>

namespace clearance {

std::shared_ptr<JobPool> ClientJobs::pool_of(const ReplySink& sink, const QueryView& query, std::size_t bodies) {
  if (!JobPool::allows(query)) return nullptr;
  auto client = clients_.find(sink.client());
  if (client == clients_.end()) {
    std::function<bool()> is_there = sink.watch();
    if (!is_there) return nullptr;
    client = clients_.emplace(sink.client(), Client{std::move(is_there), {}}).first;
  }
  std::list<Kept>& queries = client->second.queries;
  const auto found =
      std::find_if(queries.begin(), queries.end(), [&](const Kept& kept) { return kept.key.is_of(query); });
  if (found != queries.end()) {
    queries.splice(queries.begin(), queries, found);
  } else {
    queries.push_front({QueryKey(query), std::make_shared<JobPool>(kJobs)});
    const std::size_t most = std::clamp<std::size_t>(kBodies / std::max<std::size_t>(bodies, 1), 1, kQueries);
    while (queries.size() > most) queries.pop_back();
  }
  return queries.front().pool;
}

void ClientJobs::drop_gone() {
  std::erase_if(clients_, [](const auto& client) { return !client.second.is_there(); });
}

}  // namespace clearance
