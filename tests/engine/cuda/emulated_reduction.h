// Reduced queries in host memory, for kernels emulated without a GPU (emulated_scene.h).
#pragma once

#include <bit>
#include <deque>
#include <limits>
#include <memory>
#include <vector>

#include "engine/cuda/mesh/element_arrays.h"
#include "engine/device/query/extents_around.h"
#include "engine/evaluate/evaluate.h"
#include "engine/narrow/lanes.h"
#include "engine/reduce/reduction.h"
// After all other headers.
#include "tests/engine/cuda/emulated_scene.h"

#define cuda emulated
#include "engine/cuda/mesh/element_kernel.cuh"
#include "engine/cuda/reduce/any_kernel.cuh"
#include "engine/cuda/reduce/open_items.cuh"
#undef cuda

namespace clearance::test {

inline constexpr std::uint64_t kNoKey = ~std::uint64_t{0};

/// The clouds and meshes of a scene in the layout of kernels.
class HostElements {
 public:
  explicit HostElements(const engine::Scene& scene) : of_body_(scene.bodies().size(), kNone) {
    for (std::uint32_t b = 0; b < scene.bodies().size(); ++b) {
      const Body& body = scene.bodies()[b];
      if (!is_cloud(body) && !has_surface(body)) continue;
      of_body_[b] = static_cast<std::uint32_t>(sets_.size());
      ElementSet& set = sets_.emplace_back();
      set.hull = extents_around(body);
      set.body = b;
      set.is_empty = is_cloud(body) && body.cloud != CloudState::kPoints;
      if (set.is_empty || body.parts.size() != 1) continue;
      const ElementArrays& of = arrays_.emplace_back(*body.parts[0]->surface);
      set.centre = of.set.centre;
      set.half = of.set.half;
      set.reach = of.set.reach;
      set.is_solid = of.set.is_solid;
      set.part_count = of.set.part_count;
      set.parts = of.parts.data();
      set.nodes = copied<ElementNode>(of.nodes);
      set.points = of.points.empty() ? nullptr : of.points[0].data();
      set.slabs = copied<ElementSlab>(of.slabs);
      set.corners = of.corners.empty() ? nullptr : of.corners.data();
    }
  }
  ElementsView view() const {
    if (sets_.empty()) return {};
    return {sets_.data(), of_body_.data(), static_cast<std::uint32_t>(sets_.size()), {true, true, true}};
  }

 private:
  // In the layout and alignment that kernels need.
  template <class To, class From>
  const To* copied(std::span<const From> from) {
    static_assert(sizeof(To) == sizeof(From));
    const auto to = std::make_shared<std::vector<To>>(from.size());
    std::memcpy(static_cast<void*>(to->data()), from.data(), from.size_bytes());
    copies_.push_back(to);
    return to->data();
  }

  std::deque<ElementArrays> arrays_;
  std::vector<std::shared_ptr<void>> copies_;
  std::vector<ElementSet> sets_;
  std::vector<std::uint32_t> of_body_;
};

/// A reduced query as one chunk in host memory.
class HostReduction {
 public:
  HostReduction(const engine::Engine& cpu, const QueryView& q)
      : cpu_(cpu),
        q_(q),
        hulls_(cpu.scene(), kMostShared),
        bodies_(cpu.scene(), hulls_.view(), q),
        elements_(cpu.scene()),
        pairs_(bodies_.refs()),
        rows_(empty_answer(cpu, q)) {
    const auto K = static_cast<std::uint32_t>(bodies_.plan.size.configurations),
               P = static_cast<std::uint32_t>(bodies_.plan.size.pairs);
    r_.reduce = q.reduce;
    r_.groups = q.reduce == Reduce::kNearest ? static_cast<std::uint32_t>(cpu.scene().bodies().size()) : 1;
    r_.rows = r_.capacity = K * P;
    r_.reply_rows = rows_.size.rows;
    set_up_query(K, P);
    const std::size_t groups = std::size_t{K} * r_.groups, words = r_.rows / 32 + 1;
    keys_.assign(6 * groups, kNoKey);
    unusable_.assign(groups, kNoPair);
    words_.assign(4 * words, 0);
    items_.resize(5 * r_.rows);
    enclosed_.resize(r_.rows);
    answers_.resize(r_.rows);
    std::uint64_t** const keys[] = {&r_.upper, &r_.lower, &r_.winner, &r_.lowest, &r_.seed, &r_.cutoff};
    for (std::size_t i = 0; i < 6; ++i) *keys[i] = keys_.data() + i * groups;
    r_.unusable = unusable_.data();
    std::uint32_t** const bits[] = {&r_.candidate_words, &r_.hit_words, &r_.candidate_ranks, &r_.hit_ranks};
    for (std::size_t i = 0; i < 4; ++i) *bits[i] = words_.data() + i * words;
    r_.items = items_.data();
    r_.chunk.rest = items_.data() + r_.rows;
    r_.rest_rows = items_.data() + 2 * r_.rows;
    r_.later = items_.data() + 3 * r_.rows;
    r_.unresolved = items_.data() + 4 * r_.rows;
    r_.chunk.enclosed = enclosed_.data();
    r_.answers = answers_.data();
    r_.elements = elements_.view();
    const std::size_t n = cpu.scene().bodies().size();
    for_each_thread(r_.elements.count, [&] {
      box_elements(r_.elements, bodies_.view, bodies_.fixed.data() + kPoseComponents * n, bodies_.fixed_box.data());
    });
    if (r_.elements.count > 0)
      for_each_thread(std::size_t{K} * bodies_.view.moved_count,
                      [&] { box_moved_elements(r_.elements, bodies_.view, K); });
  }
  HostReduction(const HostReduction&) = delete;

