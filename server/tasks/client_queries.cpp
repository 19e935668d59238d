#include "server/tasks/client_queries.h"

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <utility>

#include "engine/query/recent_queries.h"
#include "server/tasks/query_input.h"

namespace clearance {
namespace {

constexpr std::size_t kStamp = offsetof(wire::QueryHeader, min_pose_stamp_ns),
                      kStampEnd = kStamp + sizeof(wire::QueryHeader::min_pose_stamp_ns);

std::int64_t stamp_in(std::span<const std::byte> payload) {
  std::int64_t stamp;
  std::memcpy(&stamp, payload.data() + kStamp, sizeof stamp);
  return stamp;
}

}  // namespace

ClientQueries::Kept::Kept(const wire::FrameHeader& request, std::span<const std::byte> payload)
    : header(request), copy((payload.size() + 7) / 8) {
  std::memcpy(copy.data(), payload.data(), payload.size());
  const std::span<const std::byte> own = std::as_bytes(std::span(copy)).first(payload.size());
  query.parts = wire::parse_query(header, own);
  const auto range_of = [&](const auto& records, std::size_t if_empty) {
    return records.size() == 0 ? Range{if_empty, 0}
                               : Range{static_cast<std::size_t>(records.data() - own.data()), records.size_bytes()};
  };
  configurations = range_of(query.parts.configurations, kStampEnd);
  positions = range_of(query.parts.positions, configurations.end());
  velocities = range_of(query.parts.velocities, positions.end());
  twists = range_of(query.parts.twists, velocities.end());
}

bool ClientQueries::Kept::is_of(const wire::FrameHeader& request, std::span<const std::byte> payload) const {
  if (request.payload_bytes != header.payload_bytes || request.records_bytes != header.records_bytes ||
      request.scene_revision != header.scene_revision)
    return false;
  if (stamp_in(payload) < 0) return false;  // parse_query() rejects it
  const auto same = [&, own = std::as_bytes(std::span(copy))](std::size_t begin, std::size_t end) {
    return std::memcmp(own.data() + begin, payload.data() + begin, end - begin) == 0;
  };
  return same(0, kStamp) && same(kStampEnd, configurations.begin) && same(configurations.end(), positions.begin) &&
         same(positions.end(), velocities.begin) && same(velocities.end(), twists.begin) &&
         same(twists.end(), payload.size());
}

void ClientQueries::Kept::take_inputs(std::span<const std::byte> payload) {
  wire::QueryParts& parts = query.parts;
  parts.header.min_pose_stamp_ns = parts.options.min_pose_stamp_ns = stamp_in(payload);
  parts.configurations = {payload.data() + configurations.begin, parts.configurations.size()};
  parts.positions = {payload.data() + positions.begin, parts.positions.size()};
  parts.velocities = {payload.data() + velocities.begin, parts.velocities.size()};
  parts.twists = {payload.data() + twists.begin, parts.twists.size()};
}

ClientQueries::Client* ClientQueries::client_of(const ReplySink& sink) {
  const auto client = clients_.find(sink.client());
  if (client != clients_.end()) return &client->second;
  if (!sink.sees_end()) return nullptr;
  return &clients_.emplace(sink.client(), Client{sink.watch(), {}}).first->second;
}

const ClientQuery& ClientQueries::read(const ReplySink& sink, const wire::FrameHeader& header,
                                       std::span<const std::byte> payload, const engine::Engine& engine) {
  Client* const client = client_of(sink);
  if (client) {
    std::list<Kept>& queries = client->queries;
    const auto found =
        std::find_if(queries.begin(), queries.end(), [&](const Kept& kept) { return kept.is_of(header, payload); });
    if (found != queries.end()) {
      queries.splice(queries.begin(), queries, found);
      found->take_inputs(payload);
      if (const std::uint64_t now = engine.scene_revision(); found->scene_revision != now) {
        found->query.cost = engine.cost(view_of(found->query.parts, header.scene_revision));
        found->scene_revision = now;
      }
      return found->query;
    }
  }
  unkept_ = {.parts = wire::parse_query(header, payload), .cost = {}, .jobs = nullptr};
  const QueryView view = view_of(unkept_.parts, header.scene_revision);
  unkept_.cost = engine.cost(view);
  if (!client || !JobPool::allows(view)) return unkept_;
  Kept& kept = client->queries.emplace_front(header, payload);
  const std::size_t most = RecentQueries::most(engine.scene().bodies().size());
  while (client->queries.size() > most) client->queries.pop_back();
  kept.scene_revision = engine.scene_revision();
  kept.query.cost = unkept_.cost;
  kept.query.jobs = std::make_shared<JobPool>(kJobs);
  return kept.query;
}

void ClientQueries::drop_gone() {
  std::erase_if(clients_, [](const auto& client) { return !client.second.is_there(); });
}

}  // namespace clearance
