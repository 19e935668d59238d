// Queries with kFieldFreeScale: distances of all pairs for some configurations at a time, and the resulting scales.
#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

#include "engine/motion/free_scale.h"

namespace clearance {

namespace {

constexpr std::uint64_t kRowsAtOnce = std::uint64_t{1} << 18;    // rows of distances that are buffered
constexpr std::uint64_t kPairsAtATime = 256, kPairsPerUnit = 8;  // units of work

/// The same pairs in configurations [first, first + count): lower bounds of all distances.
Plan distances_of(const Plan& plan, std::uint64_t first, std::uint64_t count) {
  Plan part;
  part.query = plan.query;
  part.query.reduce = Reduce::kNone;
  part.query.fields = kFieldLower;
  part.query.weights = {};
  part.query.margin = 0;
  part.query.configuration_count = static_cast<std::uint32_t>(count);
  part.bodies = plan.bodies;
  part.joints = plan.joints;
  part.query.bodies = part.bodies;
  part.query.joints = part.joints;
  part.positions = plan.positions.subspan(first * plan.joints.size(), count * plan.joints.size());
  part.motions = plan.motions;
  part.moved = plan.moved;
  part.snapshot = plan.snapshot;
  part.pairs = plan.pairs;
  part.size = {count, plan.size.pairs, count * plan.size.pairs, kFieldLower, plan.size.joints};
  return part;
}

class FreeScaleJob final : public Job::State {
 public:
  FreeScaleJob(const JobContext& context, Plan&& plan, const ReplyView& reply)
      : context_(context), plan_(std::move(plan)), reply_(reply), scale_(*context.scene, plan_) {}

  const QuerySize& size() const override { return plan_.size; }

  bool advance(const WorkBudget& budget) override {
    WorkMeter slice(budget);
    is_whole = go_on(slice);
    units += slice.spent();
    return is_whole;
  }

 private:
  bool go_on(WorkMeter& slice) {
    if (!scale_.advance(slice)) return false;
    while (first_ < plan_.size.configurations) {
      if (!part_) begin_part();
      if (!part_is_answered_) {
        const std::uint64_t before = part_->units;
        part_is_answered_ = part_->advance(slice.left());
        slice.count(part_->units - before);
        if (!part_is_answered_) return false;
      }
      if (!write(slice)) return false;
      end_part();
    }
    return true;
  }

  void begin_part() {
    const std::uint64_t pairs = plan_.size.pairs,
                        most = std::max<std::uint64_t>(kRowsAtOnce / std::max<std::uint64_t>(pairs, 1), 1);
    count_ = std::min(most, plan_.size.configurations - first_);
    lower_.resize(count_ * pairs);
    ReplyView columns;
    columns.rows = lower_.size();
    columns.lower = lower_.data();
    part_ = make_cpu_job(context_, distances_of(plan_, first_, count_), columns);
  }

  void end_part() {
    const std::uint64_t evaluated = info.pairs_evaluated + part_->info.pairs_evaluated;
    if (first_ == 0) info = part_->info;
    info.pairs_evaluated = evaluated;
    info.rows = info.total = first_ += count_;
    part_.reset();
    part_is_answered_ = false;
    row_ = 0;
  }

  // Writes rows of the part, from the one at which the previous slice ended.
  bool write(WorkMeter& slice) {
    while (row_ < count_) {
      if (pair_ == 0) begin_row();
      const std::uint64_t end = std::min(pair_ + kPairsAtATime, plan_.size.pairs);
      slice.count((end - pair_) / kPairsPerUnit + 1);
      for (; pair_ < end; ++pair_) take_pair();
      if (pair_ == plan_.size.pairs) end_row();
      if (row_ < count_ && slice.is_over()) return false;
    }
    return true;
  }

  void take_pair() {
    const double lower = lower_[row_ * plan_.size.pairs + pair_];
    const double scale = scale_.of(pair_, travels_, lower, plan_.margins.of(pair_));
    if (scale >= least_) return;
    least_ = scale;
    nearest_ = pair_;
  }

  void end_row() {
    const std::uint64_t row = first_ + row_++;
    if (reply_.free_scale) reply_.free_scale[row] = least_;
    if (reply_.pair) reply_.pair[row] = nearest_ == kNobody ? BodyPair{kNone, kNone} : plan_.pairs.at(nearest_);
    pair_ = 0;
  }

  void begin_row() {
    const std::size_t width = plan_.joints.size();
    travels_ = scale_.travels(plan_.positions.subspan((first_ + row_) * width, width));
    least_ = std::numeric_limits<double>::infinity();
    nearest_ = kNobody;
  }

  static constexpr std::uint64_t kNobody = ~std::uint64_t{0};

  JobContext context_;
  Plan plan_;
  ReplyView reply_;
  FreeScale scale_;
  std::uint64_t first_ = 0, count_ = 0;  // configurations of the part
  std::unique_ptr<Job::State> part_;
  bool part_is_answered_ = false;
  std::vector<double> lower_;         // of the part's rows
  std::uint64_t row_ = 0, pair_ = 0;  // next row and pair
  std::vector<double> travels_;       // of that row
  double least_ = 0;                  // smallest so far
  std::uint64_t nearest_ = kNobody;   // pair of `least_`
};

}  // namespace

std::unique_ptr<Job::State> make_free_scale_job(const JobContext& context, Plan plan, const ReplyView& reply) {
  plan.keep_configurations();
  return std::make_unique<FreeScaleJob>(context, std::move(plan), reply);
}

}  // namespace clearance