  bool proves_at_once = false;  ///< overlaps of candidates, as for short lists

  /// Expects the rows of the CPU.
  /// \returns number of pairs left to the CPU
  std::uint32_t compare(const std::string& what) {
    return compare(what, [&] { q_.reduce == Reduce::kWithin ? mark() : seed(); });
  }
  /// \param list selects the candidates
  template <class List>
  std::uint32_t compare(const std::string& what, const List& list) {
    const bool within = q_.reduce == Reduce::kWithin;
    const std::uint32_t left = evaluate_pairs(list);
    answer_on_cpu();
    write();
    rows_.info.rows = within ? std::min<std::uint64_t>(host_counts_[kHits], rows_.size.rows) : rows_.size.rows;
    rows_.info.total = within ? host_counts_[kHits] : rows_.size.rows;
    Answer expected = evaluate(cpu_, q_);
    expect_same(rows_, expected, what, true);
    return left;
  }
  /// The same without a CPU: the device answers the unresolved pairs. Expects the CPU's rows, or others with valid
  /// bounds.
  /// \returns number of unresolved pairs
  std::uint32_t compare_alone(const std::string& what) {
    const std::uint32_t left = evaluate_pairs([&] { seed(); });
    launch(500, kItemThreads, [&] { any() ? answer_open_items<true>(r_, 5) : answer_open_items<false>(r_, 5); });
    write();
    rows_.info.rows = rows_.info.total = rows_.size.rows;
    const Answer expected = evaluate(cpu_, q_);
    for (std::uint64_t row = 0; row < rows_.size.rows; ++row) compare_row(expected.view, row, what);
    return left;
  }
  /// Answers the query; the CPU finishes it.
  /// \returns number of pairs left to the CPU
  std::uint32_t answer() {
    const bool within = q_.reduce == Reduce::kWithin;
    const std::uint32_t left = evaluate_pairs([&] { within ? mark() : seed(); });
    answer_on_cpu();
    write();
    rows_.info.rows = within ? std::min<std::uint64_t>(host_counts_[kHits], rows_.size.rows) : rows_.size.rows;
    rows_.info.total = within ? host_counts_[kHits] : rows_.size.rows;
    return left;
  }
  /// Rows, among all rows, of the pairs left to the CPU.
  std::vector<std::uint32_t> left_rows() const { return {r_.rest_rows, r_.rest_rows + counts_[kRest]}; }
  /// The same, but expects intervals that contain the CPU's distances and may differ from its intervals.
  std::uint32_t compare_bounds(const std::string& what) {
    const std::uint32_t left = answer();
    const Answer expected = evaluate(cpu_, q_);
    EXPECT_EQ(rows_.info.rows, expected.info.rows) << what;
    for (std::uint64_t row = 0; row < std::min(rows_.info.rows, expected.info.rows); ++row)
      compare_row(expected.view, row, what);
    return left;
  }
  std::uint64_t others() const { return others_; }  ///< rows of compare_alone() that differ from the CPU's
  std::uint32_t counted(std::uint32_t which) const { return counts_[which]; }  ///< an index such as kRest
  const ReplyView& rows() const { return rows_.view; }
  std::uint64_t row_count() const { return rows_.info.rows; }

