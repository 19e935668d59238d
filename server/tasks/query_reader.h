// Reads a payload in the layout of a query, of a request for pairs, a certificate or a plan. Used on a worker.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "server/requests/reply_writer.h"
#include "server/requests/transport.h"
#include "server/tasks/query_input.h"

namespace clearance {

class QueryReader {
 public:
  /// @param answers outlives this
  /// @param fetch brings the payload
  QueryReader(const ReplyWriter& answers, std::shared_ptr<const engine::Engine> engine,
              const wire::FrameHeader& request, std::function<OwnPayload()> fetch)
      : engine_(std::move(engine)), request_(request), answers_(answers), fetch_(std::move(fetch)) {}

 protected:
  /// Reads the payload, which the result refers to, once. Throws WireError or RejectedRequest.
  /// @param ignored count of unknown records, to which it adds
  wire::QueryParts read(std::uint64_t& ignored) {
    payload_ = std::exchange(fetch_, nullptr)();
    const wire::QueryParts parts = wire::parse_query(request_, aligned(payload_.span(), aligned_));
    ignored += parts.passed_over.size();
    answers_.check_epoch(request_, parts.epoch);
    return parts;
  }

  std::shared_ptr<const engine::Engine> engine_;
  wire::FrameHeader request_;

 private:
  const ReplyWriter& answers_;
  std::function<OwnPayload()> fetch_;
  OwnPayload payload_;
  std::vector<std::uint64_t> aligned_;
};

}  // namespace clearance
