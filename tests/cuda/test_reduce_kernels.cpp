// The kernels of reductions (engine/cuda/reduce_kernel.cuh, any_kernel.cuh), without a GPU: their code compiled for the
// host, stage after stage, rows held against the CPU's, bit by bit.
#include "doubted_scene.h"
#include "engine/narrow/lanes.h"
#include "engine/query/evaluate.h"
#include "engine/query/reduction.h"
// Behind all that is included elsewhere.
#include "emulated_scene.h"

#define cuda emulated
#include "engine/cuda/any_kernel.cuh"
#include "engine/cuda/open_items.cuh"
#undef cuda

namespace clearance::test {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr std::uint64_t kNoKey = ~std::uint64_t{0};

// A reduced query in host memory: one chunk.
class HostReduction {
 public:
  HostReduction(const Engine& cpu, const QueryView& q)
      : cpu_(cpu),
        q_(q),
        hulls_(cpu.scene(), kMostShared),
        bodies_(cpu.scene(), hulls_.view(), q),
        pairs_(bodies_.refs()),
        rows_(room_for(cpu, q)) {
    const auto K = static_cast<std::uint32_t>(bodies_.plan.size.configurations),
               P = static_cast<std::uint32_t>(pairs_.size());
    r_.reduce = q.reduce;
    r_.groups = q.reduce == Reduce::kNearest ? static_cast<std::uint32_t>(cpu.scene().bodies().size()) : 1;
    r_.rows = r_.capacity = K * P;
    r_.reply_rows = rows_.size.rows;
    ask_question(K, P);
    const std::size_t groups = std::size_t{K} * r_.groups, words = r_.rows / 32 + 1;
    keys_.assign(6 * groups, kNoKey);
    complete_.assign(groups, 1);
    words_.assign(4 * words, 0);
    items_.resize(4 * r_.rows);
    answers_.resize(r_.rows);
    std::uint64_t** const keys[] = {&r_.upper, &r_.lower, &r_.winner, &r_.lowest, &r_.seed, &r_.cutoff};
    for (std::size_t i = 0; i < 6; ++i) *keys[i] = keys_.data() + i * groups;
    r_.complete = complete_.data();
    std::uint32_t** const bits[] = {&r_.candidate_words, &r_.hit_words, &r_.candidate_ranks, &r_.hit_ranks};
    for (std::size_t i = 0; i < 4; ++i) *bits[i] = words_.data() + i * words;
    r_.items = items_.data();
    r_.chunk.rest = items_.data() + r_.rows;
    r_.rest_rows = items_.data() + 2 * r_.rows;
    r_.several = items_.data() + 3 * r_.rows;
    r_.answers = answers_.data();
  }
  HostReduction(const HostReduction&) = delete;

  /// Expects the rows of the CPU. \returns how many pairs were left to it
  std::uint32_t compare(const std::string& what) {
    const bool within = q_.reduce == Reduce::kWithin;
    const std::uint32_t left = look_at_pairs();
    settle();
    write();
    rows_.info.rows = within ? std::min<std::uint64_t>(host_counts_[kHits], rows_.size.rows) : rows_.size.rows;
    rows_.info.total = within ? host_counts_[kHits] : rows_.size.rows;
    Answer expected = ask(cpu_, q_);
    expect_same(rows_, expected, what, true);
    return left;
  }
  /// The same where no CPU answers what is left: the device does. Expects the CPU's rows, or others that are sound.
  /// \returns how many pairs were left
  std::uint32_t compare_alone(const std::string& what) {
    const std::uint32_t left = look_at_pairs();
    launch(500, kItemThreads, [&] { any() ? answer_open_items<true>(r_, 5) : answer_open_items<false>(r_, 5); });
    write();
    rows_.info.rows = rows_.info.total = rows_.size.rows;
    const Answer expected = ask(cpu_, q_);
    for (std::uint64_t row = 0; row < rows_.size.rows; ++row) compare_row(expected.view, row, what);
    return left;
  }
  std::uint64_t others() const { return others_; }  ///< rows of compare_alone() that are not the CPU's
  const ReplyView& rows() const { return rows_.view; }
  std::uint64_t row_count() const { return rows_.info.rows; }

