#include "engine/editor/scene_editor.h"

#include <chrono>

namespace clearance {

namespace {

/// Stops the updates of an engine, and accepts them again unless another engine took over.
class StoppedUpdates {
 public:
  explicit StoppedUpdates(engine::Engine& engine) : engine_(&engine) { engine_->stop_updates(true); }
  ~StoppedUpdates() {
    if (engine_) engine_->stop_updates(false);
  }
  StoppedUpdates(const StoppedUpdates&) = delete;
  StoppedUpdates& operator=(const StoppedUpdates&) = delete;
  void keep() { engine_ = nullptr; }

 private:
  engine::Engine* engine_;
};

}  // namespace

std::shared_ptr<engine::Engine> SceneEditor::engine() const {
  const std::lock_guard lock(current_);
  return engine_;
}

SceneEditor::Change SceneEditor::add(const std::function<AddedBody(const engine::Engine&)>& make) {
  std::string name;
  Change done = change({[&](const engine::Engine& now, SceneParts& parts) {
    parts.added.push_back(make(now));
    name = parts.added.back().body.name;
  }});
  done.body = done.engine->scene().find_body(name);
  return done;
}

SceneEditor::Change SceneEditor::remove(const std::string& name) {
  return change({[&](const engine::Engine&, SceneParts& parts) { parts.remove(name); }, name});
}

SceneEditor::Change SceneEditor::reshape(const std::string& name, const NewShape& shape, double radius) {
  Change done =
      change({[&](const engine::Engine&, SceneParts& parts) { parts.reshape(name, shape, radius); }, {}, name});
  done.body = done.engine->scene().find_body(name);
  return done;
}

SceneEditor::Change SceneEditor::change(const Edit& edit) {
  const auto begin = std::chrono::steady_clock::now();
  const std::lock_guard one_at_a_time(edits_);
  const std::shared_ptr<engine::Engine> now = engine();
  SceneParts parts = parts_;
  if (!parts.loaded) parts.loaded = std::make_shared<const engine::Scene>(now->scene());
  std::shared_ptr<engine::Engine> next;
  try {
    edit.apply(*now, parts);
    engine::Engine::Options options = options_;
    options.cover_store = now->cover_store();
    options.joint_table_store = now->joint_table_store();
    next = std::make_shared<engine::Engine>(parts.whole(), options);
  } catch (const engine::SceneError& error) {
    throw engine::QueryError(QueryErrorCode::kBadQuery, error.what());
  }
  replace(next, edit);
  parts_ = std::move(parts);
  return {next, kNone, std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count()};
}

void SceneEditor::replace(std::shared_ptr<engine::Engine> next, const Edit& edit) {
  const std::lock_guard lock(takeover_);
  StoppedUpdates stopped(*engine_);  // only this function replaces it
  const std::string why = why_not_removed(engine_->scene(), edit.removed,
                                          [this](std::uint32_t body) { return engine_->body_state(body).parent; });
  if (!why.empty()) throw engine::QueryError(QueryErrorCode::kBadQuery, why);
  next->take_poses(*engine_, edit.reshaped);
  stopped.keep();
  const std::lock_guard pointer(current_);
  address_ = next.get();
  engine_.swap(next);
}

}  // namespace clearance
