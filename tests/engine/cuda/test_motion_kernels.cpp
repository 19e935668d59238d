// The kernels that decide motions (engine/cuda/motion/motion_kernel.cuh), emulated on the host: compared with the CPU's
// results and with 60-digit arithmetic. No GPU needed.
#include <gtest/gtest.h>

#include <cstdio>
#include <filesystem>

#include "engine/motion/motion_search.h"
#include "tests/engine/cuda/arm_edges.h"
#include "tests/engine/cuda/motion_comparison.h"
#include "tests/engine/device/fake_device.h"
#include "tests/engine/motion/motion_oracle.h"
#include "tests/engine/motion/motion_test.h"
// After all other headers.
#include "tests/engine/cuda/emulated_motions.h"

namespace clearance::test {
namespace {

// Answer for a single pair at one time of a motion.
Answer request_at(const engine::Engine& engine, const ArmEdges& edges, std::uint32_t motion, double time,
                  const BodyPair& pair) {
  const Samples there(edges.motions, motion, time);
  const std::vector<BodyPair> pairs{pair};
  QueryView single;
  single.all_pairs = false;
  single.pairs = pairs;
  single.joints = edges.motions.joints;
  single.positions = there.positions;
  single.configuration_count = 1;
  single.fields = kDefaultFields;
  return evaluate(engine, single);
}

void print_levels(const HostMotions& host) {
  for (std::uint32_t level = 0; level < host.levels(); ++level)
    std::printf(" %u/%u/%u", host.count(kSpanCount, level), host.count(kNearCount, level),
                host.count(kEvaluateCount, level));
  std::printf("\n");
}

struct Found {
  int free = 0, hits = 0, open = 0, undecided = 0;
};

// Results never contradict the CPU's, and hits are confirmed.
Found compare(const ArmEdges& edges, const QueryView& q, HostMotions& host) {
  const engine::Engine cpu(engine::Scene(edges.scene),
                           {.backend = "cpu", .threads = 2, .covers = engine::Covers::kOff});
  const Answer wanted = evaluate(cpu, q);
  host.run();
  Found found;
  for (std::uint32_t i = 0; i < edges.motions.count(); ++i) {
    const auto status = static_cast<Status>(wanted.view.status[i]);
    const bool is_free = status == Status::kBeyond, is_undecided = status == Status::kUnconverged;
    found.undecided += is_undecided;
    switch (host.outcome(i)) {
      case MotionOutcome::kOpen:
        ++found.open;
        break;
      case MotionOutcome::kFree:
        ++found.free;
        EXPECT_TRUE(is_free || is_undecided) << i;
        break;
      case MotionOutcome::kHit: {
        ++found.hits;
        EXPECT_FALSE(is_free) << i;
        const MotionHitRow* const hit = host.hit(i);
        EXPECT_TRUE(hit);
        if (!hit) break;
        EXPECT_LE(hit->answer.upper, q.margin) << i;
        if (q.fields & kFieldFirstContact) {
          const double contact[]{host.free_until(i), hit->time};
          EXPECT_LE(contact[1] - contact[0], kContactTime) << i;
          expect_same_contact(contact, wanted.view.first_contact + 2 * i, i);
        }
        // The same pair on the CPU at that time.
        const Answer at = request_at(cpu, edges, i, hit->time, host.plan().pairs.at(hit->pair));
        EXPECT_LE(at.view.lower[0], hit->answer.upper + 1e-9) << i;
        EXPECT_GE(at.view.upper[0], hit->answer.lower - 1e-9) << i;
        break;
      }
    }
  }
  return found;
}

TEST(MotionKernels, DecideAnArmsEdgesAsTheCpuDoes) {
  for (const double margin : {0.0, 0.02}) {
    for (const bool when : {false, true}) {
      const ArmEdges edges(3, 120, 0.7);
      const QueryView q = edges.query(margin, when);
      HostMotions host(edges.scene, q);
      ASSERT_TRUE(host.fits());
      const Found found = compare(edges, q, host);
      std::printf("margin %g, first contact %d: %d free, %d hit, %d open; spans", margin, when, found.free, found.hits,
                  found.open);
      print_levels(host);
      EXPECT_GT(found.free, 20);
      EXPECT_GT(found.hits, 20);
      EXPECT_LT(found.open, 10);
    }
  }
}

// The nearest pair of an arm's edges over time: intervals that intersect the CPU's, and confirmed positions of the
// pair.
struct Least {
  int apart = 0, touching = 0, hits = 0, open = 0;
};
Least compare_nearest(const ArmEdges& edges, const QueryView& q, HostMotions& host) {
  const engine::Engine cpu(engine::Scene(edges.scene),
                           {.backend = "cpu", .threads = 2, .covers = engine::Covers::kOff});
  const Answer wanted = evaluate(cpu, q);
  host.run();
  Least found;
  for (std::uint32_t i = 0; i < edges.motions.count(); ++i) {
    EXPECT_NE(host.outcome(i), MotionOutcome::kFree) << i;
    if (host.outcome(i) == MotionOutcome::kOpen) {
      ++found.open;
      continue;
    }
    const MotionHitRow& row = *host.hit(i);
    PairAnswer answer = row.answer;
    decide_least(q, row.low, false, answer);
    EXPECT_LE(answer.lower, answer.upper) << i;
    EXPECT_LE(answer.lower, wanted.view.upper[i]) << i;
    EXPECT_LE(wanted.view.lower[i], answer.upper) << i;
    expect_narrow(answer.lower, answer.upper, answer.flags, q, i);
    EXPECT_NE(answer.status, Status::kUnconverged) << i;
    ++(answer.status == Status::kOk ? found.apart : found.touching);
    const Answer at = request_at(cpu, edges, i, row.time, host.plan().pairs.at(row.pair));
    EXPECT_LE(at.view.lower[0], row.answer.upper + 1e-9) << i;
    EXPECT_GE(at.view.upper[0], row.answer.upper - q.abs_tol) << i;
    if (!(q.fields & kFieldFirstContact)) continue;
    found.hits += row.contact < kInf;
    const double contact[]{host.free_until(i), row.contact};
    expect_same_contact(contact, wanted.view.first_contact + 2 * i, i);
    if (row.contact < kInf) {
      EXPECT_LE(contact[1] - contact[0], kContactTime) << i;
    }
    EXPECT_EQ(row.contact < kInf, contact[0] < kInf) << i;
    if (answer.lower > q.margin) {
      EXPECT_EQ(contact[0], kInf) << i;
    }
  }
  return found;
}

TEST(MotionKernels, FindAnArmsLeastDistancesAsTheCpuDoes) {
  for (const double margin : {0.0, 0.02}) {
    for (const bool when : {false, true}) {
      const ArmEdges edges(17, 120, 0.7);
      const QueryView q = edges.least(margin, when);
      HostMotions host(edges.scene, q);
      ASSERT_TRUE(host.fits());
      const Least found = compare_nearest(edges, q, host);
      std::printf("margin %g, first contact %d: %d apart, %d touch, %d hit, %d open; spans", margin, when, found.apart,
                  found.touching, found.hits, found.open);
      print_levels(host);
      EXPECT_GT(found.apart, 20);
      EXPECT_GT(found.touching, 20);
      if (when) {
        EXPECT_GT(found.hits, 20);
      }
      EXPECT_LT(found.open, 12);
    }
  }
}

TEST(MotionKernels, LeaveLeastDistancesToTheCpuWhereListsAreFull) {
  const ArmEdges edges(5, 60, 1.5);
  const QueryView q = edges.least(0.01, true);
  HostMotions whole(edges.scene, q);
  const Least all = compare_nearest(edges, q, whole);
  const std::uint32_t pairs = std::max(whole.count(kNearCount, 1), whole.count(kOnCount, 1));
  for (const auto& [room, spans] : {std::pair{pairs - 20, 0u}, std::pair{0u, 120u}}) {
    HostMotions host(edges.scene, q, room, spans);
    const Least found = compare_nearest(edges, q, host);
    std::printf("%u pairs, %u spans: %d open in place of %d\n", room, spans, found.open, all.open);
    EXPECT_GE(found.open, all.open);
    EXPECT_GT(found.apart + found.touching, 5);
    if (room) {
      EXPECT_GT(found.open, all.open + 2);
    }
  }
  QueryView hasty = q;
  hasty.max_evaluations = 3;
  HostMotions host(edges.scene, hasty);
  EXPECT_GT(compare_nearest(edges, hasty, host).open, all.open + 2);
}

// Lists that overflow leave motions to the CPU, and the results of the others stay correct.
TEST(MotionKernels, LeaveToTheCpuWhatListsCannotHold) {
  const ArmEdges edges(5, 60, 1.5);
  for (const bool when : {false, true}) {
    const QueryView q = edges.query(0.01, when);
    HostMotions whole(edges.scene, q);
    const Found all = compare(edges, q, whole);
    const std::uint32_t pairs = std::max(whole.count(kNearCount, 0), whole.count(kOnCount, 0));
    std::printf("%u pairs: %d free, %d hit, %d open\n", pairs, all.free, all.hits, all.open);
    struct Capacity {
      const char* what;
      std::uint32_t pairs, spans, hits;
    };
    for (const Capacity& room : {Capacity{"pairs", pairs - (when ? 20 : pairs / 8), 0, 0}, Capacity{"spans", 0, 60, 0},
                                 Capacity{"hits", 0, 0, 5}}) {
      SCOPED_TRACE(room.what);
      HostMotions host(edges.scene, q, room.pairs, room.spans, room.hits);
      const Found found = compare(edges, q, host);
      std::printf("%s: %d free, %d hit, %d open\n", room.what, found.free, found.hits, found.open);
      EXPECT_GT(found.open, all.open + 2);
      EXPECT_GT(found.free + found.hits, 5);
    }
    QueryView hasty = q;
    hasty.max_evaluations = 1;
    HostMotions host(edges.scene, hasty);
    const Found found = compare(edges, hasty, host);
    EXPECT_GT(found.open, all.open + 2);
  }
}

// Pairs apart that do not fit their list are evaluated again, with the same decisions.
TEST(MotionKernels, EvaluatePairsThatTheListOfPairsApartCannotHold) {
  const ArmEdges edges(5, 60, 1.5);
  for (const bool when : {false, true}) {
    const QueryView q = edges.query(0.01, when);
    HostMotions whole(edges.scene, q), small(edges.scene, q);
    small.limit_apart(10);
    const Found all = compare(edges, q, whole), found = compare(edges, q, small);
    EXPECT_GT(small.count(kApartCount, 0), 100);
    EXPECT_GT(small.count(kLaterCount, 0), whole.count(kLaterCount, 0) + 90);
    EXPECT_EQ(found.free, all.free);
    EXPECT_EQ(found.hits, all.hits);
  }
}

// Nearly all pairs of long edges go on in both halves. With capacity for the first level's pairs only, nearly all
// motions would be left to the CPU.
TEST(MotionKernels, HoldEnoughForLongEdges) {
  const ArmEdges edges(11, 600, 1.5);
  for (const double margin : {0.0, 0.02}) {
    const QueryView q = edges.query(margin, true);
    HostMotions host(edges.scene, q);
    const Found found = compare(edges, q, host);
    const auto pairs = static_cast<std::uint32_t>(600 * host.plan().size.pairs);
    EXPECT_GT(host.count(kOnCount, 0), pairs) << "they did not fill a list of all pairs";
    std::printf("margin %g: %d free, %d hit, %d open\n", margin, found.free, found.hits, found.open);
    EXPECT_LT(found.open, 60);
  }
}

// Invalid ends, and bodies without a pose.
TEST(MotionKernels, LeaveStrangeMotionsToTheCpu) {
  ArmEdges edges(6, 6, 0.3);
  const std::size_t J = edges.motions.joints.size();
  edges.motions.positions[0] = std::numeric_limits<double>::quiet_NaN();
  edges.motions.positions[(2 * 2 + 1) * J + 1] = 2e9;
  const QueryView q = edges.query(0, false);
  HostMotions host(edges.scene, q);
  host.run();
  EXPECT_EQ(host.outcome(0), MotionOutcome::kOpen);
  EXPECT_EQ(host.outcome(2), MotionOutcome::kOpen);
  int decided = 0;
  for (const std::uint32_t i : {1u, 3u, 4u, 5u}) decided += host.outcome(i) != MotionOutcome::kOpen;
  EXPECT_GT(decided, 2);
  // A body without a pose, paired with the moving tool.
  edges.scene.add_sphere("lost", 0.1, {});
  edges.motions.pairs.push_back({edges.scene.find_body("tool"), edges.scene.find_body("lost")});
  const QueryView with_lost = edges.query(0, false);
  HostMotions lost(edges.scene, with_lost);
  lost.run();
  for (std::uint32_t i = 0; i < 6; ++i) EXPECT_EQ(lost.outcome(i), MotionOutcome::kOpen) << i;
}

// The kernels' result for a single motion.
MotionDecision decision_of(const engine::Scene& scene, const QueryView& q) {
  HostMotions host(scene, q);
  MotionDecision found;
  if (!host.fits()) return found;
  host.run();
  if (host.outcome(0) == MotionOutcome::kFree) found.kind = MotionDecision::kFree;
  if (host.outcome(0) != MotionOutcome::kHit) return found;
  const MotionHitRow& hit = *host.hit(0);
  if (q.reduce == Reduce::kMin) {
    PairAnswer answer = hit.answer;
    decide_least(q, hit.low, false, answer);
    return {MotionDecision::kHit,
            host.plan().pairs.at(hit.pair),
            hit.time,
            answer.lower,
            answer.upper,
            host.free_until(0),
            hit.contact,
            (answer.flags & kFlagUncertaintyLimited) != 0};
  }
  return {MotionDecision::kHit, host.plan().pairs.at(hit.pair), hit.time, hit.answer.lower, hit.answer.upper,
          host.free_until(0)};
}

class CheckedMotionKernels : public ::testing::TestWithParam<int> {};

TEST_P(CheckedMotionKernels, SayNothingThatIsUntrue) {
  const MotionFindings found = check_decisions(21, 32, GetParam(), [](const engine::Scene& scene) {
    return [&scene](const QueryView& query) { return decision_of(scene, query); };
  });
  std::printf("%s\n", found.text().c_str());
  EXPECT_EQ(found.wrong(), 0) << found.text();
  EXPECT_GE(found.motions, 32);
  EXPECT_GT(found.hits, 2);
  EXPECT_GT(found.free, 2);
  EXPECT_GT(found.least_on_device, 20);
}

INSTANTIATE_TEST_SUITE_P(Kinds, CheckedMotionKernels, ::testing::Range(0, kStraightKinds),
                         [](const auto& kind) { return name_of(static_cast<MotionKind>(kind.param)); });

// A device whose workspace runs the emulated kernels on the engine's chunks.
struct EmulatedWork {
  const engine::Scene* scene = nullptr;
  QueryView q;
  int launches = 0;
};
class EmulatedWorkspace final : public IdleSide<cuda::MotionWorkspace> {
 public:
  EmulatedWorkspace(Fault& fault, EmulatedWork& work) : IdleSide(fault), work_(work) {}
  void launch(int slot, const cuda::ChunkSetup& chunk) override {
    ++work_.launches;
    Slot& at = slots_[slot];
    const std::size_t numbers = 2 * std::size_t{chunk.configurations} * work_.q.joints.size();
    if (chunk.wait_for) chunk.wait_for(cuda::Given::kPositions, chunk.positions + numbers);
    at.positions.assign(chunk.positions, chunk.positions + numbers);
    QueryView q = work_.q;
    q.positions = at.positions;
    q.configuration_count = 2 * chunk.configurations;
    HostMotions host(*work_.scene, q);
    host.run();
    at.outcomes.clear(), at.steps.clear(), at.hits.clear(), at.free_until.clear();
    for (std::uint32_t i = 0; i < chunk.configurations; ++i) {
      at.outcomes.push_back(host.outcome(i));
      at.steps.push_back(host.steps(i));
      if (q.fields & kFieldFirstContact) at.free_until.push_back(host.free_until(i));
      if (at.outcomes[i] == MotionOutcome::kHit) at.hits.push_back(*host.hit(i));
    }
  }
  cuda::MotionResult finish(int slot) override {
    const Slot& at = slots_[slot];
    return {at.outcomes, at.steps, at.free_until, at.hits, 0};
  }

