// Sends and counts replies and errors. Every frame from the loop is written here.
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
  /// The arguments must outlive this.
  /// @param engine that serves, which a new scene replaces
  /// @param require_epoch reject requests that deal with poses and name no epoch
  ReplyWriter(Stats& stats, const std::shared_ptr<engine::Engine>& engine, bool require_epoch);

  /// Number of this run of the daemon (wire::CommonRecord::kEpoch).
  std::uint64_t epoch() const { return epoch_; }
  /// Throws RejectedRequest (kNewEpoch) unless a request is for this run of the daemon. Poses, attachments and bodies
  /// sent to another run are missing here, so an answer would be wrong for the client. From any thread.
  /// @param named epoch in its records, or 0
  void check_epoch(const wire::FrameHeader& request, std::uint64_t named) const;
  /// Records at the end of a query's reply. From any thread.
  /// @param passed_over tags of the request's unknown records
  /// @param joints number of joints for the column gradient_joints, else 0
  std::vector<std::byte> records(const wire::PassedOver& passed_over, std::size_t joints) const;

  /// Throws RejectedRequest (kTooLarge) if it does not fit.
  void reply(ReplySink& sink, const wire::FrameHeader& request, wire::FrameType type,
             std::span<const std::byte> payload);
  /// The same in steps: memory for the frame, in which the caller writes the payload behind the header, and its
  /// publication.
  std::byte* reserve(ReplySink& sink, std::uint64_t payload_bytes);
  void publish(ReplySink& sink, const wire::FrameHeader& request, wire::FrameType type, std::byte* frame,
               std::uint64_t payload_bytes);
  /// Counts a request whose client is gone.
  void count_dropped() { ++stats_.dropped; }
  /// Counts unknown records of requests.
  void count_ignored(std::uint64_t records) { stats_.records_ignored += records; }
  /// Counts a published reply of a query.
  void count_query(std::uint64_t server_ns, std::uint64_t rows);
  void reject(ReplySink& sink, const wire::FrameHeader& request, const RejectedRequest& rejection);
  /// Runs `work`. Answers an exception with kError and returns false.
  template <class Work>
  bool guard(ReplySink& sink, const wire::FrameHeader& request, Work work) {
    const std::optional<RejectedRequest> rejection = rejection_of(request, work);
    if (rejection) reject(sink, request, *rejection);
    return !rejection;
  }
  /// Runs `work`. Returns its exception as the client's error. From any thread.
  template <class Work>
  static std::optional<RejectedRequest> rejection_of(const wire::FrameHeader& request, Work work) {
    try {
      work();
      return std::nullopt;
    } catch (...) {
      return rejection_of_caught(request);
    }
  }

 private:
  /// Converts the current exception into the client's error. Not in guard(), which every user compiles: formatting one
  /// log line takes the compiler five seconds.
  static RejectedRequest rejection_of_caught(const wire::FrameHeader& request);

  Stats& stats_;
  const std::shared_ptr<engine::Engine>& engine_;
  const std::uint64_t epoch_;
  const bool require_epoch_;
  std::vector<std::byte> epoch_record_;  // at the end of every reply
};

constexpr wire::ErrorCode code_of(QueryErrorCode code) {
  return static_cast<wire::ErrorCode>(code);
}
static_assert(code_of(QueryErrorCode::kBadQuery) == wire::ErrorCode::kBadQuery);
static_assert(code_of(QueryErrorCode::kWrongScene) == wire::ErrorCode::kWrongScene);
static_assert(code_of(QueryErrorCode::kTooLarge) == wire::ErrorCode::kTooLarge);
static_assert(code_of(QueryErrorCode::kNotSupported) == wire::ErrorCode::kNotSupported);

}  // namespace clearance
