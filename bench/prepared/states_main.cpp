// clearance-states SCENE ROBOT COUNT URL [BACKEND [TURNS [THREADS]]]: the time that a daemon adds to a large query.
//
// Prepared queries of COUNT states of a robot, 0.1 rad or m about its present one, in this process and through a daemon
// of the same scene, by turns. Prints a row of CSV for each: medians in milliseconds, the ratio of both, the median of
// the engine's time in the daemon, and the first call of this process, which makes kernels and memory.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <exception>
#include <random>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "client/client.h"
#include "engine/api/engine.h"

namespace clearance {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kWarmUp = 5;

struct StatesQuery {
  const char* name;
  Reduce reduce;
  std::uint32_t fields;
};
constexpr StatesQuery kQueries[] = {
    {"any, verdict", Reduce::kAny, kFieldVerdict},
    {"any, verdict and pair", Reduce::kAny, kFieldVerdict | kFieldPair},
    {"min, lower", Reduce::kMin, kFieldLower},
};

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

std::vector<double> states_of(const JointsInfo& info, std::span<const std::uint32_t> joints, std::size_t count) {
  std::mt19937_64 random(48);
  std::uniform_real_distribution<double> near(-0.1, 0.1);
  std::vector<double> states;
  states.reserve(count * joints.size());
  for (std::size_t k = 0; k < count; ++k)
    for (const std::uint32_t joint : joints) states.push_back(info.joints[joint].position + near(random));
  return states;
}

double took_ms(Prepared& query, std::span<const double> states, Result& result) {
  const auto begin = Clock::now();
  result = query.run(states);
  return std::chrono::duration<double, std::milli>(Clock::now() - begin).count();
}

/// Throws unless the daemon has the same verdicts.
void compare(const Result& here, const Result& there) {
  const auto a = here.verdict(), b = there.verdict();
  if (here.rows() != there.rows() || !std::equal(a.begin(), a.end(), b.begin(), b.end()))
    throw std::runtime_error("the daemon has another answer: is its scene the same?");
}

void measure(const StatesQuery& of, Engine& engine, Client& client, std::span<const std::uint32_t> joints,
             std::span<const double> states, int turns) {
  const Query query{.joints = joints, .reduce = of.reduce, .fields = of.fields};
  Prepared here = engine.prepare(query), there = client.prepare(query);
  std::vector<double> process, daemon, in_daemon;
  Result a, b;
  const double first = took_ms(here, states, a);
  for (int turn = -kWarmUp; turn < turns; ++turn) {
    const double here_ms = took_ms(here, states, a), there_ms = took_ms(there, states, b);
    if (turn < 0) continue;
    process.push_back(here_ms);
    daemon.push_back(there_ms);
    in_daemon.push_back(1e-6 * static_cast<double>(b.engine_ns()));
  }
  compare(a, b);
  std::printf("\"%s\",%zu,%s,%.3f,%.3f,%.2f,%.3f,%.1f\n", of.name, states.size() / joints.size(),
              std::string(a.backend()).c_str(), median(process), median(daemon), median(daemon) / median(process),
              median(in_daemon), first);
  std::fflush(stdout);
}

int run(int argc, char** argv) {
  const std::string backend = argc > 5 ? argv[5] : "cpu";
  const int turns = argc > 6 ? std::stoi(argv[6]) : 50, threads = argc > 7 ? std::stoi(argv[7]) : 1;
  Engine engine(Scene::load(argv[1]), {.backend = backend, .threads = threads});
  Client client = connect(argv[4], std::chrono::seconds(30));
  client.set_timeout(std::chrono::minutes(2));
  engine.wait_covers();
  client.wait_covers();
  const Joints joints = engine.joints(argv[2]);
  const std::vector<double> states = states_of(engine.joint_states(), joints.ids, std::stoul(argv[3]));
  std::puts("query,states,backend,process_ms,daemon_ms,ratio,engine_in_daemon_ms,first_ms");
  for (const StatesQuery& query : kQueries) measure(query, engine, client, joints.ids, states, turns);
  return 0;
}

}  // namespace
}  // namespace clearance

int main(int argc, char** argv) try {
  if (argc >= 5) return clearance::run(argc, argv);
  std::fprintf(stderr, "clearance-states SCENE ROBOT COUNT URL [BACKEND [TURNS [THREADS]]]\n");
  return 2;
} catch (const std::exception& error) {
  std::fprintf(stderr, "clearance-states: %s\n", error.what());
  return 1;
}
