#include "engine/device/device_self_test.h"

#include <chrono>
#include <map>
#include <mutex>

#include "engine/base/fp_environment.h"
#include "engine/device/device_job.h"
#include "engine/state/pose_store.h"

namespace clearance::cuda {

namespace {

// Two bodies for each known pair.
engine::Scene scene_of(const std::vector<KnownPair>& pairs) {
  engine::Scene scene;
  for (std::size_t i = 0; i < 2 * pairs.size(); ++i) {
    Body body;
    body.name = std::to_string(i);
    body.parts = {i % 2 == 0 ? pairs[i / 2].a : pairs[i / 2].b};
    body.pose = Pose{};
    scene.add_body(std::move(body));
  }
  return scene;
}

struct SelfTestCase {
  std::vector<BodyPair> pairs;
  std::vector<std::uint32_t> bodies;
  std::vector<Pose> poses;
  QueryView query;

  explicit SelfTestCase(const std::vector<KnownPair>& known) {
    const auto count = static_cast<std::uint32_t>(known.size());
    for (std::uint32_t i = 0; i < count; ++i) {
      pairs.push_back({2 * i, 2 * i + 1});
      bodies.insert(bodies.end(), {2 * i, 2 * i + 1});
    }
    const std::size_t places = known[0].poses.size();
    for (std::size_t k = 0; k < places; ++k)
      for (const KnownPair& pair : known) poses.insert(poses.end(), {pair.poses[k].first, pair.poses[k].second});
    query.all_pairs = false;
    query.pairs = pairs;
    query.bodies = bodies;
    query.configurations = poses;
    query.configuration_count = static_cast<std::uint32_t>(places);
    query.fields = kFieldLower | kFieldUpper | kFieldStatus;
  }
};

void evaluate(SelfTest& test, const std::vector<int>& devices) {
  const std::vector<KnownPair>& known = known_pairs();
  const engine::Scene scene = scene_of(known);
  DeviceBackend::Options options;
  options.devices = devices;
  options.fallback = false;
  DeviceBackend device(scene, options);
  const PoseStore poses(scene, std::chrono::nanoseconds(0));  // no pose here is stamped
  const auto trees = std::make_shared<BoxTreeStore>();
  std::atomic<std::uint64_t> evaluated{0}, contradictions{0};
  const JobContext context{&scene,        1,          false,           &lane_kernel("baseline"),
                           true,          &evaluated, &contradictions, trees.get(),
                           NearBy::kAuto, &device};
  for (const Precision precision : {Precision::kF64, Precision::kF32}) {
    SelfTestCase test_case(known);
    test_case.query.precision = precision;
    Plan plan = make_plan(test_case.query, scene, poses.snapshot(), ~std::uint64_t{0}, true);
    std::vector<double> lower(plan.size.rows), upper(plan.size.rows);
    std::vector<std::uint8_t> status(plan.size.rows);
    ReplyView reply;
    reply.rows = plan.size.rows;
    reply.lower = lower.data();
    reply.upper = upper.data();
    reply.status = status.data();
    const std::unique_ptr<Job::State> job = make_device_job(context, plan, reply);
    while (!job->advance({})) {
    }
    NarrowLimits limits;
    limits.rel_tol = precision == Precision::kF32 ? 1e-4 : 1e-6;
    for (std::size_t row = 0; row < lower.size(); ++row) {
      NarrowAnswer answer;
      answer.bounds = {lower[row], upper[row]};
      test.count(error_of(known[row % known.size()], answer, limits));
    }
  }
  if (contradictions > 0) test.count("bounds contradict each other");
}

}  // namespace

SelfTest self_test_devices(const std::vector<int>& devices) {
  const FpEnvironment environment;
  const auto begin = std::chrono::steady_clock::now();
  SelfTest test{"cuda"};
  try {
    evaluate(test, devices);
  } catch (const DeviceError&) {
  } catch (const engine::QueryError&) {
  }
  test.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return test;
}

const SelfTest& device_self_test(const std::vector<int>& devices) {
  static std::mutex mutex;
  static auto& tests = *new std::map<std::vector<int>, SelfTest>();  // never destroyed: engines may outlast main()
  static const SelfTest untested{"cuda"};
  if (has_fake_device()) return untested;
  const std::lock_guard lock(mutex);
  const auto found = tests.find(devices);
  return found != tests.end() ? found->second : tests.emplace(devices, self_test_devices(devices)).first->second;
}

}  // namespace clearance::cuda
