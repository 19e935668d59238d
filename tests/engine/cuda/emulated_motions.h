// Motions in host memory, for kernels emulated without a GPU (emulated_scene.h).
#pragma once

#include <limits>
#include <vector>

#include "engine/device/motion_layout.h"
#include "engine/motion/motion_block.h"
#include "engine/motion/motion_bounds.h"
// After all other headers.
#include "tests/engine/cuda/emulated_scene.h"
namespace clearance::emulated {
using namespace clearance::cuda;
}  // namespace clearance::emulated
#define cuda emulated
#include "engine/cuda/motion/motion_lean.cuh"
#undef cuda

namespace clearance::test {

/// A chunk of motions in host memory, with the kernels' results.
class HostMotions {
 public:
  /// \param pair_capacity capacity of lists of pairs; 0 for a device's
  /// \param span_capacity likewise for spans
  /// \param hit_capacity likewise for hits
  HostMotions(const engine::Scene& scene, const QueryView& q, std::uint32_t pair_capacity = 0,
              std::uint32_t span_capacity = 0, std::uint32_t hit_capacity = 0)
      : scene_(scene), hulls_(scene, kMostShared), bodies_(scene, hulls_.view(), q), pairs_(bodies_.refs()) {
    const Plan& plan = bodies_.plan;
    const MotionBounds bounds(scene, plan);
    fits_ = bounds.flatten(arrays_);
    if (!fits_) return;
    const auto motions = static_cast<std::uint32_t>(plan.size.configurations),
               pairs = static_cast<std::uint32_t>(plan.size.pairs);
    const std::size_t J = plan.joints.size(), M = plan.moved.size();
    m_.motions = motions;
    m_.max_evaluations = q.max_evaluations;
    m_.seeks_contact = (q.fields & kFieldFirstContact) != 0;
    const MotionCapacity capacity(motions, pairs);
    m_.span_capacity = span_capacity ? span_capacity : capacity.spans;
    m_.pair_capacity = pair_capacity ? pair_capacity : capacity.pairs;
    m_.hit_capacity = hit_capacity ? hit_capacity : capacity.hits;
    m_.finds_least = q.reduce == Reduce::kMin;
    m_.abs_tol = q.abs_tol;
    m_.rel_tol = q.rel_tol;
    m_.levels = levels_of(m_);
    m_.tables = {arrays_.movers.data(), arrays_.chains.data(),        arrays_.chain_of_slot.data(),
                 arrays_.views.data(),  arrays_.views_of_pair.data(), arrays_.reach.data()};
    for (std::uint32_t p = 0; p < pairs; ++p) margins_.push_back(plan.margins.of(p));
    m_.margins = margins_.data();
    m_.ends = plan.positions.data();
    const std::size_t S = m_.span_capacity;
    set_up_query(q, pairs);
    m_.moves = bodies_.moves;
    m_.positions = allocate<double>(S * J);
    m_.travels = allocate<double>(motions * m_.moves.frames.robot_count);
    const std::size_t frames = bodies_.frame_numbers.size() / (7 * std::max<std::size_t>(motions, 1));
    m_.twists = allocate<double>(frames * 6 * S);
    m_.numbers = allocate<double>(M * kMotionNumbers * S);
    m_.speeds = allocate<float>(M * S);
    m_.moves.frames.positions = m_.positions;
    m_.moves.frames.numbers = allocate<double>(frames * 7 * S);
    m_.moves.frames.facts = allocate<std::uint8_t>(frames * S);
    m_.moves.frames.travels = allocate<double>(m_.moves.frames.robot_count * S);
    allocate_moved(S, M);
    m_.hit = allocate<std::uint64_t>(motions);
    m_.steps = allocate<std::uint32_t>(motions);
    m_.open = allocate<std::uint8_t>(motions);
    m_.to_cpu = allocate<std::uint8_t>(motions);
    m_.unresolved = allocate<std::uint8_t>(motions);
    m_.outcomes = allocate<MotionOutcome>(motions);
    m_.free_until = allocate<double>(motions);
    m_.low = allocate<std::uint64_t>(motions);
    m_.seed = allocate<std::uint64_t>(2 * motions);
    m_.lock = allocate<std::uint32_t>(motions);
    for (MotionSpan** at : {&m_.spans, &m_.next_spans}) *at = allocate<MotionSpan>(S);
    for (std::uint32_t** at : {&m_.shares, &m_.children, &m_.next_children}) *at = allocate<std::uint32_t>(2 * S);
    for (SpanPair** at : {&m_.on, &m_.next_on, &m_.near, &m_.to_evaluate}) *at = allocate<SpanPair>(m_.pair_capacity);
    m_.ways = allocate<float>(m_.pair_capacity);
    m_.apart_capacity = m_.finds_least ? 0 : m_.pair_capacity / 2;
    m_.apart = allocate<ApartPair>(m_.apart_capacity);
    m_.hits = allocate<MotionHitRow>(m_.hit_capacity);
    for (MotionHitRow** at : {&m_.best, &m_.hit_rows}) *at = allocate<MotionHitRow>(motions);
    m_.counts = allocate<std::uint32_t>(kMotionCounts);
  }
  HostMotions(const HostMotions&) = delete;

  bool fits() const { return fits_; }
  void limit_apart(std::uint32_t most) { m_.apart_capacity = most; }

