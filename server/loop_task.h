// Queries under way, and requests that are refused: what the loop's own files share.
#pragma once

#include <spdlog/spdlog.h>

#include <new>
#include <string>
#include <utility>

#include "log_text.h"
#include "loop.h"
#include "wire/wire.h"

namespace clearance {

/// Where the columns of a reply begin in its frame.
inline constexpr std::uint64_t kColumnsBegin = sizeof(wire::FrameHeader) + sizeof(wire::ReplyHeader);
static_assert(kColumnsBegin % wire::kColumnAlignment == 0);

/// Why a request is not answered.
struct Loop::Refusal {
  wire::ErrorCode code;
  std::string text;
  std::uint64_t needed_bytes = 0;
};

/// A query under way.
struct Loop::Task {
  Task(std::unique_ptr<ReplySink> s, const wire::FrameHeader& r, std::shared_ptr<Engine> e, Job j)
      : sink(std::move(s)), request(r), engine(std::move(e)), job(std::move(j)) {}

  std::unique_ptr<ReplySink> sink;
  wire::FrameHeader request;
  std::shared_ptr<Engine> engine;  // the job's, though the loop may have another one by now
  Job job;
  std::byte* frame = nullptr;    // the sink's room, or `own`
  AlignedBytes own;              // where the sink has no room for the most that may come back
  std::vector<std::byte> records;     // of the reply, behind its columns
  std::uint64_t held_bytes = 0;       // the frame, and what the request itself takes
  std::uint64_t max_reply_bytes = 0;  // 0: no limit
  Reduce reduce = Reduce::kNone;
  Format format = Format::kFull;
  bool begun = false;  ///< has had its first slice
  Clock::time_point received, due;
  std::chrono::nanoseconds in_engine{0};
};

/// A query that waits for poses.
struct Loop::Held {
  std::unique_ptr<ReplySink> sink;
  wire::FrameHeader request;
  std::vector<std::uint64_t> payload;  // aligned; the frame's own ends with its client's call
  std::uint64_t payload_bytes;
  QueryOptions query;
  Clock::time_point received, deadline;
};

/// Throws a Refusal if the query wants no reply of so many bytes. \param most 0: it takes any.
inline void Loop::check_reply_size(std::uint64_t rows, std::uint64_t bytes, std::uint64_t most) {
  if (most && bytes > most)
    throw Refusal{wire::ErrorCode::kTooLarge, "the reply of " + std::to_string(rows) + " rows needs " +
                                                  std::to_string(bytes) + " bytes, more than the max_reply_bytes = " +
                                                  std::to_string(most) + " of this query"};
}

inline wire::ErrorCode code_of(QueryErrorCode code) {
  return static_cast<wire::ErrorCode>(code);
}
static_assert(static_cast<int>(QueryErrorCode::kBadQuery) == static_cast<int>(wire::ErrorCode::kBadQuery) &&
              static_cast<int>(QueryErrorCode::kWrongScene) == static_cast<int>(wire::ErrorCode::kWrongScene) &&
              static_cast<int>(QueryErrorCode::kTooLarge) == static_cast<int>(wire::ErrorCode::kTooLarge) &&
              static_cast<int>(QueryErrorCode::kNotSupported) == static_cast<int>(wire::ErrorCode::kNotSupported));

template <class Work>
void Loop::guarded(ReplySink& sink, const wire::FrameHeader& request, Work work) {
  try {
    work();
    return;
  } catch (const Refusal& refusal) {
    refuse(sink, request, refusal);
  } catch (const wire::WireError& error) {
    refuse(sink, request, {error.code, error.what()});
  } catch (const QueryError& error) {
    refuse(sink, request, {code_of(error.code), error.what()});
  } catch (const std::bad_alloc&) {
    refuse(sink, request, {wire::ErrorCode::kTooLarge, "the daemon has no memory for this request"});
  } catch (const std::exception& error) {
    spdlog::error("event=internal_error request={} error=\"{}\"", wire::type_name(request.type),
                  log_text(error.what()));
    refuse(sink, request, {wire::ErrorCode::kInternal, std::string("internal error of the daemon: ") + error.what()});
  }
}

}  // namespace clearance
