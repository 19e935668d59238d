// The reply to a query: its memory, its columns and its header.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/engine.h"
#include "server/requests/transport.h"
#include "wire/aligned_buffer.h"
#include "wire/wire.h"

namespace clearance {

class QueryReply {
 public:
  /// Timing for the reply's header.
  struct Times {
    std::chrono::nanoseconds in_engine, in_server;
  };

  /// @param records at the reply's end, behind its columns
  void begin(const QueryView& query, std::vector<std::byte> records);
  void set_size(const QuerySize& size) { size_ = size; }
  const QuerySize& size() const { return size_; }
  Reduce reduce() const { return reduce_; }
  /// Bytes of a frame with all rows that the query may return.
  std::uint64_t most_bytes() const { return end_of_columns(size_.rows) + records_.size(); }

  /// Reserves a frame for all rows: the sink's memory or, for reduce=within, own memory if the sink has not so much.
  /// Throws RejectedRequest (kTooLarge).
  void reserve(ReplySink& sink);
  bool is_reserved() const { return frame_ != nullptr; }
  /// Columns that the engine writes to.
  ReplyView view() const;
  /// Moves the columns to where they lie with the rows that came back.
  void close_up(ReplyInfo info);
  std::uint64_t rows() const { return info_.rows; }

  // Only for a reply in own memory: the sink's memory for the rows that came back, and a copy into it.
  bool is_in_own_memory() const { return own_ != nullptr; }
  void reserve_final(ReplySink& sink);
  void copy();
  void free_own_memory() { own_.reset(); }

  /// Writes the records and the headers, and sends the frame.
  void publish(ReplySink& sink, const wire::FrameHeader& request, const Times& times);

 private:
  std::uint64_t end_of_columns(std::uint64_t rows) const;
  std::byte* columns() const;
  wire::ReplyHeader header(const Times& times) const;

  Reduce reduce_ = Reduce::kNone;
  std::vector<std::byte> records_;
  QuerySize size_;
  ReplyInfo info_;
  std::byte* frame_ = nullptr;  // the sink's, or own_
  AlignedBytes own_;
};

}  // namespace clearance
