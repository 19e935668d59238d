// Payloads without their records, and records as bytes.
#pragma once

#include <cstdint>
#include <span>

#include "server/requests/reply_writer.h"
#include "wire/wire.h"

namespace clearance {

template <class Record>
std::span<const std::byte> bytes_of(const Record& record) {
  return std::as_bytes(std::span(&record, 1));
}

/// Payload of a request whose only known record is the epoch. Throws WireError if an unknown one is required, and
/// RejectedRequest for another epoch.
/// @param ignored count of the others, to which it adds
inline std::span<const std::byte> without_records(const ReplyWriter& answers, const wire::FrameHeader& header,
                                                  std::span<const std::byte> payload, std::uint64_t& ignored) {
  if (header.records_bytes == 0) {
    answers.check_epoch(header, 0);
    return payload;
  }
  const wire::PayloadParts parts = wire::split_payload(header, payload);
  wire::PassedOver passed_over;
  const std::uint64_t epoch = wire::read_records(wire::type_name(header.type).c_str(), parts.records, passed_over,
                                                 [](const wire::RecordView&) { return false; });
  ignored += passed_over.size();
  answers.check_epoch(header, epoch);
  return parts.body;
}

}  // namespace clearance
