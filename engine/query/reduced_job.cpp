#include <algorithm>
#include <optional>
#include <utility>

#include "engine/query/parallel_job.h"
#include "engine/reduce/box_cull.h"
#include "engine/reduce/configuration_block.h"
#include "engine/reduce/reduction.h"

namespace clearance {

namespace {

// Pairs up to which a configuration is reduced by one thread.
constexpr std::uint64_t kWholeConfigurations = 16384;

// Writes the rows of a reduction. With few pairs, each thread reduces a block of configurations; with many, all threads
// share the stages of one configuration.
class ReducedJob final : public ParallelJob {
 public:
  ReducedJob(const JobContext& context, Plan&& plan, const ReplyView& reply)
      : ParallelJob(context, std::move(plan), reply),
        whole_(plan_.size.pairs <= kWholeConfigurations),
        near_pairs_(scene(), plan_, boxes(), *context.trees, options_.cull ? context.near_by : NearBy::kBrute) {
    columns_.assign(boxes());
    const Reduction::Boxes all{boxes(), columns_, near_pairs_};
    if (whole_) {
      block_ = ConfigurationBlock::most(scene(), plan_, near_pairs_.by_tree(), !boxes().empty(), workers());
      for (int i = 0; i < workers(); ++i) blocks_.emplace_back(scene(), plan_, options_, all, block_);
    } else {
      reduction_.emplace(scene(), plan_, options_, all, workers());
    }
  }

  bool go_on(WorkMeter& slice) override {
    const bool done = whole_ ? advance_side_by_side(slice) : advance_one_by_one(slice);
    if (done) {
      info.rows = written_;
      context_.pairs_evaluated->fetch_add(info.pairs_evaluated, std::memory_order_relaxed);
    }
    return done;
  }

  void rewind() override {
    first_ = next_ = written_ = 0;
    evaluated_ = 0;
  }

 private:
  bool advance_side_by_side(WorkMeter& slice) {
    // One batch of blocks at a time, so that ordered rows need bounded memory.
    const std::uint64_t count = plan_.size.configurations;
    const std::uint64_t most = std::max<std::uint64_t>(block_, 64) / block_ * block_ * blocks_.size();
    while (true) {
      if (batch_rows_.empty()) batch_rows_.resize(std::min<std::uint64_t>(count - first_, most));
      if (!is_listed_) {
        const bool batch_done =
            run_units(next_, (batch_rows_.size() + block_ - 1) / block_, slice,
                      [&](std::uint64_t i, int worker, WorkMeter& meter) { return reduce(i, worker, meter); });
        if (!batch_done) return false;
        next_ = 0;
        for (const auto& rows : batch_rows_) list(rows);
      }
      if (!write_listed(slice)) return false;
      first_ += batch_rows_.size();
      batch_rows_.clear();
      info.pairs_evaluated = evaluated_;
      if (first_ == count) return true;
      if (slice.is_over()) return false;
    }
  }

  // The rows of one block of the batch.
  bool reduce(std::uint64_t i, int worker, WorkMeter& meter) {
    ConfigurationBlock& block = blocks_[static_cast<std::size_t>(worker)];
    const std::uint64_t begin = i * block_, count = std::min<std::uint64_t>(block_, batch_rows_.size() - begin);
    if (!block.has_begun()) block.begin(placements(worker, first_ + begin, count), first_ + begin);
    if (!block.advance(meter)) return false;
    evaluated_.fetch_add(block.end(std::span(batch_rows_).subspan(begin, count)), std::memory_order_relaxed);
    return true;
  }

  bool advance_one_by_one(WorkMeter& slice) {
    Reduction& r = *reduction_;
    while (first_ < plan_.size.configurations) {
      if (!begun_) r.begin();
      begun_ = true;
      for (; r.stage() != Reduction::kDone; r.end_stage(), next_ = 0) {
        const bool stage_done = run_units(
            next_, r.units(), slice,
            [&](std::uint64_t unit, int worker, WorkMeter& meter) {
              return r.run(unit, worker, placement(worker, first_), meter);
            },
            !r.worth_threads(context_.light));
        if (!stage_done) return false;
      }
      if (!is_listed_) {
        r.take_rows(static_cast<std::uint32_t>(first_), placement(0, first_), rows_);
        list(rows_);
      }
      if (!write_listed(slice)) return false;
      info.pairs_evaluated += r.evaluated();
      begun_ = false;
      if (++first_ < plan_.size.configurations && slice.is_over()) return false;
    }
    return true;
  }

  // Counts rows, and lists those that fit into the reply. They must stay where they are until write_listed().
  void list(const std::vector<Row>& rows) {
    is_listed_ = true;
    info.total += rows.size();
    const std::uint64_t most = plan_.size.rows - written_ - listed_.size();
    for (std::size_t i = 0; i < rows.size() && i < most; ++i) listed_.push_back(&rows[i]);
  }

  // Writes the listed rows. Second derivatives are computed here, so that no row is kept with them. Returns false if
  // the slice ended before.
  bool write_listed(WorkMeter& slice) {
    const auto write = [&](std::uint64_t i, int worker, WorkMeter& meter) {
      const Row& row = *listed_[i];
      write_row(reply_, written_ + i, row);
      if (options_.second_order)
        write_second_order(reply_, written_ + i,
                           options_.second_order->row(placement(worker, row.configuration), row.pair, row.configuration,
                                                      row.answer, meter));
      return true;
    };
    if (options_.second_order) {
      if (!run_units(next_, listed_.size(), slice, write)) return false;
      next_ = 0;
    } else {
      for (std::size_t i = 0; i < listed_.size(); ++i) write(i, 0, slice);
    }
    written_ += listed_.size();
    listed_.clear();
    is_listed_ = false;
    return true;
  }

  bool whole_;
  NearPairs near_pairs_;
  BoxColumns columns_;
  std::uint64_t block_ = 1;                 // configurations of a block
  std::vector<ConfigurationBlock> blocks_;  // by worker, if whole_
  std::optional<Reduction> reduction_;      // if not whole_
  std::vector<std::vector<Row>> batch_rows_;
  std::vector<Row> rows_;
  std::vector<const Row*> listed_;  // rows to write
  std::uint64_t first_ = 0, next_ = 0, written_ = 0;
  std::atomic<std::uint64_t> evaluated_{0};
  bool begun_ = false, is_listed_ = false;
};

}  // namespace

std::unique_ptr<Job::State> make_reduced_job(const JobContext& context, Plan&& plan, const ReplyView& reply) {
  return std::make_unique<ReducedJob>(context, std::move(plan), reply);
}

}  // namespace clearance
