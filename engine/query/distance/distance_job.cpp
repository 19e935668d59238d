#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "engine/query/covered_job.h"
#include "engine/query/distance/cover_bounds.h"
#include "engine/query/distance/row_flags.h"

namespace clearance {

namespace {

constexpr std::uint64_t kPacketsPerUnit = 16;  // of work
constexpr std::size_t kMostGroups = 4096;      // of a state, which take 64 bytes each
constexpr std::uint64_t kWithinBatch = 64;     // states for each worker whose rows wait for earlier ones

// Whether the exact engine answers a pair in less than 1 us.
bool answers_fast(const JobContext& context) {
  return context.light && !context.scene->has_surfaces();
}

std::uint16_t with_pose_flags(std::uint16_t flags, std::uint16_t of_poses) {
  return static_cast<std::uint16_t>((flags & ~(kFlagRenormalised | kFlagBeyondLimits)) | of_poses);
}

// Bounds distances of states by covers as far as they have been made, and lets the exact engine evaluate the pairs that
// are left: of the least distance, of each body's, or of each pair.
class DistanceJob final : public CoveredJob {
 public:
  DistanceJob(const JobContext& context, Plan&& plan, const ReplyView& reply)
      : CoveredJob(context, std::move(plan), reply),
        bounds_(plan_, scene(), answers_fast(context)),
        rooms_(static_cast<std::size_t>(workers())),
        orders_rows_(plan_.query.reduce == Reduce::kWithin) {
    if ((plan_.size.fields & kFieldFlags) && (bounds_.writes_rows() || !bounds_.groups().is_one()))
      flags_.emplace(plan_);
    const CoverBounds::Tolerance exact = bounds_.exact_tolerance();
    make_blocks(exact.abs, exact.rel);
    if (orders_rows_) {
      set_batch((kWithinBatch + block() - 1) / block() * block() * static_cast<std::uint64_t>(workers()));
      batch_rows_.resize(
          std::min((kWithinBatch + block()) * static_cast<std::uint64_t>(workers()), plan_.size.configurations));
    }
    covers_changed();
  }

  void rewind() override {
    CoveredJob::rewind();
    first_of_batch_ = written_ = total_ = 0;
  }

 private:
  // A row of a pair.
  struct PairRow {
    std::uint64_t position;
    Row row;
    bool operator<(const PairRow& other) const { return position < other.position; }
  };
  // A group that is left, with the bound of its pairs laid aside.
  struct LeftGroup {
    double lower;            // of the pairs laid aside
    std::uint64_t lower_at;  // position
    bool is_left;
    double upper = kInf;         // by covers, if their bounds are enough for all columns
    std::uint64_t upper_at = 0;  // position
  };
  struct Room {
    CoverBounds::Room bounds{};
    std::vector<LeftGroup> groups;  // by state left and group
  };

  std::uint32_t groups() const { return bounds_.groups().count(); }
  bool by_pair() const { return plan_.query.reduce == Reduce::kNone || orders_rows_; }

  void covers_changed() override {
    if (has_covers()) bounds_.take(covers(), still_bounds());
  }

  static std::uint64_t work_of(std::span<const DistanceBounds> all) {
    std::uint64_t packets = 0;
    for (const DistanceBounds& bounds : all) packets += bounds.packets;
    return packets / kPacketsPerUnit;
  }

