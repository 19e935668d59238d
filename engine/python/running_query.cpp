#include "engine/python/running_query.h"

#include <string_view>

#include "client/python/bindings/gil.h"
#include "engine/device/device.h"
#include "engine/python/editor_binding.h"

namespace clearance::python {
namespace {

static_assert(sizeof(BodyPair) == 2 * sizeof(std::uint32_t) && sizeof(Pose) == 7 * sizeof(double));

// A device writes directly into pinned memory; into other memory each answer is copied again. Falls back to ordinary
// memory if none is available, or so much is pinned that the machine might suffer.
std::shared_ptr<void> pinned_block(std::size_t bytes) {
  constexpr std::size_t kMostPinned = std::size_t{2} << 30;
  static std::atomic<std::size_t> pinned{0};
  struct PinnedBlock {
    explicit PinnedBlock(std::size_t n) : bytes(n), memory(n) { pinned += bytes; }
    ~PinnedBlock() { pinned -= bytes; }
    std::size_t bytes;
    cuda::PinnedMemory memory;
  };
  if (pinned + bytes > kMostPinned) return allocate_block(bytes);
  try {
    auto block = std::make_shared<PinnedBlock>(bytes);
    return {block, block->memory.data()};
  } catch (const cuda::DeviceError&) {
    return allocate_block(bytes);
  }
}
BlockPool& pinned_blocks() {
  static BlockPool& pool = *new BlockPool(pinned_block);
  return pool;
}

PreparedQuery prepare(const engine::Engine& engine, QueryView view, const RepeatedQuery& query) {
  const std::shared_ptr<JobPool> jobs = query.pool();
  if (!query.points_by_default) return engine.prepare(view, jobs);
  const std::uint32_t without = view.fields;
  view.fields |= kFieldPoints | kFieldNormal;
  PreparedQuery prepared = engine.prepare(view, jobs);
  if (prepared.size().rows <= kDefaultPointsRows) return prepared;
  view.fields = without;
  return engine.prepare(view);
}

std::shared_ptr<void> allocate(const engine::Engine& engine, std::size_t bytes) {
  const std::string_view backend = engine.backend();
  return (backend == "cuda" || backend == "auto" ? pinned_blocks() : plain_blocks()).take(bytes);
}

}  // namespace

bool PyJob::advance(std::int64_t budget_ns) {
  guard_.check("this query");
  const GilRelease release;
  return go_on(budget_ns);
}

bool PyJob::go_on(std::int64_t budget_ns, Clock::time_point begin) {
  const bool done = job_.advance(std::chrono::nanoseconds(budget_ns));
  ns_ += nanoseconds_since(begin);
  return done;
}

Answer PyJob::take() {
  const ReplyInfo& info = job_.info();
  answer_.rows = info.rows;
  answer_.total = info.total;
  answer_.scene_revision = info.scene_revision;
  answer_.snapshot_revision = info.snapshot_revision;
  answer_.snapshot_stamp_ns = info.snapshot_stamp_ns;
  answer_.snapshot_sequence = info.snapshot_sequence;
  answer_.pose_age_ns = info.pose_age_ns;
  answer_.backend = info.backend;
  answer_.engine_ns = static_cast<std::uint64_t>(ns_);
  return std::move(answer_);
}

QueryView view_of(const Query& q) {
  QueryView view;
  view.all_pairs = !q.pairs;
  if (q.pairs) view.pairs = {reinterpret_cast<const BodyPair*>(q.pairs->data()), q.pairs->shape(0)};
  view.bodies = ids_of(q.bodies);
  view.joints = ids_of(q.joints);
  view.scene_revision = q.scene_revision;
  copy_options(q, view);
  copy_margins(q, view);
  return view;
}

QueryView view_of(const Query& q, const Configurations& at) {
  at.check(q);
  if (at.count() > kMostConfigurations) throw nb::value_error("configurations: too many");
  QueryView view = view_of(q);
  view.configuration_count = static_cast<std::uint32_t>(at.count());
  if (at.poses)
    view.configurations = {reinterpret_cast<const Pose*>(at.poses->data()), at.poses->shape(0) * at.poses->shape(1)};
  view.positions = numbers_of(at.positions);
  return view;
}

PyJob begin_query(const std::shared_ptr<engine::Engine>& engine, ProcessGuard guard, const RepeatedQuery& query,
                  const QueryView& view) {
  check_query_ids(*engine, query.scene_revision, view);
  PreparedQuery prepared = prepare(*engine, view, query);
  const QuerySize size = prepared.size();
  const Layout layout = layout_of(size.fields, size.rows, size.joints);
  Answer answer;
  answer.owner = allocate(*engine, layout.bytes);
  answer.base = static_cast<const std::byte*>(answer.owner.get());
  answer.bytes = layout.bytes;
  answer.offset = layout.offset;
  answer.fields = size.fields;
  answer.configurations = size.configurations;
  answer.pairs = size.pairs;
  answer.joints = size.joints;
  answer.beyond_limits = beyond_limits(query, view.positions);
  const ReplyView reply =
      reply_view_over(static_cast<std::byte*>(answer.owner.get()), size.rows, size.fields, nullptr, size.joints);
  Job job = engine->start(std::move(prepared), reply);
  return {engine, guard, std::move(job), std::move(answer)};
}

}  // namespace clearance::python
