#include "engine/narrow/part_batch.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>

namespace clearance {

namespace {

constexpr std::uint32_t kFree = ~std::uint32_t{0};
constexpr std::size_t kMostInLanes = 512;  // tasks that lanes answer between two checks of the meter

std::size_t hash_of(const ConvexPart* a, const ConvexPart* b) {
  const auto bits = reinterpret_cast<std::uintptr_t>(a) * 3 + reinterpret_cast<std::uintptr_t>(b);
  return (bits >> 4) * 0x9E3779B97F4A7C15u >> 20;
}

}  // namespace

// Index of the task's kind in kinds_. The first task of a kind is added.
std::uint32_t PartBatch::kind_of(const PartTask& task) {
  for (std::size_t h = hash_of(task.a, task.b);; ++h) {
    std::uint32_t& slot = kind_slots_[h & (kind_slots_.size() - 1)];
    if (slot == kFree) {
      slot = static_cast<std::uint32_t>(kinds_.size());
      const bool in_lanes = fit_lanes(task);
      kinds_.push_back({task.a, task.b, 0, 0, in_lanes, in_lanes && options_.f32 && fits_f32(*task.a, *task.b)});
      return slot;
    }
    if (kinds_[slot].a == task.a && kinds_[slot].b == task.b) return slot;
  }
}

void PartBatch::begin(std::span<const PartTask> tasks) {
  assert(!tasks.empty());
  tasks_ = tasks;
  group_ = next_ = 0;
  in_group_ = false;
  paused_.reset();
  group_tasks();
}

void PartBatch::add_group_alone(std::size_t begin, std::size_t end) {
  if (begin < end) groups_.push_back({begin, end, false, false, false});
}

// Few pairs use float32, too: an answer's bits must not depend on the number of pairs.
void PartBatch::add_group(std::size_t begin, std::size_t end, bool same_hulls, bool f32) {
  for (std::size_t next; begin < end; begin = next) {
    next = std::min(end, begin + kMostInLanes);
    groups_.push_back({begin, next, f32 || next - begin > lanes() / 4, same_hulls, f32});
  }
}

// Groups pairs of the same two parts if they fill the lanes. The other lanes take any pairs.
void PartBatch::group_tasks() {
  const std::span<const PartTask> tasks = tasks_;
  order_.clear();
  groups_.clear();
  if (!options_.lanes || options_.reference) return add_group_alone(0, tasks.size());
  const PartTask& first = tasks[0];
  if (std::all_of(tasks.begin(), tasks.end(), [&](const PartTask& t) { return t.a == first.a && t.b == first.b; })) {
    if (!fit_lanes(first)) return add_group_alone(0, tasks.size());
    add_group(0, tasks.size(), true, options_.f32 && fits_f32(*first.a, *first.b));
  } else if (options_.f32 || may_fill_lanes()) {
    group_by_kind();
  } else {
    group_mixed();
  }
}

// Whether the tasks of one kind may fill the lanes: much cheaper than counting them, and false for most queries of one
// configuration.
bool PartBatch::may_fill_lanes() const {
  std::array<std::uint8_t, 1024> counts{};
  for (const PartTask& task : tasks_)
    if (++counts[hash_of(task.a, task.b) % counts.size()] >= lanes()) return true;
  return false;
}

void PartBatch::group_by_kind() {
  const std::span<const PartTask> tasks = tasks_;
  kinds_.clear();
  kind_slots_.assign(std::bit_ceil(2 * tasks.size()), kFree);
  kind_of_task_.clear();
  for (const PartTask& task : tasks) {
    kind_of_task_.push_back(kind_of(task));
    ++kinds_[kind_of_task_.back()].count;
  }
  // Kinds that fill the lanes first; then those of few tasks, in float32 and in float64; then those unsuited to lanes.
  std::uint32_t next = 0;
  for (const int part : {0, 1, 2, 3}) {
    const std::uint32_t begin = next;
    for (Kind& kind : kinds_) {
      if ((!kind.in_lanes ? 3 : kind.count >= lanes() ? 0 : kind.f32 ? 1 : 2) != part) continue;
      kind.begin = next;
      next += kind.count;
      if (part == 0) add_group(kind.begin, next, true, kind.f32);
    }
    if (part == 3)
      add_group_alone(begin, next);
    else if (part > 0)
      add_group(begin, next, false, part == 1);
  }
  assert(next == tasks.size());
  order_.resize(tasks.size());
  for (std::uint32_t i = 0; i < tasks.size(); ++i) order_[kinds_[kind_of_task_[i]].begin++] = i;
}

// Float64 pairs of any parts, then those unsuited to lanes.
void PartBatch::group_mixed() {
  order_.resize(tasks_.size());
  std::uint32_t in_lanes = 0, end = 0;
  for (const bool fit : {true, false}) {
    in_lanes = end;
    for (std::uint32_t i = 0; i < tasks_.size(); ++i)
      if (fit_lanes(tasks_[i]) == fit) order_[end++] = i;
  }
  add_group(0, in_lanes, false, false);
  add_group_alone(in_lanes, end);
}

// Makes the group's lane pairs and their hulls. Returns their work.
std::uint64_t PartBatch::gather_pairs(const Group& group) {
  const std::size_t count = group.end - group.begin;
  hulls_.clear();
  hulls_.reserve(group.same_hulls ? 2 : 2 * count);  // lanes keep pointers to them
  pairs_.clear();
  std::uint64_t units = 0;
  struct LatestHull {
    const ConvexPart* part;
    const LaneHull* hull;
  };
  std::array<LatestHull, 64> latest_a{}, latest_b{};  // a part takes part in many pairs
  const auto hull_of = [&](const ConvexPart* part, std::array<LatestHull, 64>& latest) {
    LatestHull& last = latest[reinterpret_cast<std::uintptr_t>(part) / 64 % latest.size()];
    if (last.part != part) last = {part, &hulls_.emplace_back(*part)};
    return last.hull;
  };
  const ConvexPart *a = nullptr, *b = nullptr;
  const LaneHull *hull_a = nullptr, *hull_b = nullptr;
  for (std::size_t i = group.begin; i < group.end; ++i) {
    const PartTask& task = tasks_[at(i)];
    units += WorkMeter::units_of(*task.a, *task.b);
    if (task.a != a) hull_a = hull_of(a = task.a, latest_a);
    if (task.b != b) hull_b = hull_of(b = task.b, latest_b);
    pairs_.push_back({hull_a, hull_b, &task.pose_a->R_wb, &task.pose_b->R_wb, &task.pose_a->t_w, &task.pose_b->t_w,
                      task.max_distance, task.stop_below});
  }
  assert(hulls_.size() <= (group.same_hulls ? 2 : 2 * count));  // otherwise they have moved
  return units;
}

void PartBatch::run_group(const Group& group, WorkMeter& meter) {
  if (!group.in_lanes) return;
  const std::size_t count = group.end - group.begin;
  const std::uint64_t units = gather_pairs(group);
  if (answers_.size() < count) {  // resized last, since memory may run out before
    witnesses_.resize(count);
    unresolved_.resize(count);
    answers_.resize(count);
  }
  meter.count(units * std::max(count, lanes()) / count);  // empty lanes take as long as others
  const NarrowLimits& limits = options_.limits;
  const bool same_hulls = group.same_hulls && !has_round(tasks_[at(group.begin)]);
  const LaneBatch batch{pairs_.data(),     count,
                        same_hulls,        limits.abs_tol,
                        limits.rel_tol,    limits.max_iterations,
                        answers_.data(),   options_.want_points ? witnesses_.data() : nullptr,
                        unresolved_.data()};
  if (group.f32) {
    options_.lanes->run_f32(batch);
    resolve_in_f64(batch);
  } else {
    options_.lanes->run(batch);
  }
}

// Float64 lanes for pairs that float32 left unresolved.
void PartBatch::resolve_in_f64(const LaneBatch& all) {
  again_.clear();
  again_pairs_.clear();
  for (std::size_t i = 0; i < all.count; ++i)
    if (!all.answers[i].converged && is_possible(all.answers[i])) {
      again_.push_back(i);
      again_pairs_.push_back(all.pairs[i]);
    }
  if (again_.empty()) return;
  if (again_answers_.size() < again_.size()) {
    again_witnesses_.resize(again_.size());
    again_unresolved_.resize(again_.size());
    again_answers_.resize(again_.size());
  }
  LaneBatch batch = all;
  batch.pairs = again_pairs_.data();
  batch.count = again_.size();
  batch.answers = again_answers_.data();
  if (all.witnesses) batch.witnesses = again_witnesses_.data();
  batch.unresolved = again_unresolved_.data();
  options_.lanes->run(batch);
  for (std::size_t k = 0; k < again_.size(); ++k) {
    all.answers[again_[k]] = again_answers_[k];
    if (!again_answers_[k].converged)
      all.unresolved[again_[k]] = again_unresolved_[k];
    else if (all.witnesses)
      all.witnesses[again_[k]] = again_witnesses_[k];
  }
}

NarrowLimits PartBatch::limits_of(const PartTask& task) const {
  NarrowLimits limits = options_.limits;
  limits.max_distance = task.max_distance;
  limits.min_penetration = task.min_penetration;
  limits.stop_below = task.stop_below;
  return limits;
}

NarrowAnswer PartBatch::answer_alone(const PartTask& task, const Gjk<double>* done, WorkMeter& meter) {
  meter.begin_pair();
  const auto& [a, b, pose_a, pose_b, max_distance, id, min_penetration, stop_below] = task;
  const NarrowLimits limits = limits_of(task);
  const NarrowAnswer answer = options_.reference
                                  ? narrow_phase_reference(*a, *pose_a, *b, *pose_b, limits)
                                  : narrow_phase(*a, *pose_a, *b, *pose_b, limits, done, &meter, &paused_);
  return answer.bounds.is_possible() ? answer : answer_again(task);
}

// Answers a pair with contradictory bounds again, in the most independent way: alone, in double-double from the first
// step, vertices without a table, new rotations. If that contradicts itself too, nothing is proved: [-inf, inf].
NarrowAnswer PartBatch::answer_again(const PartTask& task) const {
  if (options_.contradictions) options_.contradictions->fetch_add(1, std::memory_order_relaxed);
  const ConvexPart a = without_table(*task.a), b = without_table(*task.b);
  const NarrowAnswer answer = narrow_phase_reference(a, *task.pose_a, b, *task.pose_b, limits_of(task));
  return answer.bounds.is_possible() ? answer : NarrowAnswer();
}

NarrowAnswer PartBatch::converged_answer(const PartTask& task, const LaneAnswer& lane,
                                         const CoreWitness& witness) const {
  NarrowAnswer answer;
  answer.bounds = {lane.lower, lane.upper};
  answer.beyond = lane.lower > task.max_distance;
  answer.converged = true;
  if (options_.want_points)
    take_lane_witness(*task.a, task.pose_a->R_wb, *task.b, task.pose_b->R_wb, witness, answer.point_a, answer.point_b,
                      answer.normal);
  return answer;
}

}  // namespace clearance
