#include "engine/query/covered_job.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace clearance {

namespace {

constexpr std::uint64_t kStatesPerUnit = 2;
constexpr std::uint64_t kMostStates = 64;    // of a block: enough to fill lanes, and few enough to stay in the cache
constexpr std::uint64_t kFewestInLanes = 3;  // fewer states are faster one by one

}  // namespace

std::vector<std::uint64_t>& LeftStates::add(std::uint64_t configuration) {
  const std::size_t i = configurations_.size();
  configurations_.push_back(configuration);
  if (pairs_.size() <= i) pairs_.emplace_back();
  pairs_[i].clear();
  return pairs_[i];
}

void LeftStates::add_all(std::uint64_t configuration, std::uint64_t pairs) {
  std::vector<std::uint64_t>& all = add(configuration);
  all.resize(pairs);
  std::iota(all.begin(), all.end(), std::uint64_t{0});
}

std::span<const std::span<const std::uint64_t>> LeftStates::pairs() {
  spans_.assign(pairs_.begin(), pairs_.begin() + static_cast<std::ptrdiff_t>(configurations_.size()));
  return spans_;
}

CoveredJob::CoveredJob(const JobContext& context, Plan&& plan, const ReplyView& reply)
    : ParallelJob(context, std::move(plan), reply),
      near_pairs_(scene(), plan_, boxes(), *context.trees,
                  CoverPlan::pays_at_once(plan_) ? NearBy::kBrute : context.near_by) {
  columns_.assign(boxes());
  block_ = std::min(kMostStates,
                    ConfigurationBlock::most(scene(), plan_, near_pairs_.by_tree(), !boxes().empty(), workers()));
}

void CoveredJob::make_blocks(double abs_tol, double rel_tol) {
  options_.limits.abs_tol = abs_tol;
  options_.limits.rel_tol = rel_tol;
  const Reduction::Boxes all{boxes(), columns_, near_pairs_};
  for (int i = 0; i < workers(); ++i) shares_.emplace_back(ConfigurationBlock(scene(), plan_, options_, all, block_));
  if (CoverPlan::pays_at_once(plan_)) prepare_covers();
}

bool CoveredJob::go_on(WorkMeter& slice) {
  if (still_ && !still_->is_done()) {
    if (!still_->advance(slice)) return false;
    evaluated_ += still_->evaluated();
    take_covers();
    covers_changed();
  }
  const std::uint64_t count = plan_.size.configurations;
  while (first_ < count) {
    const std::uint64_t here = std::min(batch_, count - first_);
    const bool batch_done =
        run_units(next_, (here + block_ - 1) / block_, slice, [&](std::uint64_t unit, int worker, WorkMeter& meter) {
          return answer(first_ + unit * block_, worker, meter);
        });
    if (!batch_done) return false;
    end_batch(first_, here);
    first_ += here;
    next_ = 0;
    if (first_ < count && slice.is_over()) return false;
  }
  count_rows();
  info.pairs_evaluated = evaluated_;
  if (evaluated_ > 0) context_.pairs_evaluated->fetch_add(evaluated_, std::memory_order_relaxed);
  return true;
}

void CoveredJob::rewind() {
  first_ = next_ = 0;
  evaluated_.store(0, std::memory_order_relaxed);
  if (!is_prepared_)
    prepare_covers();
  else if (covers_revision_ != CoverPlan::revision(*context_.covers, context_.tables))
    take_covers();
  else
    return;
  covers_changed();
}

void CoveredJob::prepare_covers() {
  is_prepared_ = true;
  still_ = StillPairs::find(scene(), plan_, options_, boxes());
  if (!still_) take_covers();
}

void CoveredJob::take_covers() {
  covers_revision_ = CoverPlan::revision(*context_.covers, context_.tables);
  covers_ = CoverPlan::make(scene(), plan_, *context_.covers, context_.tables,
                            still_ ? still_->known() : std::span<const std::uint64_t>());
  for (Worker& share : shares_) share.lanes.reset();
}