 private:
  struct Slot {
    std::vector<double> positions;
    std::vector<MotionOutcome> outcomes;
    std::vector<std::uint32_t> steps;
    std::vector<double> free_until;
    std::vector<MotionHitRow> hits;
  } slots_[cuda::kChunksUnderWay];
  EmulatedWork& work_;
};
class EmulatedDevice final : public IdleDevice {
 public:
  EmulatedDevice(Fault& fault, EmulatedWork& work) : IdleDevice(fault), its_fault_(fault), work_(work) {}
  std::shared_ptr<cuda::MotionWorkspace> borrow_motions() override {
    return std::make_shared<EmulatedWorkspace>(its_fault_, work_);
  }

 private:
  Fault& its_fault_;
  EmulatedWork& work_;
};

// An engine's answer by emulated kernels.
struct EmulatedAnswer {
  Answer found, wanted;
  std::uint64_t on_cpu = 0;
  int launches = 0;

  EmulatedAnswer(const ArmEdges& edges, const QueryView& q) {
    Fault fault;
    EmulatedWork work{&edges.scene, q};
    const cuda::FakeDevice fake_device({true, "emulated", "", 1}, [&](const engine::Scene&, int, std::uint64_t) {
      return std::make_shared<EmulatedDevice>(fault, work);
    });
    const engine::Engine device(engine::Scene(edges.scene), {.backend = "cuda", .threads = 2}),
        cpu(engine::Scene(edges.scene), {.backend = "cpu", .threads = 2});
    found = evaluate(device, q);
    wanted = evaluate(cpu, q);
    on_cpu = counter(device, "cuda.motions_finished_on_cpu");
    launches = work.launches;
  }
};

// Through the engine: rows decided by kernels, and rows left to the CPU.
TEST(MotionKernels, AnswerAnEnginesMotions) {
  const ArmEdges edges(8, 2500, 0.4);  // three chunks
  for (const double margin : {0.0, 0.01}) {
    for (const bool when : {false, true}) {
      const QueryView q = edges.query(margin, when);
      const EmulatedAnswer answer(edges, q);
      EXPECT_EQ(answer.found.info.backend, "cuda");
      EXPECT_EQ(answer.found.info.rows, 2500u);
      EXPECT_EQ(answer.launches, 3);
      std::printf("margin %g, first contact %d: %llu finished by the CPU\n", margin, when,
                  static_cast<unsigned long long>(answer.on_cpu));
      EXPECT_GT(answer.on_cpu, 0u);
      EXPECT_LT(answer.on_cpu, 150u);
      const MotionComparison v = compare_motions(answer.found, answer.wanted, q);
      EXPECT_GT(v.free, 300);
      EXPECT_GT(v.hits, 300);
    }
  }
}

TEST(MotionKernels, AnswerAnEnginesLeastDistances) {
  const ArmEdges edges(8, 1500, 0.4);  // two chunks
  for (const bool when : {false, true}) {
    const QueryView q = edges.least(0.01, when);
    const EmulatedAnswer answer(edges, q);
    EXPECT_EQ(answer.found.info.backend, "cuda");
    EXPECT_EQ(answer.found.info.rows, 1500u);
    EXPECT_EQ(answer.launches, 2);
    std::printf("first contact %d: %llu finished by the CPU\n", when, static_cast<unsigned long long>(answer.on_cpu));
    EXPECT_GT(answer.on_cpu, 0u);
    EXPECT_LT(answer.on_cpu, 150u);
    const LeastRows v = compare_least(answer.found, answer.wanted, q);
    EXPECT_GT(v.apart, 200);
    EXPECT_GT(v.touching, 200);
  }
}

// Columns of least distances that kernels do not support: the CPU answers all of the query.
TEST(MotionKernels, LeaveSomeColumnsOfLeastDistancesToTheCpu) {
  const ArmEdges edges(8, 4, 0.4);
  QueryView q = edges.least(0, true);
  EXPECT_EQ(EmulatedAnswer(edges, q).found.info.backend, "cuda");
  q.fields |= kFieldPairLower;
  EXPECT_EQ(EmulatedAnswer(edges, q).found.info.backend, "cpu");
  q = edges.least(0, true);
  q.max_distance = 0.1;
  EXPECT_EQ(EmulatedAnswer(edges, q).found.info.backend, "cpu");
}

// Ends beyond limits are flagged for the bodies that their joints move, even if the pair is within its margin on the
// way.
TEST(MotionKernels, FlagEndsBeyondLimits) {
  ArmEdges edges(9, 400, 0.8);
  edges.end_beyond_limits();
  const QueryView q = edges.query(0, true);
  const EmulatedAnswer answer(edges, q);
  EXPECT_EQ(answer.found.info.backend, "cuda");
  EXPECT_LT(answer.on_cpu, 40u);
  EXPECT_GT(compare_motions(answer.found, answer.wanted, q).beyond_limits, 30);
}

}  // namespace
}  // namespace clearance::test
