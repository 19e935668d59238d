// The reply to a request for a certificate, made in slices: a few bytes can ask for what takes seconds.
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

/// On the thread that works.
class CertificateRequest {
 public:
  /// Of a document; a larger one is refused.
  static constexpr std::uint64_t kMostBytes = std::uint64_t{64} << 20;

  /// \param answers must outlive this. \param fetch brings the request's payload.
  CertificateRequest(const ReplyWriter& answers, std::shared_ptr<const Engine> engine, const wire::FrameHeader& request,
                     std::function<OwnPayload()> fetch)
      : answers_(answers), engine_(std::move(engine)), request_(request), fetch_(std::move(fetch)) {}

  /// Works for about `budget`. Returns the payload of kCertificate once it is whole. Throws what the request is refused
  /// for. \param ignored counts records of the request that nobody here knows.
  std::optional<std::vector<std::byte>> advance(std::chrono::nanoseconds budget, std::uint64_t& ignored);

 private:
  void begin(std::uint64_t& ignored);

  const ReplyWriter& answers_;
  std::shared_ptr<const Engine> engine_;  // outlives run_
  wire::FrameHeader request_;
  std::function<OwnPayload()> fetch_;
  OwnPayload payload_;  // outlives run_, as do its bytes here
  std::vector<std::uint64_t> aligned_;
  std::optional<CertificateRun> run_;
};

}  // namespace clearance
