// Dense queries on a device: a row per configuration and pair.
#include <algorithm>

#include "engine/device/query/device_query.h"
#include "engine/device/query/reply_columns.h"

namespace clearance::cuda {

namespace {

// A row per configuration and pair.
class DenseDeviceQuery final : public DeviceQuery {
 public:
  DenseDeviceQuery(const JobContext& context, Plan&& plan, const ReplyView& reply)
      : DeviceQuery(context, std::move(plan), reply) {}

  void begin() override {
    chunk_plan_ = backend_.chunk_plan(plan_);
    workspace_ = backend_.device().borrow();
    const std::uint64_t rounds =
        (plan_.size.configurations + chunk_plan_->configurations - 1) / chunk_plan_->configurations;
    chunks_ = rounds * chunk_plan_->parts.size();
    if (chunks_ == 0) return;
    QuerySetup s = setup(*workspace_);
    s.pairs = chunk_plan_->resident.get();
    s.chunks = chunks_;
    begin_chunks(*workspace_, s);
  }

 private:
  struct Chunk {
    const ChunkPlan::Part* part;
    std::uint64_t first_configuration;
    std::uint32_t configurations;
    std::uint64_t first_row;
  };
  Chunk chunk(std::uint64_t index) const {
    const std::uint64_t first = index / chunk_plan_->parts.size() * chunk_plan_->configurations;
    const ChunkPlan::Part& part = chunk_plan_->parts[index % chunk_plan_->parts.size()];
    const auto configurations = static_cast<std::uint32_t>(
        std::min<std::uint64_t>(chunk_plan_->configurations, plan_.size.configurations - first));
    return {&part, first, configurations, first * plan_.size.pairs + part.first};
  }

  void end() override { info.rows = info.total = plan_.size.rows; }

  void launch(std::uint64_t index) override {
    const Chunk c = chunk(index);
    const int slot = static_cast<int>(index % slots_);
    ChunkSetup s = chunk_of(*c.part, c.configurations == chunk_plan_->configurations ? c.part->whole : c.part->last);
    s.configurations = c.configurations;
    s.first_configuration = c.first_configuration;
    give_configurations(*workspace_, slot, s);
    s.first_row = c.first_row;
    workspace_->launch(slot, s, rows_from(c.first_row, direct_));
  }

  void finish(std::uint64_t index) override {
    const Chunk c = chunk(index);
    const ChunkResult r = workspace_->finish(static_cast<int>(index % slots_));
    const std::uint64_t rows = std::uint64_t{c.configurations} * c.part->count;
    const auto copy = [&](auto* from, auto* to, auto* direct, std::size_t width) {
      if (!from || direct) return;
      add_column(from, to + c.first_row * width, rows * width * sizeof(*from));
    };
    for_each_column(copy, r.rows, reply_, direct_);
    copy_all();
    cpu_rows_.assign(r.rest.begin(), r.rest.end());
    evaluated_ += r.converged;
    backend_.converged.fetch_add(r.converged, std::memory_order_relaxed);
    if (launched_ < chunks_) launch(launched_++);  // keeps the device busy while the CPU finishes this chunk
    for (std::uint32_t k = 0; k < c.configurations; ++k)
      for (const std::uint32_t p : c.part->on_cpu) cpu_rows_.push_back(k * c.part->count + p);
    std::sort(cpu_rows_.begin(), cpu_rows_.end());
    WorkMeter unused;  // for second order, which the device has not
    answer_on_cpu(
        cpu_rows_.size(),
        [&](std::size_t i) {
          return OpenRow{c.first_configuration + cpu_rows_[i] / c.part->count,
                         c.part->first + cpu_rows_[i] % c.part->count};
        },
        [&](std::size_t i, const PlacedBodies& bodies, const PairAnswer& answer) {
          const auto k = static_cast<std::uint32_t>(c.first_configuration + cpu_rows_[i] / c.part->count);
          write(std::uint64_t{k} * plan_.size.pairs + c.part->first + cpu_rows_[i] % c.part->count, k, bodies, answer,
                unused);
        });
  }

  std::shared_ptr<const ChunkPlan> chunk_plan_;
  std::vector<std::uint32_t> cpu_rows_;
  std::shared_ptr<Workspace> workspace_;  // last member: destroyed first, which waits for the device
};

}  // namespace

std::unique_ptr<DeviceQuery> make_dense_device_query(const JobContext& context, Plan&& plan, const ReplyView& reply) {
  return std::make_unique<DenseDeviceQuery>(context, std::move(plan), reply);
}

}  // namespace clearance::cuda
