#include "engine/engine.h"

#include <omp.h>

#include <algorithm>
#include <array>
#include <iterator>
#include <stdexcept>

#include "engine/base/fp_environment.h"
#include "engine/certificate/motion_certificate.h"
#include "engine/device/device_self_test.h"
#include "engine/device/query/device_plan.h"
#include "engine/engine_impl.h"
#include "engine/motion/free_scale.h"
#include "engine/motion/motion_job.h"
#include "engine/narrow/self_test.h"
#include "engine/selection/plan.h"

namespace clearance::engine {

Engine::Impl::Route Engine::Impl::route_of(const Plan& plan, bool keep_on_cpu) const {
  Route route{cuda::kind_of(plan.query), plan.size.configurations * plan.size.pairs, false, nullptr};
  const bool may_fall_back = router || options.device_fallback;
  if (may_fall_back && (keep_on_cpu || !cuda::beyond_the_device(plan).empty())) return route;
  route.router = router.get();
  route.to_device = device && (!router || router->to_device(route.kind, route.pairs));
  return route;
}

bool Engine::Impl::keeps(const JobPool& pool, const QuerySize& size) const {
  return JobPool::allows(size, device ? JobPool::kSmall : pool.most_rows());
}

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
  impl_->light =
      !impl_->reference && std::all_of(bodies.begin(), bodies.end(), [](const Body& b) { return b.parts.size() <= 1; });
  check_devices(options);
  if (impl_->options.threads == 0) impl_->options.threads = omp_get_num_procs();
  const bool both = options.backend == "auto" && !bodies.empty() && cuda::device_info().present;
  const bool wanted = options.backend == "cuda" || both;
  if (const SelfTest* test = wanted && options.self_test ? &cuda::device_self_test(options.devices) : nullptr;
      test && !test->passed())
    impl_->rejected_device = "backend 'cuda' fails the self-test on this machine (" + test->first_wrong + ")";
  if (options.backend == "cuda" && !impl_->rejected_device.empty()) throw std::runtime_error(impl_->rejected_device);
  if (wanted && impl_->rejected_device.empty()) {
    cuda::DeviceBackend::Options device;
    if (options.device_memory > 0) device.memory_limit = options.device_memory;
    device.fallback = options.device_fallback;
    device.devices = options.devices;
    impl_->device = std::make_unique<cuda::DeviceBackend>(impl_->scene, device);
    if (both && impl_->device->usable()) impl_->router = std::make_unique<cuda::Router>(impl_->options.threads);
  }
  if (options.covers == Covers::kOff) return;
  impl_->covers = options.cover_store ? options.cover_store : std::make_shared<CoverStore>();
  impl_->tables = options.joint_table_store ? options.joint_table_store : std::make_shared<JointTableStore>();
  impl_->request_covers();
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
  return impl_->device ? impl_->device->error() : impl_->rejected_device;
}
std::string_view Engine::instruction_set() const {
  return impl_->lanes->name;
}
std::uint64_t Engine::pose_revision() const {
  return impl_->poses.snapshot()->revision;
}

QuerySize Engine::size(const QueryView& query) const {
  const FpEnvironment environment;
  const auto snapshot = impl_->poses.snapshot();
  return make_plan(query, *snapshot->scene, snapshot, impl_->options.max_rows, false).size;
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
  QueryView scale_query = query;
  scale_query.reduce = Reduce::kAny;
  scale_query.fields = kFieldFreeScale;
  scale_query.weights = weights;
  PreparedQuery prepared = prepare(scale_query);
  std::vector<double> scales(prepared.size().rows);
  ReplyView reply;
  reply.rows = scales.size();
  reply.free_scale = scales.data();
  Job job = start(std::move(prepared), reply);
  while (!job.advance()) {
  }
  return scales;
}

PreparedQuery Engine::begin_preparing(const QueryView& query, const std::shared_ptr<JobPool>& given) const {
  auto snapshot = impl_->poses.snapshot();
  std::shared_ptr<JobPool> pool = impl_->pool_of(query, given);
  if (pool)
    if (Job::StatePtr kept = pool->take(query, snapshot)) {
      impl_->repeated.fetch_add(1, std::memory_order_relaxed);
      kept->pool = std::move(pool);
      return PreparedQuery(std::move(kept));
    }
  const FpEnvironment environment;
  std::unique_ptr<Planner> planner = pool ? pool->take_plan(query, snapshot) : nullptr;
  if (!planner) planner = std::make_unique<Planner>(query, *snapshot->scene, snapshot, impl_->options.max_rows, true);
  if (impl_->device && !impl_->router && !impl_->options.device_fallback)
    cuda::reject_beyond_the_device(planner->plan());
  PreparedQuery prepared(std::move(planner));
  prepared.pool_ = std::move(pool);
  return prepared;
}

void Engine::plan_ahead(const QueryView& query, const std::shared_ptr<JobPool>& pool) const {
  const FpEnvironment environment;
  const auto snapshot = impl_->poses.snapshot();
  auto planner = std::make_unique<Planner>(query, *snapshot->scene, snapshot, impl_->options.max_rows, false);
  WorkMeter unlimited;
  planner->advance(unlimited);
  units_of_this_thread += unlimited.spent();
  if (pool && impl_->keeps(*pool, planner->plan().size)) pool->keep_plan(std::move(planner));
}

