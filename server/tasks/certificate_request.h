// The reply to a request for a certificate, made in slices as it can take seconds.
#pragma once

#include <chrono>
#include <optional>
#include <vector>

#include "server/tasks/query_reader.h"

namespace clearance {

/// Used on a worker.
class CertificateRequest : private QueryReader {
 public:
  /// Limit of a document.
  static constexpr std::uint64_t kMostBytes = std::uint64_t{64} << 20;

  using QueryReader::QueryReader;

  /// Works for about `budget`. Returns the payload of kCertificate once it is complete. Throws RejectedRequest,
  /// QueryError or WireError.
  /// @param ignored count of unknown records, to which it adds
  std::optional<std::vector<std::byte>> advance(std::chrono::nanoseconds budget, std::uint64_t& ignored);

 private:
  void begin(std::uint64_t& ignored);

  std::optional<CertificateRun> run_;
};

}  // namespace clearance
