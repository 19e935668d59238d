// Errors that reject a whole query or pose update.
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>

namespace clearance {

/// Reason that a whole query cannot be answered. A bad pose or an unknown body is a Status of its rows, not an error.
enum class QueryErrorCode : std::uint16_t {
  kBadQuery = 1,      ///< an invalid value; the text names it
  kWrongScene = 2,    ///< the caller has another scene revision
  kTooLarge = 3,      ///< more rows than allowed
  kNotSupported = 4,  ///< valid, but unsupported by this build or backend
};

namespace engine {

struct QueryError : std::runtime_error {
  QueryError(QueryErrorCode c, const std::string& what) : std::runtime_error(what), code(c) {}
  QueryErrorCode code;
};

}  // namespace engine

/// A rejected update of an engine that is being replaced, which must be applied to its successor instead.
struct UpdatesStopped : engine::QueryError {
  UpdatesStopped()
      : engine::QueryError(QueryErrorCode::kWrongScene, "another engine takes over the state of this one") {}
};

}  // namespace clearance