bool Engine::has_job(const QueryView& query, const std::shared_ptr<JobPool>& pool) const {
  return pool && pool->has(query.configuration_count, impl_->poses.snapshot());
}

PreparedQuery Engine::prepare(const QueryView& query, const std::shared_ptr<JobPool>& pool) const {
  PreparedQuery prepared = begin_preparing(query, pool);
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
    {[](const QueryView& query) { return query.max_evaluations > 0; }, make_motion_job},
    {[](const QueryView& query) { return (query.fields & kFieldFreeScale) != 0; }, make_free_scale_job},
    {[](const QueryView&) { return true; }, make_cpu_job},
};

std::unique_ptr<Job::State> make_job_on_cpu(const JobContext& context, Plan plan, const ReplyView& reply) {
  const auto kind = std::find_if(std::begin(kCpuJobKinds), std::end(kCpuJobKinds),
                                 [&](const CpuJobKind& one) { return one.matches(plan.query); });
  return kind->make(context, std::move(plan), reply);
}

}  // namespace

std::uint64_t Engine::list_bytes(const PreparedQuery& query) const {
  const Plan& plan = query.plan();
  const auto threads = static_cast<std::uint64_t>(impl_->options.threads);
  return plan.query.k > 0 ? plan.size.pairs * kBytesOfNearest * std::min(threads, plan.size.configurations) : 0;
}

Job Engine::start(PreparedQuery query, const ReplyView& reply) const {
  const FpEnvironment environment;
  impl_->check_process();
  const std::uint64_t rows = query.size().rows;
  if (rows > reply.rows)  // an attachment after size() can make more pairs
    throw QueryError(QueryErrorCode::kWrongScene, "the answer needs " + std::to_string(rows) +
                                                      " rows and there is room for " + std::to_string(reply.rows) +
                                                      ": query its size again");
  impl_->queries.fetch_add(1, std::memory_order_relaxed);
  if (query.kept_) {
    query.kept_->reset(reply);
    return Job(std::move(query.kept_));
  }
  Plan plan = std::move(query.planner_->plan());
  const JobContext context = impl_->context(*plan.snapshot->scene);
  const bool keeps = query.pool_ && impl_->keeps(*query.pool_, plan.size);
  const Impl::Route route = impl_->route_of(plan, query.keep_on_cpu_ || keeps);
  std::unique_ptr<Job::State> state;
  if (route.to_device) state = cuda::make_device_job(context, plan, reply);
  if (!state) state = make_job_on_cpu(context, std::move(plan), reply);
  if (keeps && state->repeatable_plan()) state->pool = std::move(query.pool_);
  if (route.router)
    state->when_done = [route](const ReplyInfo& info, std::chrono::nanoseconds took) {
      route.router->learn(route.kind, route.pairs, info.backend == "cuda", took);
    };
  return Job(Job::StatePtr(state.release()));
}

bool Engine::answer_again(Job& job, const QueryView& query, const ReplyView& reply) const {
  const FpEnvironment environment;
  impl_->check_process();
  Job::State& state = *job.state_;
  if (state.repeatable_plan()->query.configuration_count != query.configuration_count || !state.is_whole) return false;
  std::shared_ptr<const PoseSnapshot> snapshot = impl_->poses.same(state.kept_for);
  if (!snapshot) return false;
  state.take(query, snapshot);
  impl_->answered_again.fetch_add(1, std::memory_order_relaxed);
  state.reset(reply);
  while (!state.advance({})) {
  }
  units_of_this_thread += state.units;
  state.rest();
  return true;
}

std::unique_ptr<DevicePlan> Engine::plan_on_device(const QueryView& query) const {
  const FpEnvironment environment;
  impl_->check_process();
  const auto snapshot = impl_->poses.snapshot();
  return cuda::make_device_plan(impl_->context(*snapshot->scene),
                                make_plan(query, *snapshot->scene, snapshot, impl_->options.max_rows, false));
}

CertificateRun Engine::begin_certificate(const QueryView& query, CertificateRows rows) const {
  const FpEnvironment environment;
  impl_->check_process();
  const auto snapshot = impl_->poses.snapshot();
  return {impl_->context(*snapshot->scene), snapshot, query, std::move(rows), impl_->options.max_rows,
          make_motion_certificate};
}

std::string Engine::certificate(const QueryView& query, std::optional<std::span<const std::uint64_t>> rows) const {
  CertificateRows selected;
  if (rows) selected.numbers.emplace(rows->begin(), rows->end());
  CertificateRun run = begin_certificate(query, std::move(selected));
  while (!run.advance()) {
  }
  const std::vector<std::byte> text = run.take();
  return {reinterpret_cast<const char*>(text.data()), text.size()};
}

std::uint64_t Engine::contradictions() const {
  return impl_->contradictions;
}

QueryCost Engine::cost(const QueryView& query) const {
  return impl_->scene_cost.of(query, *impl_->poses.snapshot());
}
bool Engine::has_cpu() const {
  return !impl_->device || impl_->router;
}

}  // namespace clearance::engine
