// clearance-prepared [SCENE [ROBOT]]: time that the C++ interface adds to the engine's own work in a check of one state.
//
// The engine's own work is a call of its internal interface with columns of the caller. Prints the fastest of rounds
// that alternate, in microseconds a call, and what Prepared::run() and Engine::distances() add.
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include "engine/api/engine.h"
#include "engine/engine.h"
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
  }
  bool free(std::span<const double> positions) {
    query_.positions = positions;
    query_.configuration_count = 1;
    Job job = engine_.start(query_, reply_);
    while (!job.advance()) {
    }
    return verdict_ == static_cast<std::uint8_t>(Status::kBeyond);
  }

 private:
  engine::Engine engine_;
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

}  // namespace
}  // namespace clearance

int main(int argc, char** argv) try {
  return clearance::run(argc > 1 ? argv[1] : CLEARANCE_SOURCE_DIR "/scenes/cell/robot.yaml", argc > 2 ? argv[2] : "*");
} catch (const std::exception& error) {
  std::fprintf(stderr, "clearance-prepared: %s\n", error.what());
  return 1;
}