 private:
  void ask_question(std::uint32_t K, std::uint32_t P) {
    ChunkView& c = r_.chunk;
    c.hulls = hulls_.view();
    c.bodies = bodies_.view;
    c.question = {q_.max_distance, q_.abs_tol, default_rel_tol(q_.precision), 256, true, true, true, true,
                  false,           false};
    c.pairs = pairs_.data();
    c.pair_count = P;
    c.configurations = K;
    c.reply = rows_.view;
    c.counts = counts_;
    c.host_counts = host_counts_;
  }
  template <class Kernel>
  static void launch(std::size_t threads, std::uint32_t block, const Kernel& kernel) {
    EmulatedGrid::one().launch(static_cast<unsigned>(threads / block + 1), block, kernel);
  }
  std::size_t groups() const { return complete_.size(); }
  bool any() const { return q_.reduce == Reduce::kAny; }

  std::uint32_t look_at_pairs() {
    if (any()) {
      look();
    } else {
      q_.reduce == Reduce::kWithin ? mark() : seed();
      bodies_.doubted ? solve<Slack>() : solve<NoSlack>();
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
    } else {  // what one has proved the other does not deny
      EXPECT_FALSE(mine == Status::kBeyond && theirs != Status::kBeyond) << what << ", row " << row;
      EXPECT_FALSE(theirs == Status::kBeyond && is_hit(mine)) << what << ", row " << row;
    }
    EXPECT_EQ(std::isnan(got.distance[row]), std::isnan(cpu.distance[row])) << what << ", row " << row;
  }

  void look() {
    const Plan& plan = bodies_.plan;
    r_.margins = plan.margins.each().empty() ? nullptr : plan.margins.each().data();
    r_.margin = plan.margins.most();
    r_.beyond = beyond_all_margins(plan, {});
    launch(r_.rows, kScanThreads, [&] { find_near_pairs(r_); });
    launch(r_.rows / 4, kItemThreads,
           [&] { bodies_.doubted ? look_at_near_pairs<Slack>(r_) : look_at_near_pairs<NoSlack>(r_); });
    launch(r_.rows / 4, kItemThreads, [&] { list_open_pairs(r_); });
  }

  void seed() {
    launch(r_.rows / 2, kScanThreads, [&] { find_seeds(r_); });
    launch(groups(), kItemThreads, [&] { solve_seeds(r_); });
    launch(r_.rows, kScanThreads, [&] { find_candidates(r_); });
  }
  void mark() {
    launch(r_.rows, kScanThreads, [&] { mark_candidates(r_); });
    rank(r_.candidate_words, r_.candidate_ranks);
    launch((r_.rows + 31) / 32, kScanThreads, [&] { list_candidates(r_); });
  }
  void rank(const std::uint32_t* words, std::uint32_t* ranks) const {
    for (std::uint32_t i = 0, sum = 0; i < (r_.rows + 31) / 32; sum += std::popcount(words[i++])) ranks[i] = sum;
  }
  template <class S>
  void solve() {
    launch(r_.rows / 4, kItemThreads, [&] { solve_candidates<false, S>(r_); });
    launch(r_.rows / 4, kItemThreads, [&] { solve_several(r_); });
  }
  // The CPU's answers to what is left.
  void settle() {
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
    Placement placement(cpu_.scene(), plan, {});
    std::vector<Mat3d> rotations(plan.bodies.size());
    std::vector<PairAnswer> answers(counts_[kRest]);
    for (std::uint32_t i = 0; i < answers.size(); ++i) {
      const std::uint32_t k = r_.rest_rows[i] / r_.chunk.pair_count;
      const ConfigurationPoses::Block given = poses.at(k, 1);
      rotations_of(given.poses, rotations);
      placement.configure(k, given, rotations);
      const std::uint64_t p = r_.rest_rows[i] % r_.chunk.pair_count;
      PlacedBodies asked{plan.pairs.at(p), &placement, q_.max_distance};
      if (any()) asked.max_distance = asked.enough = plan.margins.of(p);
      evaluator.run({&asked, 1}, {&answers[i], 1});
    }
    launch(answers.size() + 1, kItemThreads,
           [&] { (any() ? take_open_answers : take_answers)(r_, answers.data(), counts_[kRest]); });
  }
  void write() {
    if (any()) return launch(groups(), kItemThreads, [&] { write_decisions(r_); });
    if (q_.reduce == Reduce::kWithin) {
      rank(r_.hit_words, r_.hit_ranks);
      launch(r_.rows, kItemThreads, [&] { write_hits(r_); });
      return;
    }
    launch(r_.rows / 3, kItemThreads, [&] { choose_winners(r_); });
    launch(groups(), kItemThreads, [&] { write_groups(r_); });
  }

