#include "engine/engine.h"

#include <omp.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <iterator>
#include <stdexcept>
#include <utility>

#include "engine/base/fp_environment.h"
#include "engine/certificate/motion_certificate.h"
#include "engine/device/device_job.h"
#include "engine/device/device_self_test.h"
#include "engine/device/query/device_plan.h"
#include "engine/device/router.h"
#include "engine/motion/free_scale.h"
#include "engine/motion/motion_job.h"
#include "engine/narrow/self_test.h"
#include "engine/query/job_state.h"
#include "engine/query/kept_jobs.h"
#include "engine/query/query_cost.h"
#include "engine/selection/plan.h"
#include "engine/state/pose_store.h"

namespace clearance {

struct Engine::Impl {
  Impl(Scene&& s, const Options& o)
      : scene(with_stand_ins(std::move(s))), options(o), warm(o.warm_memory), poses(scene, o.max_stamp_lead) {}

  Scene scene;
  Options options;
  bool reference = false;
  const LaneKernel* lanes = nullptr;
  bool light = false;
  NearBy near_by = NearBy::kAuto;
  mutable WarmStore warm;
  mutable BoxTreeStore trees;
  std::unique_ptr<cuda::DeviceBackend> device;
  std::string refused_device;  // why it is not used; empty: it is, or there is none
  std::unique_ptr<cuda::Router> router;
  PoseStore poses;
  SceneCost bulk{scene};
  SceneCost bulk_by_pieces{scene.by_pieces() ? *scene.by_pieces() : scene};
  mutable KeptJobs kept{scene};  // their trees go back where they came from
  pid_t process = getpid();
  mutable std::atomic<std::uint64_t> queries{0}, pairs_evaluated{0}, contradictions{0}, teams{0};
  std::atomic<std::uint64_t> pose_updates{0}, bad_poses{0}, joint_updates{0}, bad_joints{0}, point_updates{0};

  static Scene with_stand_ins(Scene scene) {
    scene.find_stand_ins();
    return scene;
  }

  // What a query is answered from. Certificates and devices know no other model than the truth: what they answer is the
  // same in both, and of the rest none of them answers anything.
  static const Scene& scene_of(const PoseSnapshot& snapshot, Model model = Model::kTruth) {
    const Scene* const by_pieces = model == Model::kPieces ? snapshot.scene->by_pieces() : nullptr;
    return by_pieces ? *by_pieces : *snapshot.scene;
  }

  JobContext context(const Scene& of) const {
    const bool is_light = light && !of.has_stand_ins();
    return {&of,    options.threads, reference,    lanes, is_light, &pairs_evaluated, &contradictions, &warm,
            &trees, near_by,         device.get(), &kept, &teams};
  }

  // Whether the job of a query may be asked again. Where there is a device, the router has its say each time, but in
  // decisions: those that are small enough to be kept take the CPU less time than a device needs to be asked.
  bool keeps_job_of(const QueryView& query) const {
    return (!device || (router && query.reduce == Reduce::kAny)) && kept.keeps(query);
  }

  // Backend of a query.
  struct Route {
    cuda::QueryKind kind;
    std::uint64_t pairs;
    bool to_device;
    cuda::Router* router;  // learns from the answer; null: the backend was no choice
  };

  // Throws QueryError if the device lacks the query and the CPU may not answer in its place.
  Route route_of(const Plan& plan, const Scene& of, bool keep_on_cpu) const {
    Route route{cuda::kind_of(plan.query), plan.size.configurations * plan.size.pairs, false, nullptr};
    std::string missing = cuda::beyond_the_device(plan);
    if (missing.empty() && of.has_stand_ins()) missing = "the model pieces";
    if (!missing.empty() && device && !router && !options.device_fallback)
      throw QueryError(QueryErrorCode::kNotSupported,
                       missing + ": backend cuda does not answer it, and the CPU may not");
    const bool is_kept = plan.question && KeptJobs::keeps(plan.size);
    if (keep_on_cpu || is_kept || !missing.empty()) return route;
    route.router = router.get();
    route.to_device = device && (!router || router->to_device(route.kind, route.pairs));
    return route;
  }

