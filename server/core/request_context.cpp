#include "server/core/request_context.h"

#include <cstring>
#include <utility>

#include "engine/narrow/work_meter.h"
#include "wire/aligned_buffer.h"

namespace clearance {

std::function<OwnPayload()> Request::take_payload() {
  if (fetch) return std::move(fetch);
  const std::shared_ptr<std::byte> copy(aligned_bytes(payload.size()).release(), FreeDeleter());
  if (!payload.empty()) std::memcpy(copy.get(), payload.data(), payload.size());
  count_copied(payload.size());
  return [own = OwnPayload{copy, payload.size()}] { return own; };
}

void RequestContext::check_quota(const Request& request, std::uint64_t bytes) const {
  const ReplySink& sink = *request.sink;
  quotas.check_requests(sink.client());
  quotas.check_bytes(sink.client(), class_for(sink, request.header), bytes, sink.unsent_bytes());
}

void RequestContext::submit(Request& request, std::uint64_t bytes, BackgroundRequest::Make make,
                            BackgroundRequest::Done done) {
  const ServiceClass service = class_for(*request.sink, request.header);
  const RunsOn where = request.type->runs_on;
  const bool is_light = where == RunsOn::kPlanWorker || where == RunsOn::kRunWorker;
  PendingRequest pending{nullptr, request.header, quotas.take(request.sink->client(), service, bytes)};
  pending.sink = std::move(request.sink);
  workers.of(where, service)
      .add(std::make_unique<BackgroundRequest>(
          answers, std::move(pending), service, request.type->reply, request.received, std::move(make), std::move(done),
          is_light ? BackgroundRequest::Weight::kLight : BackgroundRequest::Weight::kHeavy));
}

ServiceClass RequestContext::class_for(const ReplySink& sink, const wire::FrameHeader& header) const {
  if (const auto away = pose_updates_.find(sink.client()); away != pose_updates_.end()) return away->second.service;
  return header.flags & wire::kFramePlanning ? ServiceClass::kPlanning : sink.service_class();
}

void RequestContext::begin_pose_update(std::uint64_t client, ServiceClass service) {
  ++pose_updates_.try_emplace(client, PendingUpdates{0, service}).first->second.count;
}

void RequestContext::end_pose_update(std::uint64_t client) {
  if (--pose_updates_.at(client).count == 0) pose_updates_.erase(client);
}

}  // namespace clearance