  const Engine& cpu_;
  const QueryView& q_;
  HullArrays hulls_;
  HostBodies bodies_;
  std::vector<PairRef> pairs_;
  Answer rows_;
  std::vector<std::uint64_t> keys_;
  std::vector<std::uint8_t> complete_;
  std::vector<std::uint32_t> words_, items_;
  std::vector<PairAnswer> answers_;
  std::uint64_t others_ = 0;
  std::uint32_t counts_[kCounts] = {}, host_counts_[kCounts] = {};
  ReducedView r_{};
};

TEST(ReduceKernels, GiveTheBitsOfTheCpu) {
  for (const double room : {1.0, 2.5, 8.0}) {
    EmulatedCase c(20, 13, room, 3, [](Scene& to, const std::string& name, const Scene::BodyOptions& options) {
      to.add_capsule(name, 0.2, 0.5, options);
    });
    c.poses[4].translation.x = std::numeric_limits<double>::quiet_NaN();
    const Engine cpu(std::move(c.scene), {"cpu"});
    c.q.fields = kAllFields | kFieldPairLower;
    for (const Reduce reduce : {Reduce::kNearest, Reduce::kMin, Reduce::kWithin})
      for (const double distance : {kInf, 0.3}) {
        c.q.reduce = reduce;
        c.q.max_distance = distance;
        HostReduction(cpu, c.q).compare("reduce " + std::to_string(static_cast<int>(reduce)) + " room " +
                                        std::to_string(room) + " within " + std::to_string(distance));
      }
  }
}

TEST(ReduceKernels, GiveTheBitsOfTheCpuForWhatIsDoubted) {
  std::uint64_t slack = 0, others = 0, left = 0;
  for (const Precision precision : {Precision::kF64, Precision::kF32}) {
    DoubtedCase c(30, 9);
    c.poses[8].qw = c.poses[8].qx = c.poses[8].qy = c.poses[8].qz = 0;
    const Engine cpu(std::move(c.scene), {"cpu"});
    c.q.precision = precision;
    for (const Reduce reduce : {Reduce::kNearest, Reduce::kMin, Reduce::kWithin})
      for (const double distance : {kInf, 0.02, 0.3}) {
        c.q.reduce = reduce;
        c.q.max_distance = distance;
        HostReduction reduction(cpu, c.q);
        left += reduction.compare("reduce " + std::to_string(static_cast<int>(reduce)) + " within " +
                                  std::to_string(distance));
        for (std::uint64_t i = 0; i < reduction.row_count(); ++i) {
          slack += (reduction.rows().flags[i] & kFlagSlack) != 0;
          others += reduction.rows().pair[i] != reduction.rows().pair_lower[i];
        }
      }
  }
  EXPECT_GT(slack, 500u);
  EXPECT_GT(others, 10u) << "the least lower bound is another pair's";
  EXPECT_GT(left, 20u) << "the CPU finishes some";
}

// What rows of Reduce::kAny say.
struct Verdicts {
  std::uint64_t near = 0, overlap = 0, touching = 0, open = 0, beyond = 0, unusable = 0, incomplete = 0, left = 0;

