// Members of the installed Engine.
#pragma once

#include <memory>
#include <mutex>
#include <optional>

#include "engine/api/background.h"
#include "engine/api/conversions.h"
#include "engine/api/engine.h"
#include "engine/editor/scene_editor.h"
#include "engine/engine.h"
#include "engine/query/recent_queries.h"

namespace clearance {

struct Engine::Impl {
  Impl(engine::Scene scene, const engine::Engine::Options& options) : editor(std::move(scene), options) {}

  /// The present engine. A call that uses several of its functions holds it, so that they see one scene.
  std::shared_ptr<engine::Engine> engine() const { return editor.engine(); }

  /// Memory and jobs of a query's last run, for the next one.
  struct LastRun {
    std::shared_ptr<ResultMemory> memory;  ///< if no other result refers to it
    std::shared_ptr<JobPool> jobs;         ///< null if the query may not repeat
    std::weak_ptr<engine::Engine> engine;
    std::optional<Job> job;  ///< of that engine, to answer again; returns to `jobs` when it cannot
  };
  /// Answers a query.
  Result run(const QueryView& query, LastRun& last) const;
  /// Starts a query in the background.
  static Pending submit(const std::shared_ptr<Impl>& self, const QueryView& query, WhenDone when_done);
  /// Opens a device query.
  /// \param query with the number of its configurations
  static DeviceQuery on_device(const std::shared_ptr<Impl>& self, const QueryView& query);
  /// Jobs of a query, which all who prepare it share; null if it may not repeat.
  std::shared_ptr<JobPool> jobs_of(const QueryView& query) const {
    const std::lock_guard lock(recent_mutex);
    return JobPool::allows(query) ? recent.pool_of(query, engine()->scene().bodies().size()) : nullptr;
  }
  /// The joints, of which only the limits are valid.
  std::shared_ptr<const JointsInfo> joint_limits() const;

  SceneEditor editor;
  mutable std::mutex limits_mutex;
  mutable std::shared_ptr<const JointsInfo> limits;
  Background background;
  mutable std::mutex recent_mutex;
  mutable RecentQueries recent{8};  // jobs of concurrent runs of each prepared query

  struct Request;
  struct Prepared;
  struct OpenDevice;
};

}  // namespace clearance
