// Conversion of a caller's requests to the wire format.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "client/client.h"
#include "client/record_list.h"
#include "wire/query_contradictions.h"
#include "wire/wire.h"

namespace clearance {

/// What only some queries have.
struct QueryExtras {
  std::optional<std::span<const std::uint64_t>> rows = {};  ///< row numbers of kCertify, by default all
  std::optional<std::uint32_t> plan = {};                   ///< number of configurations of kOpenPlan
  std::optional<std::uint64_t> scene_revision = {};         ///< of the query's ids, instead of revision_of_ids()
};

/// Throws std::invalid_argument for inconsistent configurations and bodies, wire::WireError for counts that are too
/// large.
/// \param plan number of configurations of each run of kOpenPlan, whose query has none
wire::QueryHeader header_of(const Query& query, std::optional<std::uint32_t> plan = {});

/// Returns the records of a query's options and margins outside the header.
std::vector<std::byte> query_records(const Query& query);
/// Inserts the records of its joints and, if requested, of their positions and its other inputs, which outlive the list.
void add_inputs(const Query& query, bool with_configurations, RecordList& records);

/// Returns an upper bound on the size of the reply's frame in bytes, or 0 if only the daemon knows.
/// \param scene the known scene, or null
/// \param k of the query
std::uint64_t expected_reply_bytes(const wire::QueryHeader& q, std::span<const IdPair> pairs, std::size_t joints,
                                   const SceneInfo* scene, std::uint32_t k = 0);

/// Throws std::invalid_argument for a name that is too long.
void set_body_name(char (&field)[64], std::string_view name);

/// Returns the payload of kAddBody. Throws std::invalid_argument unless there is exactly one shape.
std::vector<std::byte> payload_of(const NewBody& body);
/// Returns the records of kAddBody: what differs from its defaults.
/// @param replaces whether the shape replaces that of an existing body
std::vector<std::byte> records_of(const NewBody& body, bool replaces = false);

/// Throws RequestError for options that contradict each other.
inline void check_contradictions(const Query& query) {
  const Contradiction wrong = contradiction_in(query);
  if (!wrong.text) return;
  const wire::ErrorCode code = wrong.is_unsupported ? wire::ErrorCode::kNotSupported : wire::ErrorCode::kBadQuery;
  throw RequestError(static_cast<std::uint16_t>(code), wrong.text);
}

}  // namespace clearance