  // OpenMP's threads do not survive a fork: a child that used them would hang.
  void check_process() const {
    if (getpid() != process) throw std::logic_error("this engine belongs to the process before fork(); make a new one");
  }
};

std::vector<std::string> Engine::instruction_sets() {
  std::vector<std::string> names;
  for (const SelfTest& test : self_tests())
    if (test.passed() && test.name != "reference" && test.name != "scalar") names.push_back(test.name);
  return names;
}
std::vector<std::string> Engine::backends() {
  std::vector<std::string> names{"cpu", "reference"};
  if (cuda::device_info().present) names.push_back("cuda");
  return names;
}

namespace {

void check_devices(const Engine::Options& options) {
  if (options.devices.empty()) return;
  if (options.backend != "auto" && options.backend != "cuda")
    throw std::invalid_argument("devices: backend '" + options.backend + "' uses none");
  const cuda::DeviceInfo& info = cuda::device_info();
  std::vector<int> seen;
  for (const int device : options.devices) {
    if (!info.present)
      throw std::runtime_error("devices: " + std::to_string(device) + " is not there (" + info.reason + ")");
    if (device < 0 || device >= info.count)
      throw std::runtime_error(
          "devices: " + std::to_string(device) + " is not there; there " +
          (info.count == 1 ? "is one, number 0"
                           : "are " + std::to_string(info.count) + ", 0 to " + std::to_string(info.count - 1)));
    if (std::find(seen.begin(), seen.end(), device) != seen.end())
      throw std::invalid_argument("devices: " + std::to_string(device) + " is named twice");
    seen.push_back(device);
  }
}

}  // namespace

Engine::Engine(Scene scene, const Options& options) {
  const FpEnvironment environment;
  static constexpr std::array kBackends{"auto", "cpu", "cuda", "reference"};
  if (std::find(kBackends.begin(), kBackends.end(), options.backend) == kBackends.end())
    throw std::invalid_argument("backend: expected auto, cpu, cuda or reference, got '" + options.backend + "'");
  if (options.backend == "cuda" && !cuda::device_info().present)
    throw std::runtime_error("backend 'cuda' is not there (" + cuda::device_info().reason +
                             "); there are: auto, cpu, reference");
  if (options.threads < 0 || options.threads > 4096)
    throw std::invalid_argument("threads: expected 0 (all cores) to 4096, got " + std::to_string(options.threads));
  impl_ = std::make_unique<Impl>(std::move(scene), options);
  impl_->reference = options.backend == "reference";
  impl_->lanes =
      options.self_test ? &passed_lane_kernel(options.instruction_set) : &lane_kernel(options.instruction_set);
  impl_->near_by = near_by_name(options.broad_phase);
  const std::vector<Body>& bodies = impl_->scene.bodies();
  impl_->light = !impl_->reference &&
                 std::all_of(bodies.begin(), bodies.end(), [](const Body& b) { return b.pieces.size() <= 1; });
  check_devices(options);
  if (impl_->options.threads == 0) impl_->options.threads = omp_get_num_procs();
  const bool both = options.backend == "auto" && !bodies.empty() && cuda::device_info().present;
  const bool wanted = options.backend == "cuda" || both;
  if (const SelfTest* test = wanted && options.self_test ? &cuda::device_self_test(options.devices) : nullptr;
      test && !test->passed())
    impl_->refused_device =
        "backend 'cuda' computes wrongly on this machine, says the self-test (" + test->first_wrong + ")";
  if (options.backend == "cuda" && !impl_->refused_device.empty()) throw std::runtime_error(impl_->refused_device);
  if (wanted && impl_->refused_device.empty()) {
    cuda::DeviceBackend::Options device;
    if (options.device_memory > 0) device.memory_limit = options.device_memory;
    device.fallback = options.device_fallback;
    device.devices = options.devices;
    impl_->device = std::make_unique<cuda::DeviceBackend>(impl_->scene, device);
    if (both && impl_->device->usable()) impl_->router = std::make_unique<cuda::Router>(impl_->options.threads);
  }
}

Engine::~Engine() = default;

const Scene& Engine::scene() const {
  return impl_->scene;
}
std::uint64_t Engine::scene_revision() const {
  return impl_->poses.snapshot()->scene_revision;
}
std::string_view Engine::backend() const {
  return impl_->reference                             ? "reference"
         : !impl_->device || !impl_->device->usable() ? "cpu"
         : impl_->router                              ? "auto"
                                                      : "cuda";
}
std::string Engine::device_error() const {
  return impl_->device ? impl_->device->error() : impl_->refused_device;
}
std::string_view Engine::instruction_set() const {
  return impl_->lanes->name;
}
std::uint64_t Engine::pose_revision() const {
  return impl_->poses.snapshot()->revision;
}

PoseUpdateResult Engine::set_poses(std::span<const BodyPose> poses, std::int64_t stamp_ns, std::int64_t sequence,
                                   std::uint64_t publisher) {
  const FpEnvironment environment;
  const PoseUpdateResult result = impl_->poses.set(poses, stamp_ns, sequence, publisher);
  count_copied(result.copied_bytes);
  impl_->pose_updates.fetch_add(result.applied, std::memory_order_relaxed);
  impl_->bad_poses.fetch_add(result.bad, std::memory_order_relaxed);
  return result;
}

PoseUpdateResult Engine::set_joints(std::span<const JointPosition> positions, std::int64_t stamp_ns,
                                    std::int64_t sequence, std::uint64_t publisher) {
  const FpEnvironment environment;
  const PoseUpdateResult result = impl_->poses.set_joints(positions, stamp_ns, sequence, publisher);
  impl_->joint_updates.fetch_add(result.applied, std::memory_order_relaxed);
  impl_->bad_joints.fetch_add(result.bad, std::memory_order_relaxed);
  return result;
}

PoseUpdateResult Engine::set_points(std::uint32_t body, std::span<const CloudPoint> points,
                                    std::optional<double> radius, std::int64_t stamp_ns, std::int64_t sequence,
                                    std::uint64_t publisher) {
  const FpEnvironment environment;
  const PoseUpdateResult result = impl_->poses.set_points(body, points, radius, stamp_ns, sequence, publisher);
  count_copied(result.copied_bytes);
  impl_->point_updates.fetch_add(1, std::memory_order_relaxed);
  return result;
}

JointState Engine::joint_state(std::uint32_t joint) const {
  const auto snapshot = impl_->poses.snapshot();
  if (joint >= impl_->scene.joints().size()) throw std::out_of_range("unknown joint " + std::to_string(joint));
  const PoseSnapshot::Joints& joints = snapshot->joints;
  const SceneJoint& of = impl_->scene.joints()[joint];
  const std::uint8_t fact =
      position_fact(impl_->scene.robots()[of.robot]->model.columns[of.column], joints.position[joint]);
  const Status status = !joints.given[joint] ? Status::kNoPose : fact & kLinkBad ? Status::kBadPose : Status::kOk;
  return {joints.position[joint], status, joints.given[joint] && (fact & kLinkBeyondLimits), joints.stamp_ns[joint],
          joints.receipt_ns[joint]};
}

void Engine::check_stamp(std::int64_t stamp_ns) const {
  impl_->poses.check_stamp(stamp_ns);
}

PoseUpdateResult Engine::attach(std::uint32_t child, std::uint32_t parent, const Pose* X_pc,
                                std::span<const std::uint32_t> allow) {
  const FpEnvironment environment;
  return impl_->poses.attach(child, parent, X_pc, allow);
}

PoseUpdateResult Engine::allow(std::uint32_t a, std::uint32_t b, bool allow) {
  const FpEnvironment environment;
  return impl_->poses.allow(a, b, allow);
}

bool Engine::ids_valid_since(std::uint64_t scene_revision, std::span<const std::uint32_t> selectors,
                             bool with_parents) const {
  const auto snapshot = impl_->poses.snapshot();
  return scene_revision == snapshot->scene_revision ||
         snapshot->history->ids_valid_since(scene_revision, snapshot->scene_changes, selectors, with_parents);
}

bool Engine::joints_still_mean(std::uint64_t scene_revision, std::span<const std::uint32_t> joints) const {
  if (scene_revision == impl_->poses.snapshot()->scene_revision) return true;
  std::vector<std::uint32_t> links;  // each of a robot stands for all of its joints
  for (const std::uint32_t joint : joints) {
    if (joint >= impl_->scene.joints().size()) return false;
    const SceneRobot& robot = *impl_->scene.robots()[impl_->scene.joints()[joint].robot];
    links.push_back(robot.bodies[robot.model.base]);
  }
  return ids_valid_since(scene_revision, links, false);
}

void Engine::take_poses(const Engine& old) {
  const FpEnvironment environment;
  impl_->poses.take_over(old.impl_->poses);
}

BodyState Engine::body_state(std::uint32_t body) const {
  const auto snapshot = impl_->poses.snapshot();
  if (body >= snapshot->placed.size()) throw std::out_of_range("unknown body " + std::to_string(body));
  const BodyPlacement& p = snapshot->placed[body];
  std::int64_t receipt = snapshot->receipt_ns[body];
  if (const ReceivedPoints* points = snapshot->points_of(body); points && points->receipt_ns)
    receipt = receipt ? std::min(receipt, points->receipt_ns) : points->receipt_ns;
  return {p.pose.X_wb, p.status, snapshot->parent[body], snapshot->stamp_ns[body], receipt};
}

std::int64_t Engine::oldest_stamp(std::uint32_t bodies) const {
  const auto snapshot = impl_->poses.snapshot();
  const std::vector<Group>& groups = impl_->scene.groups();
  const bool is_group = bodies != kEveryBody && (bodies & kGroupBit);
  if (is_group && (bodies & ~kGroupBit) >= groups.size())
    throw QueryError(QueryErrorCode::kBadQuery, "wait_for: unknown group " + std::to_string(bodies & ~kGroupBit));
  if (!is_group && bodies != kEveryBody && bodies >= snapshot->stamp_ns.size())
    throw QueryError(QueryErrorCode::kBadQuery, "wait_for: unknown body " + std::to_string(bodies));
  units_of_this_thread += (is_group ? groups[bodies & ~kGroupBit].bodies.size() : snapshot->stamp_ns.size()) / 64;
  std::int64_t oldest = 0;
  const auto look = [&](std::int64_t stamp) {
    if (stamp != 0 && (oldest == 0 || stamp < oldest)) oldest = stamp;
  };
  if (is_group)
    for (const std::uint32_t b : groups[bodies & ~kGroupBit].bodies) look(snapshot->stamp_ns[b]);
  else if (bodies == kEveryBody)
    for (const std::int64_t stamp : snapshot->stamp_ns) look(stamp);
  else
    look(snapshot->stamp_ns[bodies]);
  return oldest;
}

QuerySize Engine::size(const QueryView& query) const {
  const FpEnvironment environment;
  const auto snapshot = impl_->poses.snapshot();
  return make_plan(query, Impl::scene_of(*snapshot, query.model), snapshot, impl_->options.max_rows, false).size;
}

std::vector<BodyPair> Engine::pairs(const QueryView& query) const {
  const FpEnvironment environment;
  const auto snapshot = impl_->poses.snapshot();
  const Plan plan = make_plan(for_pairs(query), *snapshot->scene, snapshot, impl_->options.max_rows, false);
  std::vector<BodyPair> pairs(plan.pairs.size());
  plan.pairs.copy(0, pairs.size(), pairs.data());
  return pairs;
}

std::vector<double> Engine::free_scale(const QueryView& query, std::span<const double> weights) const {
  QueryView asked = query;
  asked.reduce = Reduce::kAny;
  asked.format = Format::kFull;
  asked.fields = kFieldFreeScale;
  asked.weights = weights;
  PreparedQuery prepared = prepare(asked);
  std::vector<double> scales(prepared.size().rows);
  ReplyView reply;
  reply.rows = scales.size();
  reply.free_scale = scales.data();
  Job job = start(std::move(prepared), reply);
  while (!job.advance()) {
  }
  return scales;
}

PreparedQuery Engine::begin_preparing(const QueryView& query) const {
  const FpEnvironment environment;
  const auto snapshot = impl_->poses.snapshot();
  const bool is_kept = impl_->keeps_job_of(query);
  if (is_kept)
    if (Job::StatePtr again = impl_->kept.take(query, snapshot)) return PreparedQuery(std::move(again));
  return PreparedQuery(std::make_unique<Planner>(query, Impl::scene_of(*snapshot, query.model), snapshot,
                                                 impl_->options.max_rows, true, is_kept));
}

PreparedQuery Engine::prepare(const QueryView& query) const {
  PreparedQuery prepared = begin_preparing(query);
  prepared.advance();
  return prepared;
}

Job Engine::start(const QueryView& query, const ReplyView& reply) const {
  return start(prepare(query), reply);
}

namespace {

// Job makers of the CPU by kind of query. The first that matches makes the job.
struct CpuJobKind {
  bool (*matches)(const QueryView&);
  std::unique_ptr<Job::State> (*make)(const JobContext&, Plan, const ReplyView&);
};
constexpr CpuJobKind kCpuJobKinds[] = {
    {[](const QueryView& query) { return query.max_steps > 0; }, make_motion_job},
    {[](const QueryView& query) { return (query.fields & kFieldFreeScale) != 0; }, make_free_scale_job},
    {[](const QueryView&) { return true; }, make_cpu_job},
};

std::unique_ptr<Job::State> make_job_on_cpu(const JobContext& context, Plan plan, const ReplyView& reply) {
  const auto kind = std::find_if(std::begin(kCpuJobKinds), std::end(kCpuJobKinds),
                                 [&](const CpuJobKind& one) { return one.matches(plan.query); });
  return kind->make(context, std::move(plan), reply);
}

}  // namespace

Job Engine::start(PreparedQuery query, const ReplyView& reply) const {
  const FpEnvironment environment;
  impl_->check_process();
  const std::uint64_t rows = query.size().rows;
  if (rows > reply.rows)  // an attachment since size() was asked can make more pairs
    throw QueryError(QueryErrorCode::kWrongScene, "the answer needs " + std::to_string(rows) +
                                                      " rows and there is room for " + std::to_string(reply.rows) +
                                                      ": ask for its size again");
  impl_->queries.fetch_add(1, std::memory_order_relaxed);
  if (query.again_) {
    query.again_->begin_again(reply);
    return Job(std::move(query.again_));
  }
  Plan plan = std::move(query.planner_->plan());
  const JobContext context = impl_->context(Impl::scene_of(*plan.snapshot, plan.query.model));
  const Impl::Route route = impl_->route_of(plan, *context.scene, query.keep_on_cpu_);
  std::unique_ptr<Job::State> state;
  if (route.to_device) state = cuda::make_device_job(context, plan, reply);
  if (!state) state = make_job_on_cpu(context, std::move(plan), reply);
  if (route.router)
    state->when_done = [route](const ReplyInfo& info, std::chrono::nanoseconds took) {
      route.router->learn(route.kind, route.pairs, info.backend == "cuda", took);
    };
  return Job(Job::StatePtr(state.release()));
}

std::unique_ptr<DevicePlan> Engine::plan_on_device(const QueryView& query) const {
  const FpEnvironment environment;
  impl_->check_process();
  const auto snapshot = impl_->poses.snapshot();
  return cuda::make_device_plan(impl_->context(Impl::scene_of(*snapshot)),
                                make_plan(query, *snapshot->scene, snapshot, impl_->options.max_rows, false));
}

CertificateRun Engine::begin_certificate(const QueryView& query, CertificateRows rows) const {
  const FpEnvironment environment;
  impl_->check_process();
  const auto snapshot = impl_->poses.snapshot();
  return {impl_->context(Impl::scene_of(*snapshot)),
          snapshot,
          query,
          std::move(rows),
          impl_->options.max_rows,
          make_motion_certificate};
}

std::string Engine::certificate(const QueryView& query, std::optional<std::span<const std::uint64_t>> rows) const {
  CertificateRows asked;
  if (rows) asked.numbers.emplace(rows->begin(), rows->end());
  CertificateRun run = begin_certificate(query, std::move(asked));
  while (!run.advance()) {
  }
  const std::vector<std::byte> text = run.take();
  return {reinterpret_cast<const char*>(text.data()), text.size()};
}

const std::uint64_t Engine::kMostWarmBytes = WarmStore::kMostSimplices * sizeof(WarmSimplex);

std::uint64_t Engine::warm_bytes(const QueryView& query, const QuerySize& size) {
  if (query.warm_slot == 0 || query.reduce != Reduce::kNone) return 0;
  const std::uint64_t simplices = size.configurations * size.pairs;
  return simplices > WarmStore::kMostSimplices ? 0 : simplices * sizeof(WarmSimplex);
}

std::uint64_t Engine::contradictions() const {
  return impl_->contradictions;
}

std::shared_ptr<void> Engine::trim_warm(std::uint64_t client, std::uint64_t room) const {
  return impl_->warm.trim(client, room);
}

namespace {

// How old the poses are, and how many bodies have none to answer for. Static bodies need no pose.
void append_ages(Counters& counters, const PoseSnapshot& snapshot) {
  std::uint64_t missing = 0, bad = 0;
  std::int64_t newest = 0, oldest = 0;
  for (std::size_t b = 0; b < snapshot.placed.size(); ++b) {
    const Body& body = snapshot.scene->bodies()[b];
    if (!body.pieces.empty() || is_cloud(body)) {  // else it is a frame, which no pair has
      missing += snapshot.placed[b].status == Status::kNoPose;
      bad += snapshot.placed[b].status == Status::kBadPose;
    }
    const std::int64_t receipt = snapshot.receipt_ns[b];
    if (receipt == 0) continue;
    newest = std::max(newest, receipt);
    oldest = oldest == 0 ? receipt : std::min(oldest, receipt);
  }
  counters.emplace_back("engine.bodies_without_pose", missing);
  counters.emplace_back("engine.bodies_with_bad_pose", bad);
  if (oldest == 0) return;
  const std::int64_t now = monotonic_ns();
  counters.emplace_back("engine.newest_pose_age_ns",
                        static_cast<std::uint64_t>(std::max<std::int64_t>(now - newest, 0)));
  counters.emplace_back("engine.oldest_pose_age_ns",
                        static_cast<std::uint64_t>(std::max<std::int64_t>(now - oldest, 0)));
}

}  // namespace

Counters Engine::stats() const {
  const auto snapshot = impl_->poses.snapshot();
  std::uint64_t vertices = 0, pieces = 0, points = 0;
  for (const Body& body : snapshot->scene->bodies()) {
    points += point_count(body);
    for (const PiecePtr& piece : body.pieces) {
      ++pieces;
      vertices += piece->vertices.size();
    }
  }
  Counters counters{{"engine.bodies", impl_->scene.bodies().size()},
                    {"engine.pieces", pieces},
                    {"engine.warm_bytes", impl_->warm.bytes()},
                    {"engine.warm_without_room", impl_->warm.without_room()},
                    {"engine.box_trees", impl_->trees.builds()},
                    {"engine.box_tree_bytes", impl_->trees.bytes()},
                    {"engine.vertices", vertices},
                    {"engine.pairs", snapshot->pairs->size()},
                    {"engine.threads", static_cast<std::uint64_t>(impl_->options.threads)},
                    {"engine.teams", impl_->teams},
                    {"engine.queries", impl_->queries},
                    {"engine.queries_asked_again", impl_->kept.asked_again()},
                    {"engine.pairs_evaluated", impl_->pairs_evaluated},
                    {"engine.contradictions", impl_->contradictions},
                    {"engine.pose_revision", snapshot->revision},
                    {"engine.pose_updates", impl_->pose_updates},
                    {"engine.bad_poses", impl_->bad_poses},
                    {"engine.joint_updates", impl_->joint_updates},
                    {"engine.bad_joints", impl_->bad_joints},
                    {"engine.point_updates", impl_->point_updates},
                    {"engine.points", points},
                    {"engine.stamps_out_of_range", impl_->poses.stamps_out_of_range()},
                    {"engine.stamps_late", impl_->poses.stamps_late()}};
  append_ages(counters, *snapshot);
  if (impl_->device) impl_->device->append(counters);
  if (impl_->router) impl_->router->append(counters);
  return counters;
}

QueryCost Engine::extent(const QueryView& query) const {
  const SceneCost& bulk = query.model == Model::kPieces ? impl_->bulk_by_pieces : impl_->bulk;
  return bulk.of(query, *impl_->poses.snapshot());
}
bool Engine::has_cpu() const {
  return !impl_->device || impl_->router;
}

}  // namespace clearance
