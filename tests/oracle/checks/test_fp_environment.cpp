// In any state of a caller's thread (rounding, denormals, traps) answers have the same bits as in the default state,
// and the thread's state is restored afterwards.
#include <fenv.h>
#include <gtest/gtest.h>
#include <omp.h>

#include <cstring>
#include <fstream>
#include <thread>

#include "engine/engine.h"
#include "engine/selection/columns.h"
#include "tests/oracle/oracle_run.h"
#include "tests/temporary_folder.h"

namespace clearance::exact {
namespace {

// The registers, flags included.
struct Registers {
#if defined(__x86_64__)
  std::uint32_t control = 0;
  std::uint16_t x87 = 0;
  static Registers now() {
    Registers r;
    asm volatile("stmxcsr %0\n\tfnstcw %1" : "=m"(r.control), "=m"(r.x87) : : "memory");
    return r;
  }
  void load() const { asm volatile("ldmxcsr %0\n\tfldcw %1" : : "m"(control), "m"(x87) : "memory"); }
  void flush_to_zero() { control |= 1u << 15; }
  void denormals_are_zero() { control |= 1u << 6; }
#elif defined(__aarch64__)
  std::uint64_t control = 0, flags = 0;
  static Registers now() {
    Registers r;
    asm volatile("mrs %0, fpcr\n\tmrs %1, fpsr" : "=r"(r.control), "=r"(r.flags) : : "memory");
    return r;
  }
  void load() const { asm volatile("msr fpcr, %0\n\tmsr fpsr, %1" : : "r"(control), "r"(flags) : "memory"); }
  void flush_to_zero() { control |= 1u << 24; }
  void denormals_are_zero() { control |= 1u << 24; }
#endif
  bool operator==(const Registers&) const = default;
};

struct State {
  std::string name;
  int rounding = FE_TONEAREST;
  bool flush = false, no_denormals = false;
  int traps = 0, raised = 0;