// The rows of one block of configurations.
bool CoveredJob::answer(std::uint64_t begin, int worker, WorkMeter& meter) {
  Worker& share = shares_[static_cast<std::size_t>(worker)];
  if (!share.block.has_begun()) {
    const std::uint64_t count = std::min(block_, plan_.size.configurations - begin);
    share.left.clear();
    if (covers_) {
      begin_by_covers(share, begin, count, worker, meter);
      meter.count(1 + count / kStatesPerUnit);
      if (!share.block.has_begun()) return true;
    } else {
      share.placed = placements(worker, begin, count);
      share.block.begin(share.placed, begin);
      share.all.resize(count);
      std::iota(share.all.begin(), share.all.end(), begin);
    }
  }
  if (!share.block.advance(meter)) return false;
  const std::span<const std::uint64_t> left = covers_ ? share.left.configurations() : share.all;
  share.rows.resize(std::max(share.rows.size(), left.size()));
  evaluated_.fetch_add(share.block.end(std::span(share.rows).first(left.size())), std::memory_order_relaxed);
  const auto pairs = share.left.pairs();
  for (std::size_t i = 0; i < left.size(); ++i) {
    if (covers_)
      write_exact({left[i], i, pairs[i], share.rows[i], share.placed[i], meter}, worker);
    else
      write_exact({left[i], kNone, {}, share.rows[i], share.placed[i], meter}, worker);
  }
  return true;
}

// Answers a block by covers, and begins the exact evaluation of the states that are left.
void CoveredJob::begin_by_covers(Worker& share, std::uint64_t begin, std::uint64_t count, int worker,
                                 WorkMeter& meter) {
  if (!answer_in_lanes(share, begin, count, worker, meter)) answer_by_poses(share, begin, count, worker, meter);
  const std::span<const std::uint64_t> left = share.left.configurations();
  share.leaves_most = 2 * left.size() > count;
  if (left.empty()) return;
  const auto pairs = share.left.pairs();
  share.placed = worker_poses(worker).at(left, pairs);
  share.block.begin(share.placed, left, pairs);
}

// Answers states without poses of their bodies, side by side. Returns false if they need poses: those that are left do.
bool CoveredJob::answer_in_lanes(Worker& share, std::uint64_t begin, std::uint64_t count, int worker,
                                 WorkMeter& meter) {
  if (share.leaves_most) return false;
  if (!share.lanes) share.lanes.emplace(*covers_, plan_);
  StateLanes& lanes = *share.lanes;
  if (!lanes.can_place()) return false;
  const std::size_t joints = plan_.joints.size(), stride = plan_.bodies.size();
  const auto positions_of = [&](std::uint64_t k) { return plan_.positions.data() + k * joints; };
  if (count < kFewestInLanes) {
    for (std::uint64_t k = begin; k < begin + count; ++k) {
      const Pose* const poses = lanes.place_one(k);
      answer_by_covers({k, 1, poses, stride, lanes.usable(), positions_of(k), joints, nullptr, lanes.cells(), meter},
                       worker, share.left);
    }
    return true;
  }
  for (std::uint64_t k = begin; k < begin + count; k += kMostLanes) {
    const std::uint64_t here = std::min<std::uint64_t>(kMostLanes, begin + count - k);
    lanes.place(k, here);
    answer_by_covers(
        {k, here, nullptr, 0, lanes.usable(), positions_of(k), joints, lanes.frames(), lanes.cells(), meter}, worker,
        share.left);
  }
  return true;
}

void CoveredJob::answer_by_poses(Worker& share, std::uint64_t begin, std::uint64_t count, int worker,
                                 WorkMeter& meter) {
  const std::size_t stride = plan_.bodies.size(), joints = plan_.joints.size();
  const ConfigurationPoses::PoseBlock block = worker_poses(worker).given(begin, count);
  const Pose* poses = block.poses.data();
  share.usable.assign(count, 1);
  if (plan_.given_bodies > 0) {
    share.poses.assign(block.poses.begin(), block.poses.end());
    poses = share.poses.data();
    for (std::uint64_t k = 0; k < count; ++k)
      share.usable[k] = covers_->take_given(std::span(share.poses).subspan(k * stride, plan_.given_bodies));
  }
  if (!plan_.motions.empty())
    for (std::uint64_t k = 0; k < count; ++k) {
      const auto facts = block.facts.subspan(k * stride, stride);
      share.usable[k] &=
          covers_->holds_for(plan_.positions.subspan((begin + k) * joints, joints)) &&
          std::none_of(facts.begin(), facts.end(), [](std::uint8_t f) { return f & (kLinkUnplaced | kLinkBad); });
    }
  const double* const positions = plan_.positions.data() + begin * joints;
  answer_by_covers({begin, count, poses, stride, share.usable.data(), positions, joints, nullptr, nullptr, meter},
                   worker, share.left);
}

void CoveredJob::write_exact(const ExactState& state, int) {
  write_row(reply_, state.configuration, state.rows[0]);
}

}  // namespace clearance
