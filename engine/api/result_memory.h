// Memory for the columns of a result.
#pragma once

#include <chrono>
#include <cstddef>
#include <memory>
#include <new>

#include "engine/query/job.h"
#include "wire/api/result.h"

namespace clearance {

/// Columns of one answer.
class ResultMemory {
 public:
  explicit ResultMemory(const QuerySize& size) { fit(size); }
  /// Adapts to another answer. Earlier results over this memory become invalid.
  void fit(const QuerySize& size) {
    if (block_ && size.rows == size_.rows && size.fields == size_.fields && size.joints == size_.joints) {
      size_ = size;
      return;
    }
    std::uint64_t bytes = 0;
    reply_view_over(nullptr, size.rows, size.fields, &bytes, size.joints);
    if (!block_ || bytes > capacity_) {
      block_.reset(new (std::align_val_t{kColumnAlignment}) std::byte[bytes ? bytes : 1]);
      capacity_ = bytes;
    }
    view_ = reply_view_over(block_.get(), size.rows, size.fields, nullptr, size.joints);
    size_ = size;
  }
  const ReplyView& view() const { return view_; }

  /// The result of a job that has written this memory.
  static Result result(std::shared_ptr<const ResultMemory> memory, const ReplyInfo& reply,
                       std::chrono::nanoseconds took) {
    ResultInfo info{.rows = reply.rows,
                    .total = reply.total,
                    .configurations = memory->size_.configurations,
                    .pairs = memory->size_.pairs,
                    .fields = memory->size_.fields,
                    .joints = memory->size_.joints,
                    .scene_revision = reply.scene_revision,
                    .snapshot_revision = reply.snapshot_revision,
                    .snapshot_stamp_ns = reply.snapshot_stamp_ns,
                    .snapshot_sequence = reply.snapshot_sequence,
                    .pose_age_ns = reply.pose_age_ns,
                    .engine_ns = static_cast<std::uint64_t>(took.count()),
                    .backend = {}};
    reply.backend.copy(info.backend.data(), info.backend.size());
    const std::byte* const columns = memory->block_.get();
    const std::uint64_t rows = memory->size_.rows;
    return {info, columns, rows, std::move(memory)};
  }

 private:
  struct AlignedDelete {
    void operator()(std::byte* block) const { ::operator delete[](block, std::align_val_t{kColumnAlignment}); }
  };

  QuerySize size_{};
  std::uint64_t capacity_ = 0;
  std::unique_ptr<std::byte[], AlignedDelete> block_;
  ReplyView view_;
};

}  // namespace clearance
