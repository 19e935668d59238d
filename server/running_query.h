// A query under way: the engine's job, and the reply that it becomes.
#pragma once

#include "answers.h"
#include "pending_request.h"
#include "scheduler.h"
#include "wire/aligned_buffer.h"

namespace clearance {

/// Where the columns of a reply begin in its frame.
inline constexpr std::uint64_t kColumnsBegin = sizeof(wire::FrameHeader) + sizeof(wire::ReplyHeader);
static_assert(kColumnsBegin % wire::kColumnAlignment == 0);

/// Where a query's reply is written: room for the most rows that may come back.
struct ReplyRoom {
  std::byte* frame = nullptr;  ///< the sink's, or `own`
  AlignedBytes own;            ///< where the sink has no room for so many, and far fewer may come back
};
/// Throws a Refusal (kTooLarge). \param records_bytes of the reply's records, behind its columns
ReplyRoom reserve_room(ReplySink& sink, const QuerySize& size, Reduce reduce, std::uint64_t records_bytes);
/// Throws a Refusal (kTooLarge) if the query wants no reply of so many bytes. \param most 0: it takes any.
void check_reply_size(std::uint64_t rows, std::uint64_t bytes, std::uint64_t most);

class RunningQuery final : public ScheduledQuery {
 public:
  /// What of a query the reply repeats, and when it came.
  struct Traits {
    Reduce reduce;
    Format format;
    Clock::time_point received, due;
    std::chrono::nanoseconds in_engine;  ///< until the job was there
    std::vector<std::byte> records;      ///< of the reply, behind its columns
    std::uint64_t max_reply_bytes = 0;   ///< 0: no limit
  };

  /// \param engine the job's, though another one may serve by the time that it ends.
  RunningQuery(Answers& answers, std::unique_ptr<ReplySink>&& sink, const wire::FrameHeader& request,
               Quotas::Share share, std::shared_ptr<Engine> engine, Job job, ReplyRoom room, Traits traits);

  bool is_wanted() const override { return asked_.sink->alive(); }
  bool advance(std::chrono::nanoseconds budget, Clock::time_point& now) override;

 private:
  void publish(Clock::time_point now);
  wire::ReplyHeader reply_header(Clock::time_point now) const;
  std::byte* final_frame(std::uint64_t columns_end, std::uint64_t bytes);

  Answers& answers_;
  PendingRequest asked_;
  std::shared_ptr<Engine> engine_;
  Job job_;
  ReplyRoom room_;
  Traits traits_;
};

}  // namespace clearance
