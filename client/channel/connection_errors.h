// Errors of connections to a daemon.
#pragma once

#include <clearance/errors.h>

#include <stdexcept>

namespace clearance {

/// The daemon is unreachable or lost.
struct CLEARANCE_API ConnectionError : std::runtime_error {
  using std::runtime_error::runtime_error;
};
struct CLEARANCE_API TimeoutError : ConnectionError {
  using ConnectionError::ConnectionError;
};
/// The daemon rejected a request; `code` is a wire::ErrorCode.
struct CLEARANCE_API RequestError : QueryError {
  using QueryError::QueryError;
};

/// The daemon was restarted, or is another one, since this client's first contact, and has lost the poses, attachments
/// and bodies that clients had sent. Requests are rejected with this error until Client::acknowledge_epoch().
struct CLEARANCE_API NewEpoch : RequestError {
  using RequestError::RequestError;
};
/// The daemon exists, but its loop stood still for ConnectOptions::hang during a request.
struct CLEARANCE_API DaemonHung : ConnectionError {
  using ConnectionError::ConnectionError;
};

}  // namespace clearance
