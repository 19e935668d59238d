#include "engine/device/query/device_query.h"

#include <algorithm>
#include <atomic>
#include <cstring>

#include "engine/cost/helping_threads.h"
#include "engine/device/query/reply_columns.h"

namespace clearance::cuda {

namespace {

constexpr std::size_t kBodiesAtOnce = 512;     // that a helper places
constexpr std::size_t kMostPinned = 1u << 28;  // bytes; larger inputs are copied to pinned memory chunk by chunk

}  // namespace

DeviceQuery::DeviceQuery(const JobContext& context, Plan&& plan, const ReplyView& reply)
    : ParallelJob(context, std::move(plan), reply, plan.query.reduce == Reduce::kNone),
      backend_(*context.device),
      scratch_(static_cast<std::size_t>(workers())) {
  info.backend = "cuda";
  for (int i = 0; i < workers(); ++i) evaluators_.emplace_back(scene(), options_);
  find_direct_columns();
}

Plan DeviceQuery::give_up() {
  plan_.keep_configurations();  // they may lie in the workspace
  return std::move(plan_);
}

void DeviceQuery::find_direct_columns() {
  int bit = 0;
  direct_ = reply_;
  const auto column = [&](auto*& direct, int) {
    if (direct) fields_ |= 1u << bit;
    ++bit;
    if (!is_pinned(direct)) direct = nullptr;
  };
  for_each_column(column, direct_);
}

QuerySetup DeviceQuery::setup(QueryWorkspace& workspace) {
  QuerySetup s;
  const bool has_uncertainty = uncertain_body(scene(), plan_) != kNone;
  s.pair_limits = {options_.limits.max_distance,
                   options_.limits.abs_tol,
                   options_.limits.rel_tol,
                   options_.limits.max_iterations,
                   options_.cull,
                   options_.want_points,
                   options_.want_flags,
                   !options_.limits.signed_distance,
                   options_.limits.signed_distance && plan_.query.reduce == Reduce::kNone && !has_uncertainty,
                   options_.f32};
  s.fields = fields_;
  s.boxes = options_.cull;
  place_fixed(workspace.body_buffers(plan_.snapshot->placed.size()));
  if (plan_.query.configuration_count > 0) {
    if (std::max(plan_.configurations.size_bytes(), plan_.positions.size_bytes()) <= kMostPinned) {
      take_in(workspace, Given::kPoses, plan_.configurations);
      take_in(workspace, Given::kPositions, plan_.positions);
    } else {
      plan_.keep_configurations();
    }
    s.moved = moved_.emplace(scene(), plan_).setup();
  }
  if (has_uncertainty) s.uncertainty = uncertainties_.emplace(scene(), plan_).setup();
  if (options_.joint_gradient) s.movers = movers_.emplace(*options_.joint_gradient, plan_).setup();
  return s;
}

template <class T>
void DeviceQuery::take_in(QueryWorkspace& workspace, Given given, std::span<const T> all) {
  if (all.empty()) return;
  Incoming& in = incoming_[static_cast<std::size_t>(given)];
  in.pinned = workspace.query_input_buffer(given, all.size_bytes());
  in.copy.emplace(all.data(), in.pinned, all.size_bytes(), CopyReader::kDevice);
}

// The snapshot's bodies as component arrays.
void DeviceQuery::place_fixed(const FixedBodies& fixed) {
  const std::vector<BodyPlacement>& placed = plan_.snapshot->placed;
  const std::size_t n = placed.size();
  const auto place = [&](std::size_t b) {
    const BodyPlacement& at = placed[b];
    fixed.state[b] =
        static_cast<std::uint8_t>(static_cast<std::uint8_t>(at.status) | (at.renormalised ? kStateRenormalised : 0) |
                                  (at.beyond_limits ? kStateBeyondLimits : 0));
    if (at.status != Status::kOk) return;
    const auto put = [&](std::size_t c, const Vec3d& v) {
      for (int i = 0; i < 3; ++i) fixed.components[(c + static_cast<std::size_t>(i)) * n + b] = v[i];
    };
    for (std::size_t r = 0; r < 3; ++r) put(3 * r, at.pose.R_wb.row[r]);
    put(9, at.pose.t_w);
  };
  std::atomic<std::size_t> next{0};
  const auto place_next = [&] {
    for (std::size_t first; (first = next.fetch_add(kBodiesAtOnce, std::memory_order_relaxed)) < n;)
      for (std::size_t b = first; b < std::min(first + kBodiesAtOnce, n); ++b) place(b);
  };
  const HelpingThreads help(helpers_for(n * sizeof(BodyPlacement)), place_next);
  place_next();
}

int DeviceQuery::helpers_for(std::size_t bytes) const {
  return OrderedCopy::helpers_for(bytes, workers() - 1);
}

void DeviceQuery::begin_chunks(QueryWorkspace& workspace, const QuerySetup& setup) {
  std::size_t bytes = 0;
  for (const Incoming& in : incoming_) bytes += in.copy ? in.copy->bytes() : 0;
  const auto copy = [&] {
    for (Incoming& in : incoming_)
      while (in.copy && in.copy->copy_block()) {
      }
  };
  {
    const HelpingThreads help(helpers_for(bytes), copy);
    workspace.begin(setup);
    slots_ = static_cast<std::uint64_t>(workspace.slots());
    launch_ahead();
    copy();
  }
  const auto move_to = [&]<class T>(std::span<const T>& view, Given given) {
    const std::byte* const pinned = incoming_[static_cast<std::size_t>(given)].pinned;
    if (pinned) view = {reinterpret_cast<const T*>(pinned), view.size()};
  };
  move_to(plan_.configurations, Given::kPoses);
  move_to(plan_.positions, Given::kPositions);
}

void DeviceQuery::launch_ahead() {
  while (launched_ < chunks_ && launched_ < finished_ + slots_) launch(launched_++);
}

bool DeviceQuery::go_on(WorkMeter& slice) {
  while (finished_ < chunks_) {
    launch_ahead();
    finish(finished_++);
    slice.count(kUnitsPerChunk);
    if (finished_ < chunks_ && slice.is_over()) return false;
  }
  end();
  info.pairs_evaluated = evaluated_;
  context_.pairs_evaluated->fetch_add(info.pairs_evaluated, std::memory_order_relaxed);
  backend_.queries.fetch_add(1, std::memory_order_relaxed);
  return true;
}

void DeviceQuery::give_configurations(QueryWorkspace& workspace, int slot, ChunkSetup& chunk) {
  if (plan_.query.configuration_count == 0) return;
  const std::uint64_t first = chunk.first_configuration, count = chunk.configurations;
  chunk.poses = give(workspace, slot, Given::kPoses, plan_.configurations, first, count);
  chunk.positions = give(workspace, slot, Given::kPositions, plan_.positions, first, count);
  chunk.wait_for = [this](Given given, const void* end) {
    Incoming& in = incoming_[static_cast<std::size_t>(given)];
    if (in.copy) in.copy->wait_for(static_cast<std::size_t>(static_cast<const std::byte*>(end) - in.pinned));
  };
}

template <class T>
const T* DeviceQuery::give(QueryWorkspace& workspace, int slot, Given given, std::span<const T> all,
                           std::uint64_t first, std::uint64_t count) {
  const std::uint64_t each = all.size() / plan_.size.configurations;
  if (each == 0) return nullptr;
  if (const std::byte* const pinned = incoming_[static_cast<std::size_t>(given)].pinned)
    return reinterpret_cast<const T*>(pinned) + first * each;
  std::byte* const pinned = workspace.chunk_input_buffer(given, slot, count * each * sizeof(T));
  copies_.emplace_back(all.data() + first * each, pinned, count * each * sizeof(T), CopyReader::kDevice);
  copy_all();
  return reinterpret_cast<const T*>(pinned);
}

void DeviceQuery::add_column(const void* from, void* to, std::size_t bytes) {
  copies_.emplace_back(from, to, bytes, CopyReader::kHost);
  backend_.reply_bytes_copied.fetch_add(bytes, std::memory_order_relaxed);
}

void DeviceQuery::copy_all() {
  std::size_t bytes = 0;
  for (const OrderedCopy& copy : copies_) bytes += copy.bytes();
  const auto work = [&] {
    for (OrderedCopy& copy : copies_)
      while (copy.copy_block()) {
      }
  };
  {
    const HelpingThreads help(helpers_for(bytes), work);
    work();
  }
  copies_.clear();
}

}  // namespace clearance::cuda
