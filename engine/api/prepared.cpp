// Prepared queries of the installed Engine.
#include <type_traits>

#include "engine/api/engine_impl.h"
#include "engine/query/job_pool.h"
#include "wire/api/owned_query.h"
#include "wire/api/query_names.h"

namespace clearance {

struct Engine::Impl::Prepared final : clearance::Prepared::Runner {
  Prepared(std::shared_ptr<Impl> of, const Query& query) : engine(std::move(of)), owned(query) {
    view = view_without_inputs(owned.query);
    const std::shared_ptr<engine::Engine> now = engine->engine();
    view.scene_revision = now->scene_revision();
    static const JointsInfo kNoJoints;
    const std::shared_ptr<const JointsInfo> limits = owned.joints.empty() ? nullptr : engine->joint_limits();
    names = names_in(owned.query, scene_names(*now), limits ? *limits : kNoJoints);
    last.jobs = engine->jobs_of(view);
    // Throws for a query that is invalid with any inputs, by one configuration or motion.
    if (!owned.bodies.empty() || !owned.joints.empty())
      view.configuration_count = view.max_evaluations ? view.control_points : 1;
    if (!now->has_job(view, last.jobs)) translated([&] { now->plan_ahead(view, last.jobs); });
    view.configuration_count = 0;
  }

  Result run(const clearance::Prepared::Inputs& inputs) override {
    take(inputs);
    return in_present_scene([&] { return engine->run(view, last); });
  }

  Pending submit(const clearance::Prepared::Inputs& inputs, WhenDone when_done) override {
    take(inputs);
    return in_present_scene([&] { return Impl::submit(engine, view, when_done); });
  }

  DeviceQuery on_device(std::uint32_t configurations) override {
    return in_present_scene([&] {
      QueryView query = view;
      query.positions = {};
      query.velocities = query.twists = {};
      query.configurations = {};
      query.growths = {};
      query.configuration_count = configurations;
      return Impl::on_device(engine, query);
    });
  }

  bool is_stale() override {
    const std::shared_ptr<engine::Engine> now = engine->engine();
    if (now->scene_revision() == view.scene_revision) return false;
    why = changed_name(names, owned.query, scene_names(*now), joints(*now));
    if (why.empty()) view.scene_revision = now->scene_revision();
    return !why.empty();
  }

 private:
  void take(const clearance::Prepared::Inputs& inputs) {
    owned.query.positions = inputs.positions;
    owned.query.configurations = inputs.configurations;
    owned.query.growths = inputs.growths;
    owned.query.velocities = inputs.velocities;
    owned.query.twists = inputs.twists;
    take_inputs(owned.query, view);
  }
  /// Calls a function, and again if the scene has changed and the ids have kept their meaning.
  template <class F>
  std::invoke_result_t<F> in_present_scene(F&& f) {
    return translated([&] {
      try {
        return f();
      } catch (const engine::QueryError& error) {
        if (error.code != QueryErrorCode::kWrongScene || view.scene_revision == engine->engine()->scene_revision())
          throw;
      }
      if (is_stale())
        throw StaleQuery(static_cast<std::uint16_t>(QueryErrorCode::kWrongScene), "prepared query: " + why);
      return f();
    });
  }
  SceneInfo scene_names(const engine::Engine& now) const {
    const bool names_any = !owned.query.pairs.empty() || !owned.query.margins.empty() || !owned.bodies.empty();
    return names_any ? scene_names_of(now) : SceneInfo();
  }
  JointsInfo joints(const engine::Engine& now) const { return owned.joints.empty() ? JointsInfo() : joints_of(now); }

  const std::shared_ptr<Impl> engine;
  OwnedQuery owned;
  QueryView view;  ///< of `owned`; its scene revision is one in which the ids have their meaning
  QueryNames names;
  LastRun last{};
  std::string why;  ///< what changed, if the query is stale
};

Prepared Engine::prepare(const Query& query) const {
  return clearance::Prepared(std::make_unique<Impl::Prepared>(impl_, query));
}

}  // namespace clearance
