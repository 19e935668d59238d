// Why a request is refused as a whole.
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>

namespace clearance {

/// Why a query as a whole cannot be answered. A bad pose or an unknown body is a Status of its rows, not an error.
enum class QueryErrorCode : std::uint16_t {
  kBadQuery = 1,      ///< a malformed value; the text says which
  kWrongScene = 2,    ///< the caller knows another scene revision
  kTooLarge = 3,      ///< more rows than allowed
  kNotSupported = 4,  ///< legal, but this build or backend cannot
};

struct QueryError : std::runtime_error {
  QueryError(QueryErrorCode c, const std::string& what) : std::runtime_error(what), code(c) {}
  QueryErrorCode code;
};

}  // namespace clearance
