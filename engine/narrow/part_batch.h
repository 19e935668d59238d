// Answers many pairs of placed convex parts, in parallel lanes if possible, otherwise one after another.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "engine/narrow/lanes.h"
#include "engine/narrow/narrow_phase.h"

namespace clearance {

/// Options of all pairs of a batch.
struct NarrowOptions {
  NarrowLimits limits;
  const LaneKernel* lanes = nullptr;  ///< if null, one pair after another
  bool f32 = false;                   ///< begin with float32 if it can represent the parts
  bool reference = false;             ///< the brute-force oracle: double-double, one pair after another
  bool want_points = true;            ///< witness points and normals; otherwise only the interval
  std::atomic<std::uint64_t>* contradictions = nullptr;  ///< counts contradictory bounds; may be null
};

/// Two placed parts. All that they point to must outlive the run.
struct PartTask {
  const ConvexPart *a, *b;
  const PoseMatrix *pose_a, *pose_b;
  double max_distance;                                           ///< overrides the limits
  std::uint32_t id;                                              ///< chosen by the caller
  double min_penetration = 0;                                    ///< overrides the limits
  double stop_below = -std::numeric_limits<double>::infinity();  ///< overrides the limits
};

/// Each worker has its own. The bits of an answer do not depend on the rest of the batch. Every interval is checked
/// before it is returned: an empty one proves a malfunction, and its pair is answered again (answer_again()).
class PartBatch {
 public:
  explicit PartBatch(const NarrowOptions& options) : options_(options) {}

  /// Calls, for each task and in any order, converged(task, its LaneAnswer, its CoreWitness) if it converged in lanes,
  /// or else take(task, its NarrowAnswer). Both forms give the same answer: see converged_answer().
  template <class Converged, class Take>
  void run(std::span<const PartTask> tasks, Converged&& converged, Take&& take) {
    WorkMeter unlimited;
    begin(tasks);
    advance(unlimited, converged, take);
  }

  /// The same in slices. `tasks` must stay until all are answered.
  void begin(std::span<const PartTask> tasks);
  /// Answers at least one task, unless it is too expensive, and more until the slice is over. Returns true once all are
  /// answered.
  template <class Converged, class Take>
  bool advance(WorkMeter& meter, Converged&& converged, Take&& take) {
    for (; group_ < groups_.size(); ++group_, in_group_ = false) {
      const Group& group = groups_[group_];
      if (!std::exchange(in_group_, true)) run_group(group, meter);
      for (; next_ < group.end; ++next_) {
        const PartTask& task = tasks_[at(next_)];
        const std::size_t place = next_ - group.begin;
        if (group.in_lanes && !is_possible(answers_[place])) {
          take(task, answer_again(task));
        } else if (group.in_lanes && answers_[place].converged) {
          converged(task, answers_[place], witnesses_[place]);
          continue;
        } else {
          try {
            const bool goes_on = group.in_lanes && !has_round(task);
            take(task, answer_alone(task, goes_on ? &unresolved_[place] : nullptr, meter));
          } catch (const WorkMeter::PairUnfinished&) {
            return false;
          }
        }
        if (next_ + 1 < group.end && meter.is_over()) {
          ++next_;
          return false;
        }
      }
      if (group_ + 1 < groups_.size() && meter.is_over()) {
        ++group_, in_group_ = false;
        return false;
      }
    }
    return true;
  }

  /// The NarrowAnswer of a pair that converged in lanes. `rounding` stays 0.
  NarrowAnswer converged_answer(const PartTask& task, const LaneAnswer& lane, const CoreWitness& witness) const;

 private:
  struct Group {  // tasks, in the order of at()
    std::size_t begin, end;
    bool in_lanes, same_hulls, f32;
  };
  struct Kind {  // tasks with the same two parts
    const ConvexPart *a, *b;
    std::uint32_t count, begin;
    bool in_lanes, f32;
  };
  std::size_t at(std::size_t i) const { return order_.empty() ? i : order_[i]; }
  std::uint32_t kind_of(const PartTask& task);
  std::size_t lanes() const { return static_cast<std::size_t>(options_.lanes->lanes); }
  void add_group_alone(std::size_t begin, std::size_t end);
  void add_group(std::size_t begin, std::size_t end, bool same_hulls, bool f32);
  void group_tasks();
  bool may_fill_lanes() const;
  void group_by_kind();
  void group_mixed();
  std::uint64_t gather_pairs(const Group& group);
  void run_group(const Group& group, WorkMeter& meter);
  void resolve_in_f64(const LaneBatch& all);
  static bool fit_lanes(const PartTask& task) { return !is_half_space(*task.a) && !is_half_space(*task.b); }
  static bool has_round(const PartTask& task) { return is_round(*task.a) || is_round(*task.b); }
  static bool is_possible(const LaneAnswer& lane) { return Interval{lane.lower, lane.upper}.is_possible(); }
  NarrowLimits limits_of(const PartTask& task) const;
  NarrowAnswer answer_alone(const PartTask& task, const Gjk<double>* done, WorkMeter& meter);
  NarrowAnswer answer_again(const PartTask& task) const;

  NarrowOptions options_;
  std::span<const PartTask> tasks_;
  std::size_t group_ = 0, next_ = 0;    // progress of advance(): in groups_, and in the order of at()
  bool in_group_ = false;               // lanes have run
  std::unique_ptr<PausedPair> paused_;  // of the next task
  std::vector<std::uint32_t> order_;
  std::vector<Group> groups_;
  std::vector<Kind> kinds_;
  std::vector<std::uint32_t> kind_slots_, kind_of_task_;  // a hash table of kinds_; the kind of each task
  std::vector<LaneHull> hulls_;
  std::vector<LanePair> pairs_;
  std::vector<LaneAnswer> answers_;
  std::vector<CoreWitness> witnesses_;
  std::vector<Gjk<double>> unresolved_;
  // Of the pairs that float32 left unresolved.
  std::vector<std::size_t> again_;
  std::vector<LanePair> again_pairs_;
  std::vector<LaneAnswer> again_answers_;
  std::vector<CoreWitness> again_witnesses_;
  std::vector<Gjk<double>> again_unresolved_;
};

}  // namespace clearance
