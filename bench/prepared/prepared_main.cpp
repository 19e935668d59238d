// clearance-prepared [SCENE [ROBOT]]: time that the C++ interface adds to the engine's own work in a check of one state.
// clearance-prepared SCENE ROBOT STATES ROUNDS: time of prepared queries of one state, without and with covers.
//
// The engine's own work is a call of its internal interface with columns of the caller. Prints the fastest of rounds
// that alternate, in microseconds a call, and what Prepared::run() and Engine::distances() add. STATES is a file of
// float64, a row of joint positions for each state; prints a line for each query, with each round's processor time for
// all of them, in seconds.
#include <time.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <exception>
#include <fstream>
#include <iterator>
#include <memory>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "engine/api/engine.h"
#include "engine/engine.h"
#include "engine/query/job_pool.h"
#include "engine/scene/scene.h"

namespace clearance {
namespace {

constexpr int kRounds = 1001, kCalls = 64;

/// A call of the engine's internal interface.
class Bare {
 public:
  Bare(const std::string& scene, const Joints& joints) : engine_(engine::Scene::load(scene)) {
    query_.joints = joints.ids;
    query_.reduce = Reduce::kAny;
    query_.fields = kFieldVerdict | kFieldPair;
    reply_.rows = 1;
    reply_.verdict = &verdict_;
    reply_.pair = &pair_;
    engine_.wait_covers(std::chrono::minutes(1));
  }
  bool free(std::span<const double> positions) {
    query_.positions = positions;
    query_.configuration_count = 1;
    Job job = engine_.start(engine_.prepare(query_, jobs_), reply_);
    while (!job.advance()) {
    }
    return verdict_ == static_cast<std::uint8_t>(Status::kBeyond);
  }

 private:
  engine::Engine engine_;
  const std::shared_ptr<JobPool> jobs_ = std::make_shared<JobPool>();
  QueryView query_;
  ReplyView reply_;
  std::uint8_t verdict_ = 0;
  BodyPair pair_;
};

template <class Call>
double time_us(Call&& call) {
  const auto begin = std::chrono::steady_clock::now();
  for (int i = 0; i < kCalls; ++i) call(i);
  return std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - begin).count() / kCalls;
}

int run(const std::string& scene, const std::string& robot) {
  const Engine engine(Scene::load(scene));
  const Joints joints = engine.joints(robot);
  Bare bare(scene, joints);
  const Query query = as_check({.joints = joints.ids});
  Prepared prepared = engine.prepare(query);
  engine.wait_covers();

  // States near the middle of the joints' ranges.
  std::vector<std::vector<double>> states(16);
  for (std::size_t k = 0; k < states.size(); ++k)
    for (std::size_t j = 0; j < joints.size(); ++j)
      states[k].push_back(0.1 * static_cast<double>((k * 7 + j * 3) % 11) - 0.5);
  const auto state = [&](int i) {
    return std::span<const double>(states[static_cast<std::size_t>(i) % states.size()]);
  };

  std::array<std::vector<double>, 3> rounds;
  std::array<int, 3> free{};
  for (int round = 0; round < kRounds; ++round) {
    rounds[0].push_back(time_us([&](int i) { free[0] += bare.free(state(i)); }));
    rounds[1].push_back(time_us([&](int i) { free[1] += prepared.run(state(i)).verdict()[0] == Status::kBeyond; }));
    rounds[2].push_back(time_us([&](int i) {
      Query own = query;
      own.positions = state(i);
      free[2] += engine.distances(own).verdict()[0] == Status::kBeyond;
    }));
  }
  std::array<double, 3> us;
  for (std::size_t i = 0; i < us.size(); ++i) us[i] = *std::min_element(rounds[i].begin(), rounds[i].end());
  std::printf("%s, %zu joints, %d of %d states free\n", scene.c_str(), joints.size(), free[0], kRounds * kCalls);
  std::printf("engine alone         %7.3f us\n", us[0]);
  std::printf("Prepared::run()      %7.3f us  + %.3f us  x %.3f\n", us[1], us[1] - us[0], us[1] / us[0]);
  std::printf("Engine::distances()  %7.3f us  + %.3f us  x %.3f\n", us[2], us[2] - us[0], us[2] / us[0]);
  return free[0] == free[1] && free[0] == free[2] ? 0 : 1;
}

std::vector<double> read_states(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) throw std::runtime_error("cannot read " + path);
  const std::string bytes(std::istreambuf_iterator<char>(in), {});
  std::vector<double> states(bytes.size() / sizeof(double));
  std::memcpy(states.data(), bytes.data(), states.size() * sizeof(double));
  return states;
}

double processor_seconds() {
  timespec now{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

struct PreparedQuestion {
  const char* name;
  std::string covers;
  Prepared query;
  std::vector<double> seconds = {};
};

int time_states(const std::string& scene, const std::string& robot, const std::string& file, int rounds) {
  const std::vector<double> states = read_states(file);
  constexpr std::uint32_t kBounds = kFieldLower | kFieldUpper | kFieldStatus | kFieldPair;
  std::vector<std::unique_ptr<Engine>> engines;
  std::vector<PreparedQuestion> questions;
  std::size_t width = 0;
  for (const char* covers : {"off", "background"}) {
    engines.push_back(std::make_unique<Engine>(Scene::load(scene), EngineOptions{.threads = 1, .covers = covers}));
    engines.back()->wait_covers();
    const Joints joints = engines.back()->joints(robot);
    width = joints.size();
    for (const auto& [name, reduce, fields] :
         {std::tuple{"verdict", Reduce::kAny, std::uint32_t{kFieldVerdict}},
          std::tuple{"check", Reduce::kAny, kFieldVerdict | kFieldPair}, std::tuple{"bounds", Reduce::kAny, kBounds},
          std::tuple{"least", Reduce::kMin, kFieldLower | kFieldUpper}})
      questions.push_back(
          {name, covers, engines.back()->prepare({.joints = joints.ids, .reduce = reduce, .fields = fields})});
  }
  for (int round = -1; round < rounds; ++round)  // the first one warms up
    for (PreparedQuestion& q : questions) {
      const double begin = processor_seconds();
      for (std::size_t at = 0; at + width <= states.size(); at += width)
        q.query.run(std::span(states).subspan(at, width));
      if (round >= 0) q.seconds.push_back(processor_seconds() - begin);
    }
  for (const PreparedQuestion& q : questions) {
    std::printf("%s %s", q.name, q.covers.c_str());
    for (const double seconds : q.seconds) std::printf(" %.9f", seconds);
    std::printf("\n");
  }
  return 0;
}

}  // namespace
}  // namespace clearance

int main(int argc, char** argv) try {
  if (argc == 5) return clearance::time_states(argv[1], argv[2], argv[3], std::stoi(argv[4]));
  return clearance::run(argc > 1 ? argv[1] : CLEARANCE_SOURCE_DIR "/scenes/cell/robot.yaml", argc > 2 ? argv[2] : "*");
} catch (const std::exception& error) {
  std::fprintf(stderr, "clearance-prepared: %s\n", error.what());
  return 1;
}
