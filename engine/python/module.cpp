// Module clearance._engine: scene and engine in this process, wrapped by clearance/_front/engine.py.
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/string_view.h>
#include <nanobind/stl/unique_ptr.h>
#include <nanobind/stl/vector.h>

#include <chrono>
#include <limits>
#include <utility>

#include "client/python/bindings/gil.h"
#include "engine/engine.h"
#include "engine/python/device_plan_binding.h"
#include "engine/python/path_binding.h"
#include "engine/python/running_query.h"
#include "engine/python/scene_bindings.h"
#include "engine/python/update_binding.h"

namespace clearance::python {
namespace {

/// Interval at which a long call tests for Ctrl-C.
constexpr std::chrono::milliseconds kSignalPeriod{50};

using RowNumbers = nb::ndarray<const std::uint64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

class PyEngine : public PyUpdates {
 public:
  PyEngine(const engine::Scene& scene, const std::string& backend, int threads, std::uint64_t max_rows,
           std::uint64_t device_memory, bool device_fallback, const std::vector<int>& devices,
           const std::string& covers) {
    engine::Engine::Options options;
    options.backend = backend;
    options.threads = threads;
    options.max_rows = max_rows;
    options.device_memory = device_memory;
    options.device_fallback = device_fallback;
    options.devices = devices;
    options.covers = engine::covers_named(covers);
    open(scene, options);
  }

  std::unique_ptr<PyJob> start(const RepeatedQuery& query, std::optional<PosesArray> poses,
                               std::optional<PositionsArray> positions) const {
    const Configurations at{std::move(poses), std::move(positions)};
    const GilRelease release;
    return std::make_unique<PyJob>(begin_query(use(), guard_, query, view_of(query, at)));
  }

  /// Returns the answer, or none after the timeout.
  nb::object answer(const RepeatedQuery& query, std::optional<PosesArray> poses,
                    std::optional<PositionsArray> positions, double timeout_s) const {
    const Configurations at{std::move(poses), std::move(positions)};
    return answer_of(query, view_of(query, at), timeout_s);
  }

  /// The same for positions of joints, and the ends of motions or velocities (RowsOfRun). Returns none also for arrays
  /// that need a conversion.
  nb::object answer_rows(const RepeatedQuery& query, nb::handle first, nb::handle second) const {
    const RowsOfRun rows(query, first, second);
    if (rows.count() == 0 || rows.count() > kMostConfigurations) return nb::none();
    QueryView view = view_of(query);
    view.configuration_count = static_cast<std::uint32_t>(rows.count());
    view.positions = rows.numbers();
    view.velocities = rows.velocities();
    return answer_of(query, view, std::numeric_limits<double>::infinity());
  }

  bool wait_covers(double timeout_s) const {
    const auto start = Clock::now();
    while (true) {
      const double left = timeout_s - 1e-9 * static_cast<double>(nanoseconds_since(start));
      const auto slice = left < 1e-9 * static_cast<double>(std::chrono::nanoseconds(kSignalPeriod).count())
                             ? std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 * std::max(left, 0.0)))
                             : std::chrono::nanoseconds(kSignalPeriod);
      {
        const GilRelease release;
        if (use()->wait_covers(slice)) return true;
      }
      if (slice < kSignalPeriod) return false;
      check_signals();
    }
  }

  /// \param configurations number of configurations; 0 for the current poses
  std::unique_ptr<PyDevicePlan> plan_on_device(const RepeatedQuery& query, std::uint32_t configurations) const {
    QueryView view = view_of(query);
    view.configuration_count = configurations;
    const GilRelease release;
    const std::shared_ptr<engine::Engine> engine = use();
    check_query_ids(*engine, query.scene_revision, view);
    return std::make_unique<PyDevicePlan>(engine, guard_, engine->plan_on_device(view));
  }

  /// Throws QueryError for a query that is invalid with any inputs, by one configuration or motion.
  void check(const RepeatedQuery& query) const {
    QueryView view = view_of(query);
    if (query.bodies || query.joints) view.configuration_count = query.max_evaluations ? query.control_points : 1;
    const GilRelease release;
    const std::shared_ptr<engine::Engine> engine = use();
    check_query_ids(*engine, query.scene_revision, view);
    engine->size(view);
  }

  nb::tuple find_path(const RepeatedQuery& query, const PathSearch& search) const {
    const QueryView view = view_of(query);
    const std::shared_ptr<engine::Engine> engine = use();
    check_query_ids(*engine, query.scene_revision, view);
    return python::find_path(engine, query, view, search);
  }

