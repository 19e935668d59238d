// How a request ends: with a reply or an error, each of them counted. Every frame that the loop sends goes this way.
#pragma once

#include <spdlog/spdlog.h>

#include <memory>
#include <new>
#include <optional>
#include <string>

#include "log_text.h"
#include "refusal.h"
#include "stats.h"
#include "transport.h"
#include "wire/wire.h"

namespace clearance {

class Answers {
 public:
  /// Both must outlive this. \param engine the one that serves, which a new scene replaces.
  Answers(Stats& stats, const std::shared_ptr<Engine>& engine) : stats_(stats), engine_(engine) {}

  /// Throws a Refusal (kTooLarge) if it does not fit.
  void reply(ReplySink& sink, const wire::FrameHeader& request, wire::FrameType type,
             std::span<const std::byte> payload);
  /// The same in steps: room for the frame, where the payload is then written behind the header, and its publication.
  std::byte* reserve(ReplySink& sink, std::uint64_t payload_bytes);
  void publish(ReplySink& sink, const wire::FrameHeader& request, wire::FrameType type, std::byte* frame,
               std::uint64_t payload_bytes);
  /// Counts a request whose client is gone.
  void count_dropped() { ++stats_.dropped; }
  /// Counts the reply of a query, which was published.
  void count_query(std::uint64_t server_ns, std::uint64_t rows);
  void refuse(ReplySink& sink, const wire::FrameHeader& request, const Refusal& refusal);
  /// Runs `work`. Whatever it throws is answered with kError; then this returns false.
  template <class Work>
  bool guard(ReplySink& sink, const wire::FrameHeader& request, Work work) {
    const std::optional<Refusal> refusal = refusal_of(request, work);
    if (refusal) refuse(sink, request, *refusal);
    return !refusal;
  }
  /// Runs `work`. What it throws, in words for whoever asked. From any thread.
  template <class Work>
  static std::optional<Refusal> refusal_of(const wire::FrameHeader& request, Work work);

 private:
  Stats& stats_;
  const std::shared_ptr<Engine>& engine_;
};

constexpr wire::ErrorCode code_of(QueryErrorCode code) {
  return static_cast<wire::ErrorCode>(code);
}
static_assert(code_of(QueryErrorCode::kBadQuery) == wire::ErrorCode::kBadQuery);
static_assert(code_of(QueryErrorCode::kWrongScene) == wire::ErrorCode::kWrongScene);
static_assert(code_of(QueryErrorCode::kTooLarge) == wire::ErrorCode::kTooLarge);
static_assert(code_of(QueryErrorCode::kNotSupported) == wire::ErrorCode::kNotSupported);

template <class Work>
std::optional<Refusal> Answers::refusal_of(const wire::FrameHeader& request, Work work) {
  try {
    work();
    return std::nullopt;
  } catch (const Refusal& refusal) {
    return refusal;
  } catch (const wire::WireError& error) {
    return Refusal{error.code, error.what()};
  } catch (const QueryError& error) {
    return Refusal{code_of(error.code), error.what()};
  } catch (const std::bad_alloc&) {
    return Refusal{wire::ErrorCode::kTooLarge, "the daemon has no memory for this request"};
  } catch (const std::exception& error) {
    spdlog::error("event=internal_error request={} error=\"{}\"", wire::type_name(request.type),
                  log_text(error.what()));
    return Refusal{wire::ErrorCode::kInternal, std::string("internal error of the daemon: ") + error.what()};
  }
}

}  // namespace clearance
