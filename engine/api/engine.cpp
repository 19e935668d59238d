#include "engine/engine.h"

#include "engine/api/engine_impl.h"
#include "engine/api/scene_impl.h"
#include "wire/api/joints_named.h"
#include "wire/api/velocities.h"

namespace clearance {

Engine::Engine(Scene scene, const EngineOptions& options) {
  engine::Engine::Options ours;
  ours.backend = options.backend;
  ours.threads = options.threads;
  ours.devices = options.devices;
  ours.max_rows = options.max_rows;
  ours.device_memory = options.device_memory;
  ours.device_fallback = options.device_fallback;
  ours.covers = engine::covers_named(options.covers);
  impl_ = translated([&] { return std::make_shared<Impl>(std::move(scene.impl_->scene), ours); });
}
Engine::Engine(Engine&&) noexcept = default;
Engine& Engine::operator=(Engine&&) noexcept = default;
Engine::~Engine() = default;

std::vector<std::string> Engine::backends() {
  return engine::Engine::backends();
}
std::string_view Engine::backend() const {
  return impl_->engine()->backend();
}
std::string Engine::device_error() const {
  return impl_->engine()->device_error();
}

SceneInfo Engine::scene() const {
  return scene_info_of(*impl_->engine());
}
std::uint32_t Engine::body(std::string_view name) const {
  const std::shared_ptr<engine::Engine> now = impl_->engine();
  const std::uint32_t id = now->scene().find_body(name);
  if (id == kNone) unknown_name("body", name, now->scene().bodies());
  return id;
}
std::uint32_t Engine::group(std::string_view name) const {
  if (name == "*") return kEveryBody;
  const std::shared_ptr<engine::Engine> now = impl_->engine();
  const std::uint32_t index = now->scene().find_group(name);
  if (index == kNone) unknown_name("group", name, now->scene().groups());
  return index | kGroupBit;
}
Joints Engine::joints(std::string_view group) const {
  return joints_named(*impl_->joint_limits(), group);
}
JointsInfo Engine::joint_states() const {
  return joints_of(*impl_->engine());
}

std::vector<BodyStateInfo> Engine::body_states() const {
  const std::shared_ptr<engine::Engine> engine = impl_->engine();
  std::vector<BodyStateInfo> states(engine->scene().bodies().size());
  for (std::uint32_t id = 0; id < states.size(); ++id) {
    const BodyState s = engine->body_state(id);
    const Pose& X = s.X_wb;
    states[id] = {{X.translation.x, X.translation.y, X.translation.z, X.qw, X.qx, X.qy, X.qz},
                  s.status,
                  s.parent,
                  s.stamp_ns,
                  s.receipt_ns ? monotonic_ns() - s.receipt_ns : -1};
  }
  return states;
}

std::vector<std::pair<std::string, std::uint64_t>> Engine::stats() const {
  const Counters counters = impl_->engine()->stats();
  return {counters.begin(), counters.end()};
}
bool Engine::wait_covers(std::chrono::nanoseconds timeout) const {
  return impl_->engine()->wait_covers(timeout);
}

// --- Updates

namespace {

/// Applies an update of the engine, and describes its result.
template <class F>
UpdateResult updated(SceneEditor& editor, F&& update) {
  return translated([&] {
    return editor.update([&](engine::Engine& engine) {
      const PoseUpdateResult done = update(engine);
      return UpdateResult{done.revision, engine.scene_revision(), done.applied, done.bad, done.unknown, done.fixed};
    });
  });
}

}  // namespace

UpdateResult Engine::set_poses(std::span<const std::pair<std::uint32_t, Pose7>> poses, std::int64_t stamp_ns,
                               std::int64_t sequence, std::span<const Twist6> velocities) {
  expect_velocities(velocities.size(), poses.size());
  std::vector<BodyPose> batch;
  batch.reserve(poses.size());
  for (const auto& [body, X] : poses)
    batch.push_back({body, pose_of(X), velocities.empty() ? kUnknownTwist : velocities[batch.size()]});
  return updated(impl_->editor, [&](auto& engine) { return engine.set_poses(batch, stamp_ns, sequence); });
}
UpdateResult Engine::set_poses(std::initializer_list<std::pair<std::string_view, Pose7>> poses, std::int64_t stamp_ns,
                               std::int64_t sequence) {
  std::vector<std::pair<std::uint32_t, Pose7>> batch;
  for (const auto& [name, X] : poses) batch.emplace_back(body(name), X);
  return set_poses(batch, stamp_ns, sequence);
}
UpdateResult Engine::set_joints(std::span<const std::pair<std::uint32_t, double>> positions, std::int64_t stamp_ns,
                                std::int64_t sequence, std::span<const double> velocities) {
  expect_velocities(velocities.size(), positions.size());
  std::vector<JointPosition> batch;
  batch.reserve(positions.size());
  for (const auto& [joint, position] : positions)
    batch.push_back({joint, position, velocities.empty() ? kUnknownSpeed : velocities[batch.size()]});
  return updated(impl_->editor, [&](auto& engine) { return engine.set_joints(batch, stamp_ns, sequence); });
}
UpdateResult Engine::set_points(std::uint32_t body, std::span<const std::array<float, 3>> xyz,
                                std::optional<double> radius, std::int64_t stamp_ns, std::int64_t sequence) {
  const std::span<const CloudPoint> points(reinterpret_cast<const CloudPoint*>(xyz.data()), xyz.size());
  return updated(impl_->editor,
                 [&](auto& engine) { return engine.set_points(body, points, radius, stamp_ns, sequence); });
}
UpdateResult Engine::attach(std::uint32_t child, std::uint32_t parent, const Pose7* X_parent_child,
                            std::span<const std::uint32_t> allow) {
  const Pose X_pc = X_parent_child ? pose_of(*X_parent_child) : Pose();
  return updated(impl_->editor,
                 [&](auto& engine) { return engine.attach(child, parent, X_parent_child ? &X_pc : nullptr, allow); });
}
UpdateResult Engine::allow(std::uint32_t a, std::uint32_t b) {
  return updated(impl_->editor, [&](auto& engine) { return engine.allow(a, b, true); });
}
UpdateResult Engine::forbid(std::uint32_t a, std::uint32_t b) {
  return updated(impl_->editor, [&](auto& engine) { return engine.allow(a, b, false); });
}

}  // namespace clearance
