// The reply to a request for a certificate, made in slices as it can take seconds.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "engine/engine.h"
#include "server/requests/reply_writer.h"
#include "server/requests/transport.h"

namespace clearance {

/// Used on a worker.
class CertificateRequest {
 public:
  /// Limit of a document.
  static constexpr std::uint64_t kMostBytes = std::uint64_t{64} << 20;

  /// @param answers outlives this
  /// @param fetch brings the request's payload
  CertificateRequest(const ReplyWriter& answers, std::shared_ptr<const Engine> engine, const wire::FrameHeader& request,
                     std::function<OwnPayload()> fetch)
      : answers_(answers), engine_(std::move(engine)), request_(request), fetch_(std::move(fetch)) {}

  /// Works for about `budget`. Returns the payload of kCertificate once it is complete. Throws RejectedRequest,
  /// QueryError or WireError.
  /// @param ignored count of unknown records, to which it adds
  std::optional<std::vector<std::byte>> advance(std::chrono::nanoseconds budget, std::uint64_t& ignored);

 private:
  void begin(std::uint64_t& ignored);

  const ReplyWriter& answers_;
  std::shared_ptr<const Engine> engine_;  // outlives run_
  wire::FrameHeader request_;
  std::function<OwnPayload()> fetch_;
  OwnPayload payload_;  // outlives run_, as does aligned_
  std::vector<std::uint64_t> aligned_;
  std::optional<CertificateRun> run_;
};

}  // namespace clearance
