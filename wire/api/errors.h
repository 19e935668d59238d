// Errors that the engine library and the client library share.
#pragma once

#include <clearance/query.h>

#include <cstdint>
#include <stdexcept>
#include <string>

namespace clearance {

/// Bad input at set-up, such as a scene file, a mesh or a body. The text names file, line, key and expected value.
struct CLEARANCE_API SceneError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// A rejected query or update. `code` is a wire::ErrorCode (protocol.h); of the engine, one of the first four.
struct CLEARANCE_API QueryError : std::runtime_error {
  QueryError(std::uint16_t c, const std::string& what) : std::runtime_error(what), code(c) {}
  std::uint16_t code;
};

/// The scene has changed since a query was prepared, and ids of the query mean something else. The text names one.
struct CLEARANCE_API StaleQuery : QueryError {
  using QueryError::QueryError;
};

}  // namespace clearance
