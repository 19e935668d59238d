#include "server/tasks/certificate_request.h"

#include <utility>

namespace clearance {

std::optional<std::vector<std::byte>> CertificateRequest::advance(std::chrono::nanoseconds budget,
                                                                  std::uint64_t& ignored) {
  if (!run_) {
    begin(ignored);
    return std::nullopt;
  }
  if (!run_->advance({.time = budget})) return std::nullopt;
  std::vector<std::byte> document = run_->take();
  run_.reset();
  return document;
}

void CertificateRequest::begin(std::uint64_t& ignored) {
  const wire::QueryParts parts = read(ignored);
  if (parts.options.min_pose_stamp_ns != 0 || parts.options.deadline_ns != 0)
    throw RejectedRequest{
        wire::ErrorCode::kNotSupported,
        "certificate: min_pose_stamp_ns and deadline_ns are not supported; request it once the poses are there"};
  CertificateRows rows{{}, kMostBytes};
  if (parts.has_rows) {
    CertificateRows::check_count(parts.rows.size());
    rows.numbers.emplace();
    rows.numbers->reserve(parts.rows.size());
    for (std::uint64_t i = 0; i < parts.rows.size(); ++i) rows.numbers->push_back(parts.rows[i]);
  }
  run_.emplace(engine_->begin_certificate(view_of(parts, request_.scene_revision), std::move(rows)));
}

}  // namespace clearance
