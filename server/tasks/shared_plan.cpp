#include "server/tasks/shared_plan.h"

#include <algorithm>
#include <cstring>
#include <string>
#include <thread>
#include <utility>

#include "engine/device/device_error.h"
#include "server/base/rejected_request.h"

namespace clearance {
namespace {

/// Chunks in the stream at a time. Few, so that other queries on the device get their turn, and no launch waits for the
/// driver's queue.
constexpr int kChunksAhead = 4;
/// Time after which other runs get their turn.
constexpr auto kLook = std::chrono::microseconds(20);
/// Duration from which a run is polled between naps.
constexpr auto kSoonOver = std::chrono::milliseconds(1);
constexpr auto kNap = std::chrono::microseconds(50);

/// Runs `work`, which uses the device, and converts its errors.
template <class Work>
auto on_device(Work work) {
  try {
    return work();
  } catch (const cuda::DeviceError& error) {
    const bool is_out_of_memory = error.kind == cuda::DeviceError::kNoMemory;
    throw RejectedRequest{is_out_of_memory ? wire::ErrorCode::kTooLarge : wire::ErrorCode::kNotSupported,
                          std::string("a plan on a device: ") + error.what()};
  }
}

}  // namespace

SharedPlan::SharedPlan(std::shared_ptr<const engine::Engine> engine, const QueryView& query, const QueryLimits& limits,
                       PlanShare share)
    : engine_(std::move(engine)), share_(std::move(share)), layout_(query) {
  limits.check(engine_->cost(query));
  share_.bytes.grow(layout_.columns_offset);  // before memory is taken
  plan_ = engine_->plan_on_device(query);
  const QuerySize& size = plan_->size();
  limits.check(size);
  layout_.add_columns(size);
  const std::uint64_t bytes = layout_.bytes;
  constexpr std::uint64_t kConvexPart = cuda::SharedMemory::kConvexPart;
  share_.bytes.grow((bytes + kConvexPart - 1) / kConvexPart * kConvexPart - layout_.columns_offset + plan_->bytes());
  memory_ = on_device([&] { return std::make_unique<cuda::SharedMemory>(plan_->device(), bytes); });
  next_ = size.configurations;
}

std::vector<std::byte> SharedPlan::description(std::uint64_t number) const {
  const QuerySize& size = plan_->size();
  wire::PlanHeader header;
  header.plan = number;
  header.memory_bytes = memory_->size();
  const cuda::MemoryHandle& handle = memory_->handle();
  static_assert(sizeof header.memory_handle == sizeof handle.ipc && sizeof header.device_uuid == sizeof handle.uuid);
  std::memcpy(header.memory_handle, handle.ipc.data(), sizeof header.memory_handle);
  std::memcpy(header.device_uuid, handle.uuid.data(), sizeof header.device_uuid);
  header.positions_offset = layout_.joints ? layout_.positions_offset : 0;
  header.rows = size.rows;
  header.configurations = size.configurations;
  header.pairs = size.pairs;
  header.body_count = layout_.bodies;
  header.joint_count = layout_.joints;
  header.fields = size.fields;
  header.scene_revision = plan_->scene_revision();
  header.snapshot_revision = plan_->snapshot_revision();
  std::vector<wire::PlanColumnRecord> columns;
  layout_.for_each_column([&](std::uint32_t field, std::uint32_t row_bytes, std::uint64_t offset) {
    columns.push_back({field, row_bytes, offset});
  });
  header.column_count = static_cast<std::uint32_t>(columns.size());
  std::vector<std::byte> payload;
  wire::append(payload, header);
  wire::append_bytes(payload, columns.data(), columns.size() * sizeof columns[0]);
  return payload;
}

void SharedPlan::begin_run() {
  begun_ = Clock::now();
  next_ = 0;
  launch_some();
}

void SharedPlan::launch_some() {
  const GivenOnDevice given = layout_.given(memory_->data());
  const ReplyView rows = layout_.rows(memory_->data());
  for (int i = 0; i < kChunksAhead && next_ < layout_.size.configurations; ++i)
    next_ = plan_->run_from(next_, given, rows, memory_->stream());
}

bool SharedPlan::advance(std::chrono::nanoseconds budget) {
  const auto begin = Clock::now(), end = begin + std::min<std::chrono::nanoseconds>(budget, kLook);
  auto now = begin;
  for (; now < end || now == begin; now = Clock::now()) {
    if (!on_device([&] { return memory_->is_done(); })) continue;
    if (next_ == plan_->size().configurations) {
      took_ = Clock::now() - begun_;
      return true;
    }
    launch_some();
  }
  if (now - begun_ > kSoonOver) std::this_thread::sleep_for(kNap);
  return false;
}

}  // namespace clearance