  void run() {
    const std::size_t S = m_.span_capacity, J = bodies_.plan.joints.size(), M = bodies_.plan.moved.size();
    launch(std::max<std::size_t>(m_.motions, kMotionCounts), [&] { begin_motions(m_); });
    for (m_.level = 0; m_.level < m_.levels; ++m_.level) {
      launch(S * J, [&] { place_spans(m_); });
      launch(S * m_.moves.frames.robot_count, [&] { place_span_links(m_); });
      launch(S * M, [&] { place_span_bodies(m_); });
      launch(S * M, [&] { move_span_bodies(m_); });
      const bool at_ends = m_.finds_least && m_.level == 0,
                 is_first = m_.level == 0 || (m_.finds_least && m_.level == 1);
      // A few blocks for all lists.
      if (at_ends) {
        launch(300, [&] { find_seeds_at_ends(m_); });
        launch(2 * m_.motions, [&] { evaluate_seeds(m_); });
        launch(2 * m_.motions, [&] { aim_at_ends(m_); });
      }
      launch(300, [&] { is_first ? find_near_in_spans<true>(m_) : find_near_in_spans<false>(m_); });
      launch(300, [&] { look_along_boxes(m_); });
      if (!m_.finds_least) {
        launch(300, [&] { iterate_span_pairs(m_); }, kIterateThreads);
        launch(300, [&] { divide_span_pairs(m_); });
      }
      launch(
          600, [&] { m_.finds_least ? evaluate_span_pairs<true>(m_) : evaluate_span_pairs<false>(m_); },
          kEvaluateThreads);
      if (!m_.finds_least) launch(300, [&] { keep_hits(m_); });
      if (at_ends)
        launch(m_.motions, [&] { begin_whole_motions(m_); });
      else
        launch(2 * S, [&] { divide_spans(m_); });
      std::swap(m_.spans, m_.next_spans);
      std::swap(m_.children, m_.next_children);
      std::swap(m_.on, m_.next_on);
    }
    launch(m_.motions, [&] { conclude_motions(m_); });
    hit_row_.assign(m_.motions, kNone);
    for (std::uint32_t i = 0; i < m_.counts[kHitRowCount]; ++i) hit_row_[m_.hit_rows[i].motion] = i;
  }

  MotionOutcome outcome(std::uint32_t motion) const { return m_.outcomes[motion]; }
  /// The row of a motion that hits, or null.
  const MotionHitRow* hit(std::uint32_t motion) const {
    return hit_row_[motion] == kNone ? nullptr : m_.hit_rows + hit_row_[motion];
  }
  /// Valid if first contact is requested.
  double free_until(std::uint32_t motion) const { return m_.free_until[motion]; }
  bool is_for_cpu(std::uint32_t motion) const { return m_.to_cpu[motion] != 0; }
  std::uint32_t steps(std::uint32_t motion) const { return m_.steps[motion]; }
  std::uint32_t levels() const { return m_.levels; }
  std::uint32_t count(std::uint32_t which, std::uint32_t level) const {
    return m_.counts[level * kCountsOfLevel + which];
  }
  const Plan& plan() const { return bodies_.plan; }

 private:
  template <class T>
  T* allocate(std::size_t count) {
    memory_.emplace_back((count * sizeof(T) + 15) / 16 * 16 + 16, std::byte{0xa5});  // unwritten memory holds garbage
    const auto at = reinterpret_cast<std::uintptr_t>(memory_.back().data());
    return reinterpret_cast<T*>((at + 15) / 16 * 16);
  }
  template <class Kernel>
  static void launch(std::size_t threads, const Kernel& kernel, unsigned of_block = kMotionThreads) {
    EmulatedGrid::one().launch(static_cast<unsigned>(threads / of_block + 1), of_block, kernel);
  }
  void set_up_query(const QueryView& q, std::uint32_t pairs) {
    ChunkView& c = m_.chunk;
    c.hulls = hulls_.view();
    c.bodies = bodies_.view;
    const bool flags = (q.fields & kFieldFlags) != 0;
    EvaluateOptions options;
    options.limits.abs_tol = q.abs_tol;
    options.limits.rel_tol = q.rel_tol;
    set_motion_options(bodies_.plan, options);
    const NarrowLimits& limits = options.limits;
    c.pair_limits = {limits.max_distance, limits.abs_tol, limits.rel_tol, 256, true, true, flags, true, false, false};
    c.pairs = pairs_.data();
    c.pair_count = pairs;
    c.configurations = m_.span_capacity;
  }
  void allocate_moved(std::size_t S, std::size_t M) {
    BodiesView& view = m_.chunk.bodies;
    std::size_t parts = 0;
    for (const std::uint32_t body : bodies_.plan.moved) parts += scene_.bodies()[body].parts.size();
    view.moved = allocate<double>(S * M * HostBodies::kComponents);
    view.moved_state = allocate<std::uint8_t>(S * M);
    view.moved_box = allocate<OuterBox>(S * M);
    view.moved_part_box = allocate<double>(S * parts * kBoxComponents);
    view.uncertainties.moved = allocate<BodySlack>(S * M);
  }

  const engine::Scene& scene_;
  HullArrays hulls_;
  HostBodies bodies_;
  std::vector<PairRef> pairs_;
  MotionArrays arrays_;
  std::vector<double> margins_;
  std::vector<std::vector<std::byte>> memory_;
  std::vector<std::uint32_t> hit_row_;
  MotionsView m_{};
  bool fits_ = false;
};

}  // namespace clearance::test