  void set() const {
    fesetenv(FE_DFL_ENV);
    fesetround(rounding);
    Registers r = Registers::now();
    if (flush) r.flush_to_zero();
    if (no_denormals) r.denormals_are_zero();
    r.load();
    if (raised != 0) feraiseexcept(raised);
    if (traps != 0) feenableexcept(traps);
  }
};

const std::vector<State>& states() {
  constexpr int kSevere = FE_INVALID | FE_DIVBYZERO | FE_OVERFLOW;
  static const std::vector<State> all{
      {"upward", FE_UPWARD},
      {"downward", FE_DOWNWARD},
      {"toward_zero", FE_TOWARDZERO},
      {"flush_to_zero", FE_TONEAREST, true},
      {"denormals_are_zero", FE_TONEAREST, false, true},
      {"traps", FE_TONEAREST, false, false, kSevere},
      {"every_trap", FE_TONEAREST, false, false, FE_ALL_EXCEPT},
      {"flags_raised", FE_TONEAREST, false, false, 0, kSevere},
      {"all_at_once", FE_UPWARD, true, true, kSevere, FE_INEXACT},
  };
  return all;
}

// Runs a function in a thread in this state, and checks that the state is unchanged. Both end with the thread.
template <class Run>
void in(const State& state, Run run) {
  std::thread([&] {
    state.set();
    const Registers before = Registers::now();
    run();
    const Registers after = Registers::now();
    fesetenv(FE_DFL_ENV);
    EXPECT_TRUE(before == after) << state.name;
  }).join();
}

using Bytes = std::vector<unsigned char>;
template <class T>
void append(Bytes& bytes, const T& value) {
  const auto* begin = reinterpret_cast<const unsigned char*>(&value);
  bytes.insert(bytes.end(), begin, begin + sizeof value);
}
Bytes bytes_of(const std::vector<Answer>& answers) {
  Bytes bytes;
  for (const Answer& a : answers) {
    for (const double x : {a.distance, a.lower, a.upper}) append(bytes, x);
    append(bytes, a.status);
    append(bytes, a.flags);
    for (const Vec3d& v : {a.point_a, a.point_b, a.normal}) append(bytes, v);
  }
  return bytes;
}

std::vector<Case> hard_cases() {
  std::vector<Case> cases;
  for (const CaseClass& cls : case_classes())
    for (std::uint64_t i = 0; i < (cls.cost > 3 ? 1 : 3); ++i) cases.push_back(make_case(cls, 51, i));
  return cases;
}

// Creates convex parts, builds an engine and queries it in all ways.
Bytes request_all(std::span<const Case> cases, int threads) {
  Bytes all;
  for (const char* backend : {"cpu", "reference"}) {
    const Bench bench(cases, backend, threads);
    for (const Setting& s : standard_settings({backend})) {
      const Bytes bytes = bytes_of(bench.evaluate(s));
      all.insert(all.end(), bytes.begin(), bytes.end());
    }
  }
  return all;
}

TEST(FpEnvironment, HardPairsHaveTheSameBitsInEveryState) {
  const std::vector<Case> cases = hard_cases();
  const Bytes expected = request_all(cases, 1);
  for (const State& state : states()) {
    Bytes seen;
    in(state, [&] { seen = request_all(cases, 1); });
    EXPECT_TRUE(seen == expected) << state.name;
  }
}

// OpenMP's threads may exist already, in the caller's state, and return to the caller afterwards.
TEST(FpEnvironment, SoTheyHaveInWorkersThatAreInAnotherState) {
  constexpr int kThreads = 2;  // with fewer libgomp ends the rest, so that other threads would return
  const std::vector<Case> cases = hard_cases();
  const Bytes expected = request_all(cases, kThreads);
  for (const State& state : states()) {
    Bytes seen;
    int in_state = 0, still_in_state = 0;
    std::thread([&] {
      const auto every = [&](auto run) {
#pragma omp parallel num_threads(kThreads) reduction(+ : in_state, still_in_state)
        run(in_state, still_in_state);
      };
      std::vector<Registers> before(kThreads);
      every([&](int& set, int&) {
        state.set();
        before[static_cast<std::size_t>(omp_get_thread_num())] = Registers::now();
        ++set;
      });
      seen = request_all(cases, kThreads);
      every([&](int&, int& still) {
        still += Registers::now() == before[static_cast<std::size_t>(omp_get_thread_num())];
        fesetenv(FE_DFL_ENV);
      });
    }).join();
    EXPECT_TRUE(seen == expected) << state.name;
    EXPECT_EQ(in_state, kThreads) << state.name;
    EXPECT_EQ(still_in_state, kThreads) << state.name;
  }
}

// A caller's own parallel loop, with a query on each thread.
TEST(FpEnvironment, SoTheyHaveWhereEachOfACallersThreadsRuns) {
  std::vector<Case> cases = hard_cases();
  cases.resize(40);
  const Bytes expected = request_all(cases, 1);
  const int count = static_cast<int>(states().size());
  std::vector<Bytes> seen(states().size());
#pragma omp parallel for num_threads(4) schedule(dynamic)
  for (int i = 0; i < count; ++i) {
    states()[static_cast<std::size_t>(i)].set();
    seen[static_cast<std::size_t>(i)] = request_all(cases, 1);
    fesetenv(FE_DFL_ENV);
  }
  for (std::size_t i = 0; i < seen.size(); ++i) EXPECT_TRUE(seen[i] == expected) << states()[i].name;
}

// A scene of decimal numbers, bodies that follow others, and reductions.
Bytes whole_way(const std::string& path) {
  Bytes bytes;
  engine::Scene scene = engine::Scene::load(path);
  scene.add_cylinder("post", 0.1, 0.7, {.pose = Pose{{0.1, 0.2, 0.3}}});
  scene.add_uv_sphere("ball", 0.3, 7, {.pose = Pose{{-0.1, 0.7, 0.9}, 0.3, 0.1, 0.2, 0.7}});
  append(bytes, scene.revision());
  engine::Engine::Options options;
  options.backend = "cpu";
  options.threads = 1;
  engine::Engine engine(std::move(scene), options);
  const auto bodies = static_cast<std::uint32_t>(engine.scene().bodies().size());
  const Pose X{{0.1, 0.7, 1.3}, 0.9, 0.1, -0.3, 0.7};
  engine.attach(bodies - 1, bodies - 2);
  for (std::uint32_t b = 0; b < bodies; b += 3) {
    const BodyPose pose{b, X};
    engine.set_poses({&pose, 1});
  }
  for (std::uint32_t b = 0; b < bodies; ++b) append(bytes, engine.body_state(b).X_wb);
  for (const Reduce reduce : {Reduce::kMin, Reduce::kNearest, Reduce::kWithin}) {
    QueryView query;
    query.reduce = reduce;
    query.max_distance = reduce == Reduce::kWithin ? 0.3 : 1e300;
    query.max_results = 1000;
    const QuerySize size = engine.size(query);
    std::vector<double> lower(size.rows), upper(size.rows);
    ReplyView reply;
    reply.lower = lower.data();
    reply.upper = upper.data();
    Job job = engine.start(query, reply);
    while (!job.advance()) {
    }
    append(bytes, job.info().rows);
    for (std::size_t i = 0; i < job.info().rows; ++i) append(bytes, lower[i]), append(bytes, upper[i]);
  }
  return bytes;
}

TEST(FpEnvironment, ScenesAndReductionsAreTheSame) {
  const TemporaryFolder folder;
  const std::string path = folder / "scene.yaml";
  {
    std::ofstream file(path);
    file << "bodies:\n";
    for (int i = 0; i < 12; ++i)
      file << "  - {name: b" << i << ", points: [[0.1, 0.3, 0.7], [1e-310, " << i
           << ".1, 1.7e-5], [-0.3, 1.1, 2e-309], "
           << "[0.9, 0.011, -0.6]], pose: [" << i << ".3, 0.1, -1.7, 0.9, 0.1, 0.3, 0.7]}\n";
  }
  const Bytes expected = whole_way(path);
  for (const State& state : states()) {
    Bytes seen;
    in(state, [&] { seen = whole_way(path); });
    EXPECT_TRUE(seen == expected) << state.name;
  }
}

}  // namespace
}  // namespace clearance::exact
