// Many pairs of placed pieces, answered side by side where lanes can, one after another where they cannot.
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

/// How every pair of a batch is answered.
struct NarrowOptions {
  NarrowLimits limits;
  const LaneKernel* lanes = nullptr;  ///< null: one pair after another
  bool f32 = false;                   ///< begin with float32 where it can hold the pieces
  bool reference = false;             ///< the brute-force oracle: double-double, one pair after another
  bool want_points = true;            ///< witness points and normals; without, only the interval
  std::atomic<std::uint64_t>* contradictions =
      nullptr;  ///< counts bounds that contradicted each other; null: nobody does
};

/// Two placed pieces; all that they point to must outlive the run.
struct PieceTask {
  const Piece *a, *b;
  const PoseMatrix *pose_a, *pose_b;
  double max_distance;                                           ///< instead of the limits'
  std::uint32_t id;                                              ///< the caller's own
  WarmSimplex* warm = nullptr;                                   ///< as for narrow_phase(); null: cold
  double min_penetration = 0;                                    ///< instead of the limits'
  double stop_below = -std::numeric_limits<double>::infinity();  ///< the same
};

/// Each worker has its own. The bits of an answer do not depend on what else is in the batch. Every interval is looked
/// at before it leaves: one that no number lies in was made by something broken, and its pair is answered anew
/// (answer_anew()).
class PieceBatch {
 public:
  explicit PieceBatch(const NarrowOptions& options) : options_(options) {}

  /// Calls, for each task and in any order, settled(task, its LaneAnswer, its LaneWitness) for what lanes have settled,
  /// or else take(task, its NarrowAnswer). NarrowAnswers say the same of a pair as lanes do: see converged_answer().
  template <class Converged, class Take>
  void run(std::span<const PieceTask> tasks, Converged&& converged, Take&& take) {
    WorkMeter unlimited;
    begin(tasks);
    advance(unlimited, converged, take);
  }

  /// The same in slices. `tasks` must stay until all are answered.
  void begin(std::span<const PieceTask> tasks);
  /// Answers one task at least, unless it is too dear, and others until the slice is over. Returns true once all are
  /// answered.
  template <class Converged, class Take>
  bool advance(WorkMeter& meter, Converged&& converged, Take&& take) {
    for (; group_ < groups_.size(); ++group_, in_group_ = false) {
      const Group& group = groups_[group_];
      if (!std::exchange(in_group_, true)) run_group(group, meter);
      for (; next_ < group.end; ++next_) {
        const PieceTask& task = tasks_[at(next_)];
        const std::size_t place = next_ - group.begin;
        if (group.in_lanes && !is_possible(answers_[place])) {
          take(task, answer_anew(task));
        } else if (group.in_lanes && answers_[place].converged) {
          converged(task, answers_[place], witnesses_[place]);
          continue;
        } else {
          try {
            take(task, answer_alone(task, group.in_lanes ? &unresolved_[place] : nullptr, meter));
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

  /// The NarrowAnswer of a pair that lanes have settled. `rounding` is left 0.
  NarrowAnswer converged_answer(const PieceTask& task, const LaneAnswer& lane, const LaneWitness& witness) const;

 private:
  struct Group {  // of tasks, in the order that at() tells
    std::size_t begin, end;
    bool in_lanes, same_hulls, f32;
  };
  struct Kind {  // of tasks: the same two pieces
    const Piece *a, *b;
    std::uint32_t count, begin;
    bool in_lanes, f32;
  };
  std::size_t at(std::size_t i) const { return order_.empty() ? i : order_[i]; }
  std::uint32_t kind_of(const PieceTask& task);
  void deal();
  void run_group(const Group& group, WorkMeter& meter);
  void resolve_in_f64(const LaneBatch& all);
  static bool fit_lanes(const PieceTask& task) { return !task.a->primitive && !task.b->primitive; }
  static bool is_possible(const LaneAnswer& lane) { return Interval{lane.lower, lane.upper}.is_possible(); }
  NarrowLimits limits_of(const PieceTask& task) const;
  NarrowAnswer answer_alone(const PieceTask& task, const Gjk<double>* done, WorkMeter& meter);
  NarrowAnswer answer_anew(const PieceTask& task) const;

  NarrowOptions options_;
  std::span<const PieceTask> tasks_;
  std::size_t group_ = 0, next_ = 0;    // how far advance() has come: in groups_, and in the order that at() tells
  bool in_group_ = false;               // lanes have run
  std::unique_ptr<PausedPair> paused_;  // of the task that is next
  std::vector<std::uint32_t> order_;
  std::vector<Group> groups_;
  std::vector<Kind> kinds_;
  std::vector<std::uint32_t> kind_slots_, kind_of_task_;  // a hash table of kinds_; the kind of each task
  std::vector<LaneHull> hulls_;
  std::vector<LanePair> pairs_;
  std::vector<LaneAnswer> answers_;
  std::vector<LaneWitness> witnesses_;
  std::vector<Gjk<double>> unresolved_;
  // Of the pairs that float32 left open.
  std::vector<std::size_t> again_;
  std::vector<LanePair> again_pairs_;
  std::vector<LaneAnswer> again_answers_;
  std::vector<LaneWitness> again_witnesses_;
  std::vector<Gjk<double>> again_unresolved_;
};

}  // namespace clearance