  void answer_by_covers(const States& states, int worker, LeftStates& left) override {
    Room& room = rooms_[static_cast<std::size_t>(worker)];
    DistanceBatch batch{};
    batch.view = &covers().view();
    batch.poses = states.poses, batch.stride = states.stride, batch.states = states.count;
    batch.usable = states.usable;
    batch.positions = states.positions, batch.position_stride = states.position_stride;
    batch.frames = states.frames, batch.cells = states.cells;
    const std::span<const DistanceBounds> all = bounds_.bound(batch, room.bounds);
    states.meter.count(work_of(all));
    if (left.configurations().empty()) room.groups.clear();
    for (std::uint64_t k = 0; k < states.count; ++k) {
      const std::uint64_t configuration = states.begin + k;
      const auto bounds = all.subspan(k * groups(), groups());
      if (orders_rows_) rows_of(configuration).clear();
      if ((flags_ && flags_->are_changed_by(configuration)) ||
          std::any_of(bounds.begin(), bounds.end(),
                      [&](const DistanceBounds& b) { return !bounds_.leaves_pairs_out(b); })) {
        left.add_all(configuration, plan_.pairs.size());
        room.groups.resize(room.groups.size() + groups(), {kInf, 0, true});
        continue;
      }
      std::vector<std::uint64_t>* pairs = nullptr;
      for (std::uint32_t g = 0; g < groups(); ++g) {
        if (write_bounded(bounds[g], g, configuration)) continue;
        if (!pairs) {
          pairs = &left.add(configuration);
          room.groups.resize(room.groups.size() + groups(), {kInf, 0, false});
        }
        (room.groups.end() - groups())[g] = leave(room, bounds[g], g, *pairs);
      }
      if (!pairs || by_pair()) continue;
      std::sort(pairs->begin(), pairs->end());
      pairs->erase(std::unique(pairs->begin(), pairs->end()), pairs->end());
    }
  }

  // Writes the row of a group whose bounds by covers suffice.
  bool write_bounded(const DistanceBounds& bounds, std::uint32_t group, std::uint64_t configuration) {
    if (!bounds_.groups().unknown(group).empty()) return false;
    if (orders_rows_ && bounds_.groups().has_cells(group) && bounds_.is_beyond(bounds)) return true;
    PairAnswer answer = empty_answer();
    const bool is_empty = !bounds_.groups().has_cells(group);
    if (!is_empty && !bounds_.answers(bounds, answer)) return false;
    if (orders_rows_ && answer.status == Status::kBeyond) return true;
    BodyPair pair{kNone, kNone}, pair_lower = pair;
    if (is_empty) pair = pair_lower = pair_of_empty(group);
    if (!is_empty && (reply_.pair || orders_rows_ || flags_)) pair = plan_.pairs.at(bounds.upper_at);
    if (!is_empty && reply_.pair_lower)
      pair_lower = plan_.pairs.at(bounds.upper <= 0 ? bounds.upper_at : bounds.lower_at);
    if (flags_) answer.flags = flags_->of(pair);
    const auto number = static_cast<std::uint32_t>(configuration);
    if (orders_rows_) {
      rows_of(configuration).push_back({group, {pair, number, answer, {}, {}, pair_lower, {}, {}}});
      return true;
    }
    const std::uint64_t at = configuration * groups() + group;  // a Row takes longer
    write_row(reply_, at, pair, number, answer, {}, {});
    if (reply_.pair_lower) reply_.pair_lower[at] = pair_lower;
    if (is_empty) write_no_derivatives(at);
    return true;
  }

  // Writes the columns that write_row() leaves out, for a row without points. The other rows by covers have none.
  void write_no_derivatives(std::uint64_t at) {
    if (reply_.gradient_joints)
      std::fill_n(reply_.gradient_joints + at * reply_.joints, reply_.joints, std::numeric_limits<double>::quiet_NaN());
    write_second_order(reply_, at, {});
  }

  // The pair of a row whose group has no pairs, or only pairs with clouds without points.
  BodyPair pair_of_empty(std::uint32_t group) const {
    const std::uint64_t first = bounds_.groups().first(group);
    if (first != PairGroups::kNoPair) return plan_.pairs.at(first);
    return {plan_.query.reduce == Reduce::kNearest ? group : kNone, kNone};
  }

  // Lists the pairs that may be the nearest, that which gives the upper bound, and the unknown ones.
  LeftGroup leave(const Room& room, const DistanceBounds& bounds, std::uint32_t group,
                  std::vector<std::uint64_t>& pairs) const {
    const auto unknown = bounds_.groups().unknown(group);
    pairs.insert(pairs.end(), unknown.begin(), unknown.end());
    if (!bounds_.groups().has_cells(group)) return {kInf, 0, true};
    if (by_pair()) {
      pairs.push_back(group);
      return {kInf, 0, true};
    }
    for (std::uint32_t i = bounds.left_begin; i < bounds.left_end; ++i) pairs.push_back(room.bounds.left[i].position);
    assert(bounds.upper_at < plan_.pairs.size());
    pairs.push_back(bounds.upper_at);
    LeftGroup left{bounds_.is_wide() ? bounds.lower : kInf, bounds.lower_at, true};
    if (bounds_.writes_rows()) left.upper = bounds.upper, left.upper_at = bounds.upper_at;
    return left;
  }