  nb::object pairs(const RepeatedQuery& query) const {
    auto* pairs = new std::vector<BodyPair>();
    nb::capsule owner(pairs, [](void* p) noexcept { delete static_cast<std::vector<BodyPair>*>(p); });
    {
      const GilRelease release;
      *pairs = use()->pairs(view_of(query));
    }
    return nb::cast(nb::ndarray<nb::numpy, std::uint32_t>(pairs->data(), {pairs->size(), 2}, owner));
  }

  /// \param rows null for all
  std::string certificate(const RepeatedQuery& query, std::optional<PosesArray> poses,
                          std::optional<PositionsArray> positions, const std::optional<RowNumbers>& rows) const {
    const Configurations at{std::move(poses), std::move(positions)};
    const GilRelease release;
    const QueryView view = view_of(query, at);
    const std::shared_ptr<engine::Engine> engine = use();
    check_query_ids(*engine, query.scene_revision, view);
    if (rows) return engine->certificate(view, std::span(rows->data(), rows->shape(0)));
    return engine->certificate(view);
  }

 private:
  // Returns the answer, or none after the timeout.
  nb::object answer_of(const RepeatedQuery& query, const QueryView& view, double timeout_s) const {
    const auto start = Clock::now();
    constexpr std::int64_t kSlice = std::chrono::nanoseconds(kSignalPeriod).count();
    std::optional<PyJob> job;
    bool done = false;
    {
      const GilRelease release;
      job.emplace(begin_query(use(), guard_, query, view));
      done = job->go_on(kSlice, start);
    }
    while (!done) {
      check_signals();
      if (1e-9 * static_cast<double>(nanoseconds_since(start)) > timeout_s) return nb::none();
      const GilRelease release;
      done = job->go_on(kSlice);
    }
    return nb::cast(job->take());
  }
};

}  // namespace

NB_MODULE(_engine, m) {
  nb::set_leak_warnings(false);  // caches at exit() are not leaks
  nb::register_exception_translator([](const std::exception_ptr& p, void*) {
    try {
      std::rethrow_exception(p);
    } catch (const engine::SceneError& e) {
      raise_ours("SceneError", -1, e.what());
    } catch (const engine::QueryError& e) {
      raise_ours("QueryError", static_cast<int>(e.code), e.what());
    }
  });
  bind_query<RepeatedQuery>(m);
  m.attr("OPTIONS") = query_options<QueryView>();
  bind_answer(m);
  bind_scene(m);
  bind_device_plan(m);

  nb::class_<PyJob>(m, "Job").def("advance", &PyJob::advance, nb::arg("budget_ns")).def("answer", &PyJob::take);

  nb::class_<PyEngine> engine(m, "Engine");
  bind_scene_changes(engine);
  bind_updates(engine);
  bind_find_path<RepeatedQuery>(engine);
  engine
      .def(nb::init<const engine::Scene&, const std::string&, int, std::uint64_t, std::uint64_t, bool,
                    const std::vector<int>&, const std::string&>(),
           nb::arg("scene"), nb::arg("backend"), nb::arg("threads"), nb::arg("max_rows"), nb::arg("device_memory"),
           nb::arg("device_fallback"), nb::arg("devices"), nb::arg("covers"))
      .def_prop_ro("device_error", [](const PyEngine& e) { return e.use()->device_error(); })
      .def_static("backends", &engine::Engine::backends)
      .def_prop_ro("backend", [](const PyEngine& e) { return std::string(e.use()->backend()); })
      .def_prop_ro("scene_revision", [](const PyEngine& e) { return e.use()->scene_revision(); })
      .def_prop_ro("pose_revision", [](const PyEngine& e) { return e.use()->pose_revision(); })
      .def("start", &PyEngine::start, nb::arg("query"), nb::arg("poses").noconvert().none(),
           nb::arg("positions").noconvert().none())
      .def("answer_rows", &PyEngine::answer_rows, nb::arg("query"), nb::arg("first").none(),
           nb::arg("second") = nb::none())
      .def("answer", &PyEngine::answer, nb::arg("query"), nb::arg("poses").noconvert().none(),
           nb::arg("positions").noconvert().none(), nb::arg("timeout_s"))
      .def("check", &PyEngine::check, nb::arg("query"))
      .def("pairs", &PyEngine::pairs, nb::arg("query"))
      .def("plan_on_device", &PyEngine::plan_on_device, nb::arg("query"), nb::arg("configurations"))
      .def("certificate", &PyEngine::certificate, nb::arg("query"), nb::arg("poses").none(),
           nb::arg("positions").none(), nb::arg("rows").none())
      .def("wait_covers", &PyEngine::wait_covers, nb::arg("timeout_s"))
      .def("stats", [](const PyEngine& e) { return e.use()->stats(); });
}

}  // namespace clearance::python
