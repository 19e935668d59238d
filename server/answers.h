// How a request ends: with a reply or an error, each of them counted. Every frame that the loop sends goes this way.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "refusal.h"
#include "stats.h"
#include "transport.h"
#include "wire/wire.h"

namespace clearance {

class Answers {
 public:
  /// Both must outlive this. \param engine the one that serves, which a new scene replaces.
  Answers(Stats& stats, const std::shared_ptr<Engine>& engine);

  /// Which run of the daemon answers (wire::CommonRecord::kEpoch).
  std::uint64_t epoch() const { return epoch_; }
  /// What a reply to `request` ends in. \param passed_over tags of the request's records that nobody here knows
  std::vector<std::byte> records(const wire::FrameHeader& request, const wire::PassedOver& passed_over = {}) const;

  /// Throws a Refusal (kTooLarge) if it does not fit.
  void reply(ReplySink& sink, const wire::FrameHeader& request, wire::FrameType type,
             std::span<const std::byte> payload);
  /// Counts the reply of a query, which was published.
  void count_query(std::uint64_t server_ns, std::uint64_t rows);
  void refuse(ReplySink& sink, const wire::FrameHeader& request, const Refusal& refusal);
  /// Runs `work`. Whatever it throws is answered with kError; then this returns false.
  template <class Work>
  bool guard(ReplySink& sink, const wire::FrameHeader& request, Work work) {
    try {
      work();
      return true;
    } catch (...) {
      refuse(sink, request, refusal_of_caught(request));
      return false;
    }
  }

 private:
  /// The exception that is being handled, in words for whoever asked. Not in guard(), which every user compiles: to
  /// format one line of the log takes the compiler five seconds.
  static Refusal refusal_of_caught(const wire::FrameHeader& request);

  Stats& stats_;
  const std::shared_ptr<Engine>& engine_;
  std::uint64_t epoch_;
};

constexpr wire::ErrorCode code_of(QueryErrorCode code) {
  return static_cast<wire::ErrorCode>(code);
}
static_assert(code_of(QueryErrorCode::kBadQuery) == wire::ErrorCode::kBadQuery);
static_assert(code_of(QueryErrorCode::kWrongScene) == wire::ErrorCode::kWrongScene);
static_assert(code_of(QueryErrorCode::kTooLarge) == wire::ErrorCode::kTooLarge);
static_assert(code_of(QueryErrorCode::kNotSupported) == wire::ErrorCode::kNotSupported);

}  // namespace clearance
