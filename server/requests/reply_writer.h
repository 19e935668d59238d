// How a request ends: with a reply or an error, each of them counted. Every frame that the loop sends goes this way.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "server/base/rejected_request.h"
#include "server/base/stats.h"
#include "server/requests/transport.h"
#include "wire/wire.h"

namespace clearance {

class ReplyWriter {
 public:
  /// Both must outlive this. \param engine the one that serves, which a new scene replaces. \param require_epoch
  /// requests that deal with poses and name no epoch are refused.
  ReplyWriter(Stats& stats, const std::shared_ptr<Engine>& engine, bool require_epoch);

  /// Which run of the daemon answers (wire::CommonRecord::kEpoch).
  std::uint64_t epoch() const { return epoch_; }
  /// Whether a request is for this run of the daemon; throws a Refusal (kNewEpoch) if not: what was sent to another one
  /// (poses, attachments, bodies) is not here, so an answer would be of other poses than the client thinks. From any
  /// thread. \param named by its records; 0: none
  void check_epoch(const wire::FrameHeader& request, std::uint64_t named) const;
  /// What the reply to a query ends in. From any thread. \param passed_over tags of the request's records that nobody
  /// here knows. \param joints J of one with the column gradient_joints, else 0
  std::vector<std::byte> records(const wire::PassedOver& passed_over, std::size_t joints) const;

  /// Throws a Refusal (kTooLarge) if it does not fit.
  void reply(ReplySink& sink, const wire::FrameHeader& request, wire::FrameType type,
             std::span<const std::byte> payload);
  /// The same in steps: room for the frame, where the payload is then written behind the header, and its publication.
  std::byte* reserve(ReplySink& sink, std::uint64_t payload_bytes);
  void publish(ReplySink& sink, const wire::FrameHeader& request, wire::FrameType type, std::byte* frame,
               std::uint64_t payload_bytes);
  /// Counts a request whose client is gone.
  void count_dropped() { ++stats_.dropped; }
  /// Counts records of requests that the daemon does not know.
  void count_ignored(std::uint64_t records) { stats_.records_ignored += records; }
  /// Counts the reply of a query, which was published.
  void count_query(std::uint64_t server_ns, std::uint64_t rows);
  void refuse(ReplySink& sink, const wire::FrameHeader& request, const RejectedRequest& refusal);
  /// Runs `work`. Whatever it throws is answered with kError; then this returns false.
  template <class Work>
  bool guard(ReplySink& sink, const wire::FrameHeader& request, Work work) {
    const std::optional<RejectedRequest> refusal = refusal_of(request, work);
    if (refusal) refuse(sink, request, *refusal);
    return !refusal;
  }
  /// Runs `work`. What it throws, in words for whoever asked. From any thread.
  template <class Work>
  static std::optional<RejectedRequest> refusal_of(const wire::FrameHeader& request, Work work) {
    try {
      work();
      return std::nullopt;
    } catch (...) {
      return rejection_of_caught(request);
    }
  }

 private:
  /// The exception that is being handled, in words for whoever asked. Not in guard(), which every user compiles: to
  /// format one line of the log takes the compiler five seconds.
  static RejectedRequest rejection_of_caught(const wire::FrameHeader& request);

  Stats& stats_;
  const std::shared_ptr<Engine>& engine_;
  const std::uint64_t epoch_;
  const bool require_epoch_;
  std::vector<std::byte> epoch_record_;  // the end of every reply
};

constexpr wire::ErrorCode code_of(QueryErrorCode code) {
  return static_cast<wire::ErrorCode>(code);
}
static_assert(code_of(QueryErrorCode::kBadQuery) == wire::ErrorCode::kBadQuery);
static_assert(code_of(QueryErrorCode::kWrongScene) == wire::ErrorCode::kWrongScene);
static_assert(code_of(QueryErrorCode::kTooLarge) == wire::ErrorCode::kTooLarge);
static_assert(code_of(QueryErrorCode::kNotSupported) == wire::ErrorCode::kNotSupported);

}  // namespace clearance
