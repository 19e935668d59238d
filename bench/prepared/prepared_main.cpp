// clearance-prepared [SCENE [ROBOT [ROUNDS]]]: time that the C++ interface adds to the engine's own work in one call.
// clearance-prepared SCENE ROBOT STATES ROUNDS: time of prepared queries of one state, without and with covers.
// clearance-prepared SCENE ROBOT ROUNDS MARGIN FILE...: time of verdicts of states and edges, without and with covers.
//
// The first prints a row of CSV for each call, the fastest of rounds that alternate, in microseconds: of a state in a
// batch (the engine's own work alone; empty without a batch), of a call of the engine's internal interface, of
// Prepared::run(), and of the call that is not prepared. ROBOT "-" leaves out calls of joints.
// timed_files.h has the formats of the others.
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "bench/prepared/timed_files.h"
#include "engine/api/conversions.h"
#include "engine/api/engine.h"
#include "engine/api/result_memory.h"
#include "engine/engine.h"
#include "engine/query/job_pool.h"
#include "engine/scene/scene.h"

namespace clearance {
namespace {

using Row = std::span<const double>;

constexpr std::size_t kStates = 2048;
constexpr double kRoundUs = 200;

/// Calls of the engine's internal interface, which keep their jobs.
class Bare {
 public:
  Bare(const engine::Engine& engine, QueryView query) : engine_(engine), query_(query) {}
  void run(Row positions, std::uint32_t configurations) {
    query_.positions = positions;
    query_.configuration_count = configurations;
    PreparedQuery prepared = engine_.prepare(query_, jobs_);
    if (!memory_ || memory_->view().rows != prepared.size().rows)
      memory_ = std::make_unique<ResultMemory>(prepared.size());
    Job job = engine_.start(std::move(prepared), memory_->view());
    while (!job.advance()) {
    }
  }

 private:
  const engine::Engine& engine_;
  QueryView query_;
  const std::shared_ptr<JobPool> jobs_ = std::make_shared<JobPool>();
  std::unique_ptr<ResultMemory> memory_;
};

/// A call in its forms. Each answers state `i`, the batch all of them.
struct Compared {
  std::string name;
  std::size_t pairs;
  std::function<void()> batch;  ///< empty if there is none
  std::function<void(std::size_t i)> engine, prepared, one_off;
  std::array<double, 4> us{};  ///< fastest round
};

void time_round(Compared& call) {
  using Clock = std::chrono::steady_clock;
  const auto timed = [&](double& best, std::size_t calls, auto&& work) {
    const auto begin = Clock::now();
    work();
    const double us = std::chrono::duration<double, std::micro>(Clock::now() - begin).count();
    best = best == 0 ? us / static_cast<double>(calls) : std::min(best, us / static_cast<double>(calls));
  };
  if (call.batch) timed(call.us[0], kStates, call.batch);
  // Rounds are short, so that some are not interrupted.
  const std::size_t calls =
      call.us[1] == 0 ? 1 : static_cast<std::size_t>(std::clamp(kRoundUs / call.us[1], 2.0, double{kStates}));
  std::size_t form = 0;
  for (const auto* one : {&call.engine, &call.prepared, &call.one_off}) {
    const auto all = [&] {
      for (std::size_t i = 0; i < calls; ++i) (*one)(i);
    };
    all();  // into the cache
    timed(call.us[++form], calls, all);
  }
}

/// The engine twice: as programs use it, and its internal interface.
struct Engines {
  explicit Engines(const std::string& scene)
      : api(Scene::load(scene), {.backend = "cpu", .threads = 1}),
        inner(engine::Scene::load(scene), {.backend = "cpu", .threads = 1}) {
    api.wait_covers();
    inner.wait_covers(std::chrono::minutes(1));
  }
  Engine api;
  engine::Engine inner;
};

/// States from the present one on, a step of 1 mrad of all joints each; and motions between them.
struct States {
  States(const Engine& engine, const Joints& joints) : each(joints.size()) {
    const JointsInfo info = engine.joint_states();
    for (std::size_t k = 0; k <= kStates; ++k)
      for (int twice = 0; twice < (k == 0 || k == kStates ? 1 : 2); ++twice)
        for (const std::uint32_t id : joints.ids)
          ends.push_back(info.joints[id].position + 1e-3 * static_cast<double>(k % 16));
    for (std::size_t k = 0; k < kStates; ++k)
      states.insert(states.end(), &ends[2 * k * each], &ends[(2 * k + 1) * each]);
  }
  Row state(std::size_t i) const { return Row(states).subspan(i * each, each); }
  Row motion(std::size_t i) const { return Row(ends).subspan(2 * i * each, 2 * each); }