  void add(const HostReduction& reduction) {
    for (std::uint64_t i = 0; i < reduction.row_count(); ++i) {
      const auto status = static_cast<Status>(reduction.rows().status[i]);
      near += status == Status::kOk;
      overlap += status == Status::kOverlap;
      touching += status == Status::kContact;
      open += status == Status::kUnconverged;
      beyond += status == Status::kBeyond;
      unusable += status == Status::kBadPose;
      incomplete += (reduction.rows().flags[i] & kFlagIncomplete) != 0;
    }
  }
};

// Asks with one margin for all pairs, and with one of its own for each.
void compare_margins(const Engine& cpu, QueryView q, const std::string& what, Verdicts& verdicts) {
  const auto compare = [&](const std::string& with) {
    HostReduction reduction(cpu, q);
    verdicts.left += reduction.compare(what + with);
    verdicts.add(reduction);
  };
  q.reduce = Reduce::kAny;
  for (const double margin : {0.0, 1e-6, 0.02, 0.3}) {
    q.margin = margin;
    compare(", margin " + std::to_string(margin));
  }
  Random random(4);
  std::vector<double> margins(q.pairs.size());
  for (const double most : {0.03, 0.5}) {
    for (double& margin : margins) margin = random.uniform(0, most);
    q.pair_margins = margins;
    compare(", margins up to " + std::to_string(most));
  }
}

TEST(ReduceKernels, DecideAsTheCpuDoes) {
  for (const Precision precision : {Precision::kF64, Precision::kF32}) {
    Verdicts verdicts;
    for (const double room : {1.0, 4.0, 12.0}) {
      EmulatedCase c(20, 29, room, 3, [](Scene& to, const std::string& name, const Scene::BodyOptions& options) {
        to.add_capsule(name, 0.2, 0.5, options);
      });
      c.q.fields = kAllFields | kFieldPairLower;
      c.q.precision = precision;
      c.poses[4].translation.x = std::numeric_limits<double>::quiet_NaN();
      for (std::size_t i = 0; i < c.bodies.size(); ++i) c.poses[5 * c.bodies.size() + i].qw = kInf;
      const Engine cpu(std::move(c.scene), {"cpu"});
      compare_margins(cpu, c.q, "room " + std::to_string(room), verdicts);
    }
    EXPECT_GT(verdicts.near, 20u);
    EXPECT_GT(verdicts.overlap, 100u);
    EXPECT_GT(verdicts.beyond, 50u);
    EXPECT_GT(verdicts.unusable, 5u);
    EXPECT_GT(verdicts.incomplete, verdicts.unusable) << "some are decided all the same";
    EXPECT_GT(verdicts.left, 20u) << "capsules that overlap by less than their radii";
  }
}

TEST(ReduceKernels, DecideAsTheCpuDoesWhatIsDoubted) {
  for (const Precision precision : {Precision::kF64, Precision::kF32}) {
    DoubtedCase c(30, 9);
    c.q.precision = precision;
    c.poses[8].qw = c.poses[8].qx = c.poses[8].qy = c.poses[8].qz = 0;
    c.positions[c.joints.size() * 3] = std::numeric_limits<double>::quiet_NaN();
    // Few of the pairs, else all overlap: those of each with the next that it has.
    const std::vector<BodyPair> all = c.pairs;
    const Engine cpu(std::move(c.scene), {"cpu"});
    Verdicts verdicts;
    for (std::size_t first = 0; first < 12; ++first) {
      std::vector<BodyPair> some;
      for (std::size_t i = first; i < all.size(); i += 12) some.push_back(all[i]);
      c.q.pairs = some;
      compare_margins(cpu, c.q, "pairs from " + std::to_string(first), verdicts);
    }
    EXPECT_GT(verdicts.near, 100u);
    EXPECT_GT(verdicts.overlap, 100u);
    EXPECT_GT(verdicts.touching, 20u);
    EXPECT_GT(verdicts.open, 5u) << "slack keeps them from being known";
    EXPECT_GT(verdicts.beyond, 20u);
    EXPECT_GT(verdicts.incomplete, 5u);
  }
}

// Plans have no CPU behind them.
TEST(ReduceKernels, AnswerWhatIsLeftAsWellAsTheyCan) {
  std::uint64_t left = 0, others = 0, rows = 0, unproved = 0;
  const auto run = [&](const Engine& cpu, const QueryView& q, const std::string& what) {
    HostReduction reduction(cpu, q);
    left += reduction.compare_alone(what);
    others += reduction.others();
    rows += reduction.row_count();
    for (std::uint64_t i = 0; i < reduction.row_count(); ++i)
      unproved += static_cast<Status>(reduction.rows().status[i]) == Status::kUnconverged;
  };
  for (const Reduce reduce : {Reduce::kMin, Reduce::kAny}) {
    const std::string what = "reduce " + std::to_string(static_cast<int>(reduce));
    for (const double room : {1.0, 4.0, 12.0}) {
      EmulatedCase c(20, 29, room, 3, [](Scene& to, const std::string& name, const Scene::BodyOptions& options) {
        to.add_capsule(name, 0.2, 0.5, options);
      });
      // Configuration 2: every body exactly on another, where nothing can be settled.
      for (std::size_t i = 0; i < c.bodies.size(); ++i) c.poses[2 * c.bodies.size() + i] = Pose{{1.0 * (i % 4), 0, 0}};
      c.q.reduce = reduce;
      const Engine cpu(std::move(c.scene), {"cpu"});
      run(cpu, c.q, what + ", room " + std::to_string(room));
    }
    DoubtedCase c(30, 9);
    c.positions[c.joints.size() * 3] = std::numeric_limits<double>::quiet_NaN();
    const std::vector<BodyPair> all = c.pairs;
    const Engine cpu(std::move(c.scene), {"cpu"});
    c.q.reduce = reduce;
    for (std::size_t first = 0; first < 12; ++first) {
      std::vector<BodyPair> some;
      for (std::size_t i = first; i < all.size(); i += 12) some.push_back(all[i]);
      c.q.pairs = some;
      run(cpu, c.q, what + ", doubted, from " + std::to_string(first));
    }
  }
  EXPECT_GT(left, 100u);
  EXPECT_GT(others, 0u);
  EXPECT_LT(others, rows / 4) << "most are the CPU's all the same";
  EXPECT_GT(unproved, 5u);
}

// The pair whose boxes are nearest says less of how near the true bodies are than its pieces do: another wins.
TEST(ReduceKernels, LeaveOutNothingThatSlackMayLetWin) {
  Scene scene;
  Body rough;
  rough.name = "rough";
  rough.is_static = true;
  rough.pose = Pose();
  rough.pieces = {make_piece({{0.5, 0.5, 0.5},
                              {-0.5, 0.5, 0.5},
                              {0.5, -0.5, 0.5},
                              {-0.5, -0.5, 0.5},
                              {0.5, 0.5, -0.5},
                              {-0.5, 0.5, -0.5},
                              {0.5, -0.5, -0.5},
                              {-0.5, -0.5, -0.5}})};
  rough.model_error = 0.01;
  scene.add_body(std::move(rough));
  scene.add_sphere("at its corner", 0.1, {});
  scene.add_box("known", {1, 1, 1}, {.is_static = true, .pose = Pose{{50, 0, 0}}});
  scene.add_sphere("at its face", 0.1, {});
  const double far = 0.3 * std::sqrt(3.0) - 0.1;  // of the first ball; its box is nearer
  const std::vector<std::uint32_t> bodies{1, 3};
  const std::vector<BodyPair> pairs{{0, 1}, {2, 3}};
  const std::vector<Pose> poses{{{0.8, 0.8, 0.8}}, {{50 + 0.5 + 0.1 + far + 0.005, 0, 0}}};
  const Engine cpu(std::move(scene), {"cpu"});
  QueryView q;
  q.all_pairs = false;
  q.pairs = pairs;
  q.bodies = bodies;
  q.configurations = poses;
  q.configuration_count = 1;
  q.reduce = Reduce::kMin;
  q.fields = kAllFields | kFieldPairLower;
  HostReduction reduction(cpu, q);
  EXPECT_EQ(reduction.compare("a rough box"), 0u);
  EXPECT_EQ(reduction.rows().pair[0], pairs[1]) << "5 mm farther, and 5 mm nearer at most";
  EXPECT_EQ(reduction.rows().pair_lower[0], pairs[0]);
}

}  // namespace
}  // namespace clearance::test
