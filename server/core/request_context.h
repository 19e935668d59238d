// State that the handlers of requests share, and the ways in which they answer.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <unordered_map>

#include "engine/engine.h"
#include "server/base/stats.h"
#include "server/core/request.h"
#include "server/core/workers.h"
#include "server/limits/quotas.h"
#include "server/requests/reply_writer.h"
#include "server/tasks/background_request.h"

namespace clearance {

/// Used on the loop's thread.
class RequestContext {
 public:
  RequestContext(std::shared_ptr<engine::Engine> engine_, Workers& workers_, const Quotas::Limits& limits,
                 bool require_epoch)
      : engine(std::move(engine_)), workers(workers_), answers(stats, engine, require_epoch), quotas(limits) {}

  std::shared_ptr<engine::Engine> engine;  ///< replaced when the scene changes
  Workers& workers;
  Stats stats;
  ReplyWriter answers;
  Quotas quotas;
  bool poses_changed = false;  ///< since the last tick

  void reply(Request& request, std::span<const std::byte> payload) {
    answers.reply(*request.sink, request.header, request.type->reply, payload);
  }
  /// Answers a request in the background, within the client's quota. Takes the sink unless it throws RejectedRequest.
  /// @param bytes that the request takes of the quota
  void reply_in_background(Request& request, std::uint64_t bytes, BackgroundRequest::Make make,
                           BackgroundRequest::Done done = nullptr) {
    check_quota(request, bytes);
    submit(request, bytes, std::move(make), std::move(done));
  }
  /// The two steps of that. Throws RejectedRequest.
  void check_quota(const Request& request, std::uint64_t bytes) const;
  void submit(Request& request, std::uint64_t bytes, BackgroundRequest::Make make, BackgroundRequest::Done done);

  /// Class of a client's request, which may be lower than its client's (kFramePlanning). While a worker applies poses
  /// of the client, a request has the class of these, so that it cannot overtake them.
  ServiceClass class_for(const ReplySink& sink, const wire::FrameHeader& header) const;
  /// Pose updates of a client on a worker. Later requests of that client must not overtake them.
  bool has_pose_updates(std::uint64_t client) const { return pose_updates_.contains(client); }
  void begin_pose_update(std::uint64_t client, ServiceClass service);
  void end_pose_update(std::uint64_t client);

 private:
  struct PendingUpdates {
    std::uint32_t count = 0;
    ServiceClass service;
  };
  std::unordered_map<std::uint64_t, PendingUpdates> pose_updates_;  // by client
};

}  // namespace clearance