  std::size_t each;
  std::vector<double> states, ends;
};

Query with_positions(Query query, Row positions) {
  query.positions = positions;
  return query;
}

/// \param of_motions whether a run has two states
Compared joints_call(std::string name, Engines& engines, const States& states, const Query& query, bool of_motions) {
  const std::uint32_t rows = of_motions ? 2 : 1;
  const auto bare = std::make_shared<Bare>(engines.inner, view_without_inputs(query));
  const auto prepared = std::make_shared<Prepared>(engines.api.prepare(query));
  const auto input = [&states, of_motions](std::size_t i) { return of_motions ? states.motion(i) : states.state(i); };
  const auto all = [&states, of_motions] { return Row(of_motions ? states.ends : states.states); };
  return {std::move(name),
          engines.api.pairs(with_positions(query, input(0))).size(),
          [=] { bare->run(all(), rows * kStates); },
          [=](std::size_t i) { bare->run(input(i), rows); },
          [=](std::size_t i) { prepared->run(input(i)); },
          [=, &engines](std::size_t i) { engines.api.distances(with_positions(query, input(i))); }};
}

std::vector<Compared> joints_calls(Engines& engines, const States& states, const Joints& joints) {
  const Query alone{.joints = joints.ids};
  Query least = alone, edge = alone, rows = alone;
  least.reduce = Reduce::kMin;
  least.fields = kFieldLower;
  rows.reduce = Reduce::kNearest;
  rows.k = 20;
  rows.fields = kFieldLower | kFieldNormal | kFieldGradientJoints | kFieldRate | kFieldRateBounds;
  edge.reduce = Reduce::kAny;
  edge.fields = kFieldVerdict;
  std::vector<Compared> calls;
  calls.push_back(joints_call("check", engines, states, as_check(alone), false));
  calls.push_back(joints_call("one edge", engines, states, as_motions(edge), true));
  calls.push_back(calls.back());
  calls.back().name = "path of one edge";
  const auto path = std::make_shared<PreparedPath>(engines.api.prepare_path(alone));
  calls.back().prepared = [path, &states](std::size_t i) { path->run(states.motion(i)); };
  calls.back().one_off = [&engines, &states, alone](std::size_t i) {
    engines.api.check_path(with_positions(alone, states.motion(i)));
  };
  calls.push_back(joints_call("distances, min", engines, states, least, false));
  calls.push_back(joints_call("20 rows of a QP", engines, states, rows, false));
  rows.fields &= ~kFieldRateBounds;
  calls.push_back(joints_call("20 rows of first order", engines, states, rows, false));
  return calls;
}

Compared all_pairs(Engines& engines) {
  const Query query{.fields = kFieldLower};
  const auto bare = std::make_shared<Bare>(engines.inner, view_without_inputs(query));
  const auto prepared = std::make_shared<Prepared>(engines.api.prepare(query));
  return {"all pairs",
          engines.api.pairs().size(),
          {},
          [=](std::size_t) { bare->run({}, 0); },
          [=](std::size_t) { prepared->run(); },
          [&engines, query](std::size_t) { engines.api.distances(query); }};
}

/// Sets the present poses of all bodies that move.
Compared set_poses(Engines& engines) {
  std::vector<std::pair<std::uint32_t, Pose7>> poses;
  std::vector<BodyPose> inner;
  const std::vector<BodyStateInfo> states = engines.api.body_states();
  const SceneInfo scene = engines.api.scene();
  for (std::uint32_t id = 0; id < states.size(); ++id) {
    if (scene.bodies[id].is_static || scene.bodies[id].parent != kNone) continue;
    poses.emplace_back(id, states[id].pose);
    inner.push_back({id, pose_of(states[id].pose)});
  }
  const auto api = [&engines, poses](std::size_t) { engines.api.set_poses(poses); };
  return {"set poses", poses.size(), {}, [&engines, inner](std::size_t) { engines.inner.set_poses(inner); }, api, api};
}

int run(const std::string& scene, const std::string& robot, int rounds) {
  Engines engines(scene);
  std::vector<Compared> calls;
  Joints joints;
  std::optional<States> states;
  if (robot != "-") {
    joints = engines.api.joints(robot);
    states.emplace(engines.api, joints);
    calls = joints_calls(engines, *states, joints);
  }
  calls.push_back(all_pairs(engines));
  if (robot == "-") calls.push_back(set_poses(engines));
  for (int round = 0; round < rounds; ++round)
    for (Compared& call : calls) time_round(call);
  std::puts("call,pairs,batch_us,engine_us,prepared_us,one_off_us");
  for (const Compared& call : calls) {
    const std::string batch = call.batch ? std::to_string(call.us[0]) : "";
    std::printf("\"%s\",%zu,%s,%.3f,%.3f,%.3f\n", call.name.c_str(), call.pairs, batch.c_str(), call.us[1], call.us[2],
                call.us[3]);
  }
  return 0;
}

}  // namespace
}  // namespace clearance

int main(int argc, char** argv) try {
  if (argc == 5) return clearance::time_states(argv[1], argv[2], argv[3], std::stoi(argv[4])), 0;
  if (argc > 5) {
    const std::vector<std::string> files(argv + 5, argv + argc);
    return clearance::time_verdicts(argv[1], argv[2], std::stoi(argv[3]), std::stod(argv[4]), files), 0;
  }
  return clearance::run(argc > 1 ? argv[1] : CLEARANCE_SOURCE_DIR "/scenes/cell/robot.yaml", argc > 2 ? argv[2] : "*",
                        argc > 3 ? std::stoi(argv[3]) : 200);
} catch (const std::exception& error) {
  std::fprintf(stderr, "clearance-prepared: %s\n", error.what());
  return 1;
}