 protected:
  template <class Kernel>
  static void launch(std::size_t threads, std::uint32_t block, const Kernel& kernel) {
    EmulatedGrid::one().launch(static_cast<unsigned>(threads / block + 1), block, kernel);
  }

  const engine::Engine& cpu_;
  const QueryView& q_;
  HullArrays hulls_;
  HostBodies bodies_;
  HostElements elements_;
  std::uint32_t counts_[kCounts] = {}, host_counts_[kCounts] = {};
  ReducedView r_{};

 private:
  void set_up_query(std::uint32_t K, std::uint32_t P) {
    ChunkView& c = r_.chunk;
    c.hulls = hulls_.view();
    c.bodies = bodies_.view;
    const bool points = (q_.fields & (kFieldPoints | kFieldPoints32 | kFieldFlags)) != 0;
    c.pair_limits = {q_.max_distance, q_.abs_tol, default_rel_tol(q_.precision), 256, true, points, points, true,
                     false,           false};
    c.pairs = pairs_.data();
    c.pair_count = P;
    c.configurations = K;
    c.reply = rows_.view;
    c.counts = counts_;
    c.host_counts = host_counts_;
  }
  std::size_t groups() const { return unusable_.size(); }
  bool any() const { return q_.reduce == Reduce::kAny; }

  template <class List>
  std::uint32_t evaluate_pairs(const List& list) {
    if (any()) {
      look();
    } else {
      list();
      bodies_.uncertain ? solve<Slack>() : solve<NoSlack>();
    }
    return counts_[kRest];
  }
  void compare_row(const ReplyView& cpu, std::uint64_t row, const std::string& what) {
    const ReplyView& got = rows_.view;
    const auto mine = static_cast<Status>(got.status[row]), theirs = static_cast<Status>(cpu.status[row]);
    others_ +=
        mine != theirs || !same_bits(got.lower[row], cpu.lower[row]) || !same_bits(got.upper[row], cpu.upper[row]);
    const auto is_hit = [](Status s) { return s == Status::kOk || s == Status::kOverlap || s == Status::kContact; };
    if (!any()) {
      EXPECT_TRUE(std::isnan(cpu.distance[row]) ||
                  (got.lower[row] <= cpu.upper[row] && cpu.lower[row] <= got.upper[row]))
          << what << ", row " << row << ": [" << got.lower[row] << ", " << got.upper[row] << "] and [" << cpu.lower[row]
          << ", " << cpu.upper[row] << "]";
    } else {  // proofs must not contradict each other
      EXPECT_FALSE(mine == Status::kBeyond && theirs != Status::kBeyond) << what << ", row " << row;
      EXPECT_FALSE(theirs == Status::kBeyond && is_hit(mine)) << what << ", row " << row;
    }
    EXPECT_EQ(std::isnan(got.distance[row]), std::isnan(cpu.distance[row])) << what << ", row " << row;
  }

  void look() {
    const Plan& plan = bodies_.plan;
    r_.margins = plan.margins.each().empty() ? nullptr : plan.margins.each().data();
    r_.margin = plan.margins.most();
    r_.beyond = beyond_all_margins(plan);
    launch(r_.rows, kScanThreads, [&] { find_near_pairs(r_); });
    const bool uncertain = bodies_.uncertain;
    launch(r_.rows / 4, kItemThreads,
           [&] { uncertain ? evaluate_near_hulls<Slack>(r_) : evaluate_near_hulls<NoSlack>(r_); });
    launch(r_.rows / 4, kItemThreads, [&] { prove_items<true>(r_, 5); });
    launch(r_.rows / 4, kItemThreads,
           [&] { uncertain ? evaluate_near_pairs<Slack>(r_) : evaluate_near_pairs<NoSlack>(r_); });
    evaluate_elements_of<true>();
    launch(r_.rows / 4, kItemThreads, [&] { list_open_pairs(r_); });
  }

