// What a caller asks for, as the wire has it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "client/client.h"
#include "wire/wire.h"

namespace clearance {

/// Throws std::invalid_argument for configurations and bodies that do not match, wire::WireError for more than fits.
/// \param plan of kOpenPlan: how many configurations its runs will have; the query has none then
wire::QueryHeader header_of(const Query& query, std::optional<std::uint32_t> plan = {});

/// Names of its options that travel in records, which not every daemon knows.
std::string options_in_records(const Query& query);

/// The records of a query: its options and arrays that have no place in the header.
std::vector<std::byte> query_records(const Query& query);

/// Bytes of the whole frame that answers a query, at most; 0 if only the daemon knows.
/// \param scene what is known of it; null: nothing.
std::uint64_t expected_reply_bytes(const wire::QueryHeader& q, std::span<const IdPair> pairs, std::size_t joints,
                                   const SceneInfo* scene);

/// Throws std::invalid_argument for a name that has no room.
void set_body_name(char (&field)[64], std::string_view name);

/// The payload of kAddBody. Throws std::invalid_argument unless there is exactly one shape.
std::vector<std::byte> payload_of(const NewBody& body);
/// The records of kAddBody: what is not known of the body; empty where nothing is said of that.
std::vector<std::byte> records_of(const NewBody& body);

}  // namespace clearance
