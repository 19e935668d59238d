// A request on the loop, and what each type of request needs.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>

#include "server/requests/transport.h"
#include "wire/protocol.h"

namespace clearance {

class RequestRouter;
struct Request;

/// In scenes of more bodies the loop does no work that takes a step for each of them.
inline constexpr std::size_t kFewBodies = 1000;

/// Where a request is answered.
enum class RunsOn : std::uint8_t {
  kLoop,         ///< at once
  kLoopIfSmall,  ///< at once, or by the worker of the client's class
  kWorker,       ///< by the worker of the client's class
  kPointWorker,
  kPlanWorker,
  kRunWorker,
  kSceneThread,  ///< by the thread that makes another engine
};

/// How the router reads a small request's payload.
enum class Payload : std::uint8_t {
  kEmpty,  ///< reads its records, and rejects any other content
  kBody,   ///< reads its records, and passes on the rest
  kWhole,  ///< leaves the records to the handler
};

/// A row of the table in request_router.cpp.
struct RequestType {
  wire::FrameType type;
  Rights right;  ///< that the client needs, or 0
  RunsOn runs_on;
  Payload payload;
  wire::FrameType reply;
  void (*handle)(RequestRouter& router, Request& request);
};

struct Request {
  const wire::FrameHeader& header;
  std::span<const std::byte> payload;  ///< of a small request, valid during the call
  std::function<OwnPayload()> fetch;   ///< of a large request: brings the payload, once, on any thread
  std::uint64_t bytes;                 ///< of the payload
  std::unique_ptr<ReplySink> sink;     ///< taken by a request that is answered later
  std::chrono::steady_clock::time_point received;
  const RequestType* type = nullptr;

  bool is_large() const { return fetch != nullptr; }
  /// Returns a function that brings the payload after the call, too: a copy of a small one.
  std::function<OwnPayload()> take_payload();
};

}  // namespace clearance