  void seed() {
    launch(r_.rows / 2, kScanThreads, [&] { find_seeds(r_); });
    launch(groups(), kItemThreads, [&] { solve_seeds(r_); });
    if (r_.elements.count > 0) {
      launch(groups(), kItemThreads, [&] { seed_elements<ElementsAndHull<Points>>(r_); });
      launch(groups(), kItemThreads, [&] { seed_elements<ElementsAndHull<Triangles>>(r_); });
      launch(groups(), kItemThreads, [&] { seed_elements<Meshes>(r_); });
    }
    launch(r_.rows, kScanThreads, [&] { find_candidates(r_); });
  }
  void mark() {
    launch(r_.rows, kScanThreads, [&] { mark_candidates(r_); });
    rank(r_.candidate_words, r_.candidate_ranks, (r_.rows + 31) / 32);
    launch((r_.rows + 31) / 32, kScanThreads, [&] { list_candidates(r_); });
  }
  static void rank(const std::uint32_t* words, std::uint32_t* ranks, std::uint32_t count) {
    for (std::uint32_t i = 0, sum = 0; i < count; sum += std::popcount(words[i++])) ranks[i] = sum;
  }
  template <class S>
  void solve() {
    if (proves_at_once) {
      launch(r_.rows / 4, kItemThreads, [&] { solve_candidates<S, true>(r_); });
    } else {
      launch(r_.rows / 4, kItemThreads, [&] { solve_candidates<S, false>(r_); });
      launch(r_.rows / 4, kItemThreads, [&] { prove_items<false>(r_, 5); });
    }
    launch(r_.rows / 4, kItemThreads, [&] { solve_several(r_); });
    evaluate_elements_of<false>();
  }
  template <bool kAny>
  void evaluate_elements_of() {
    if (r_.elements.count == 0) return;
    launch(100, kElementThreads, [&] { evaluate_elements<kAny, ElementsAndHull<Points>>(r_); });
    launch(100, kElementThreads, [&] { evaluate_elements<kAny, ElementsAndHull<Triangles>>(r_); });
    launch(100, kElementThreads, [&] { evaluate_elements<kAny, Meshes>(r_); });
  }
  // Lets the CPU answer unresolved pairs.
  void answer_on_cpu() {
    const Plan& plan = bodies_.plan;
    EvaluateOptions options;
    options.limits.max_distance = q_.max_distance;
    options.limits.abs_tol = q_.abs_tol;
    options.limits.rel_tol = plan.query.rel_tol;
    options.cull = options.want_flags = options.want_points = true;
    options.drops_beyond = q_.reduce == Reduce::kWithin;
    options.lanes = &lane_kernel("baseline");
    Evaluator evaluator(cpu_.scene(), options);
    ConfigurationPoses poses(plan);
    BodyPoses placement(cpu_.scene(), plan, {});
    std::vector<Mat3d> rotations(plan.bodies.size());
    std::vector<PairAnswer> answers(counts_[kRest]);
    for (std::uint32_t i = 0; i < answers.size(); ++i) {
      const std::uint32_t k = r_.rest_rows[i] / r_.chunk.pair_count;
      const ConfigurationPoses::PoseBlock given = poses.at(k, 1);
      rotations_of(given.poses, rotations);
      placement.configure(k, given, rotations);
      const std::uint64_t p = r_.rest_rows[i] % r_.chunk.pair_count;
      PlacedBodies requested{plan.pairs.at(p), &placement, q_.max_distance};
      if (any()) requested.max_distance = requested.stop_below = plan.margins.of(p);
      evaluator.run({&requested, 1}, {&answers[i], 1});
    }
    launch(answers.size() + 1, kItemThreads,
           [&] { (any() ? take_open_answers : take_answers)(r_, answers.data(), counts_[kRest]); });
  }
  void write() {
    if (any()) return launch(groups(), kItemThreads, [&] { write_decisions(r_); });
    if (q_.reduce == Reduce::kWithin) {
      if (r_.hit_ranks) rank(r_.hit_words, r_.hit_ranks, hit_word_count(r_));
      launch(r_.rows, kItemThreads, [&] { write_hits(r_); });
      return;
    }
    launch(r_.rows / 3, kItemThreads, [&] { choose_winners(r_); });
    launch(groups(), kItemThreads, [&] { write_groups(r_); });
  }

  std::vector<PairRef> pairs_;
  Answer rows_;
  std::vector<std::uint64_t> keys_;
  std::vector<std::uint32_t> unusable_;
  std::vector<std::uint32_t> words_, items_;
  std::vector<PairAnswer> answers_;
  std::vector<Enclosed> enclosed_;
  std::uint64_t others_ = 0;
};

}  // namespace clearance::test