  void write_exact(const ExactState& state, int worker) override {
    if (by_pair()) return write_pairs(state);
    const std::vector<LeftGroup>& groups_left = rooms_[static_cast<std::size_t>(worker)].groups;
    for (std::uint32_t g = 0; g < groups(); ++g) {
      Row& row = state.rows[g];
      if (state.index != kNone) {
        const LeftGroup& group = groups_left[state.index * groups() + g];
        if (!group.is_left) continue;
        if (bounds_.is_wide() && group.lower < row.answer.lower && !std::isnan(row.answer.distance)) {
          row.answer.lower = group.lower;
          row.pair_lower = plan_.pairs.at(group.lower_at);
          if (group.upper < row.answer.upper && std::isinf(row.answer.upper)) {  // of pairs beyond max_distance
            row.answer.upper = group.upper;
            row.pair = plan_.pairs.at(group.upper_at);
            if (flags_) row.answer.flags = with_pose_flags(row.answer.flags, flags_->of(row.pair));
          }
        }
      }
      if (options_.second_order)
        row.second = options_.second_order->row(state.placement, row.pair, row.configuration, row.answer, state.meter);
      if (bounds_.is_wide()) bounds_.to_tolerance(row.answer);
      write_row(reply_, state.configuration * groups() + g, row);
    }
  }

  // The rows of pairs alone, in the order of the query.
  void write_pairs(const ExactState& state) {
    std::size_t next = 0;
    if (orders_rows_ && state.index == kNone) rows_of(state.configuration).clear();
    for (Row& row : state.rows) {
      if (bounds_.is_wide()) bounds_.to_tolerance(row.answer);
      const auto position_at = [&](std::size_t i) { return state.index == kNone ? i : state.pairs[i]; };
      if (!orders_rows_) {
        write_row(reply_, state.configuration * groups() + position_at(next++), row);
        continue;
      }
      if (row.answer.status == Status::kBeyond) continue;
      if (state.index != kNone)
        while (plan_.pairs.at(state.pairs[next]) != row.pair) ++next;
      rows_of(state.configuration).push_back({position_at(next++), std::move(row)});
    }
    if (orders_rows_) std::sort(rows_of(state.configuration).begin(), rows_of(state.configuration).end());
  }

  std::vector<PairRow>& rows_of(std::uint64_t configuration) { return batch_rows_[configuration - first_of_batch_]; }

  void end_batch(std::uint64_t begin, std::uint64_t count) override {
    if (!orders_rows_) return;
    for (std::uint64_t k = 0; k < count; ++k)
      for (const PairRow& row : rows_of(begin + k)) {
        ++total_;
        if (written_ < plan_.size.rows) write_row(reply_, written_++, row.row);
      }
    first_of_batch_ = begin + count;
  }
  void count_rows() override {
    if (!orders_rows_) return CoveredJob::count_rows();
    info.rows = written_;
    info.total = total_;
  }

  static constexpr double kInf = std::numeric_limits<double>::infinity();

  CoverBounds bounds_;
  std::vector<Room> rooms_;        // by worker
  std::optional<RowFlags> flags_;  // if rows by covers need some
  bool orders_rows_;               // the number of a state's rows depends on it
  std::vector<std::vector<PairRow>> batch_rows_;
  std::uint64_t first_of_batch_ = 0, written_ = 0, total_ = 0;
};

}  // namespace

bool covers_may_bound(const JobContext& context, const Plan& plan) {
  return context.covers && !context.reference && context.near_by != NearBy::kTree &&
         (plan.query.reduce != Reduce::kNearest || context.scene->bodies().size() <= kMostGroups) &&
         CoverBounds::may_bound(plan, answers_fast(context)) && CoverPlan::may_decide(plan);
}

std::unique_ptr<Job::State> make_distance_job(const JobContext& context, Plan&& plan, const ReplyView& reply) {
  return std::make_unique<DistanceJob>(context, std::move(plan), reply);
}

}  // namespace clearance
