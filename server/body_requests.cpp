// What changes the scene while the daemon runs: loading it anew, adding and removing bodies. Each is made aside and
// answered when the engine with the new scene has taken over.
#include <algorithm>
#include <array>
#include <cstring>

#include "log_text.h"
#include "loop_task.h"
#include "scene_log.h"

namespace clearance {
namespace {

using wire::ErrorCode;
using wire::FrameHeader;
using wire::FrameType;

/// The geometry of a body that a client describes. Throws SceneError.
Body body_of(const wire::NewBodyRecord& record, std::span<const Vec3d> vertices) {
  const std::string name = wire::name_of(record.name);
  Scene::BodyOptions options;
  options.radius = record.radius;
  options.is_static = record.is_static;
  if (record.has_pose) {
    options.pose.emplace();
    static_assert(sizeof record.pose == sizeof(Pose));
    std::memcpy(&*options.pose, record.pose, sizeof record.pose);
  }
  Scene alone;
  switch (static_cast<wire::BodyShape>(record.shape)) {
    case wire::BodyShape::kHull:
      alone.add_hull(name, vertices, options);
      break;
    case wire::BodyShape::kBox:
      alone.add_box(name, {record.size[0], record.size[1], record.size[2]}, options);
      break;
    case wire::BodyShape::kSphere:
      alone.add_sphere(name, record.size[0], options);
      break;
    case wire::BodyShape::kCapsule:
      alone.add_capsule(name, record.size[0], record.size[1], options);
      break;
    case wire::BodyShape::kCylinder:
      alone.add_cylinder(name, record.size[0], record.size[1], options);
      break;
  }
  Body body = alone.bodies()[0];
  if (!record.has_pose) body.pose.reset();
  return body;
}

}  // namespace

void Loop::begin_edit(const FrameHeader& header, std::unique_ptr<ReplySink>& sink, const std::string& name,
                      bool removes, Reloader::Edit edit) {
  if (!reloader_ || !reloader_->can_edit())
    throw Refusal{ErrorCode::kNotSupported, "bodies can be neither added nor removed here"};
  const std::uint64_t client = sink->client();
  check_room_for(client);
  scene_waiters_.push_back({std::move(sink), header, 0, reloader_->push(std::move(edit)), name, removes});
  ++waiting_per_client_[client].requests;
}

void Loop::add_body(const FrameHeader& header, std::span<const std::byte> payload, std::unique_ptr<ReplySink>& sink) {
  const wire::NewBodyParts parts = wire::parse_new_body(payload);
  const std::uint32_t parent = parts.record.parent;
  if (parent != kNone) check_scene(header, std::array{parent});
  const auto& bodies = engine_->scene().bodies();
  if (parent != kNone && parent >= bodies.size())
    throw Refusal{ErrorCode::kBadQuery,
                  "add_body: the parent, body " + std::to_string(parent) + ", is not in the scene"};
  if (parts.vertices.size() > options_.max_added_vertices)
    throw Refusal{ErrorCode::kTooLarge, "add_body: " + std::to_string(parts.vertices.size()) +
                                            " vertices are more than the " +
                                            std::to_string(options_.max_added_vertices) +
                                            " that an added body may have (--max-added-vertices)"};
  std::vector<Vec3d> vertices(parts.vertices.size());
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const wire::VertexRecord v = parts.vertices[i];
    vertices[i] = {v.xyz[0], v.xyz[1], v.xyz[2]};
  }
  begin_edit(
      header, sink, wire::name_of(parts.record.name), false,
      [record = parts.record, vertices = std::move(vertices), parent = parent == kNone ? "" : bodies[parent].name,
       most = options_.max_added_bodies](SceneParts& scene) {
        if (scene.added.size() >= most)
          throw SceneError("add_body: " + std::to_string(most) +
                           " bodies were added already, and no more may be (--max-added-bodies)");
        scene.added.push_back({body_of(record, vertices), parent});
      });
}

void Loop::remove_body(const FrameHeader& header, std::span<const std::byte> payload,
                       std::unique_ptr<ReplySink>& sink) {
  const std::string name = wire::name_of(wire::parse_remove_body(payload).name);
  check_scene(header, std::array{engine_->scene().find_body(name)});
  begin_edit(header, sink, name, true, [name](SceneParts& scene) {
    const auto found = std::find_if(scene.added.begin(), scene.added.end(),
                                    [&](const AddedBody& added) { return added.body.name == name; });
    if (found == scene.added.end())
      throw SceneError("remove_body: \"" + name + "\" " +
                       (scene.file->find_body(name) == kNone ? "is not in the scene"
                                                             : "is the scene file's: change the file, and reload it"));
    scene.added.erase(found);
    for (AddedBody& other : scene.added)  // it followed at first, and has been set free since: see why_not()
      if (other.parent == name) {
        other.parent.clear();
        other.body.pose.reset();
      }
  });
}

void Loop::ask_reload(const FrameHeader& header, std::unique_ptr<ReplySink>& sink) {
  if (!reloader_) throw Refusal{ErrorCode::kNotSupported, "there is no scene file to load anew"};
  const std::uint64_t client = sink->client();
  check_room_for(client);
  spdlog::info("event=reload_asked client={}", client);
  scene_waiters_.push_back({std::move(sink), header, reloader_->next_load(), 0, "", false});
  ++waiting_per_client_[client].requests;
  reloader_->ask();
}

void Loop::take_new_engine() {
  if (std::optional<Reloader::Outcome> outcome = reloader_->take()) {
    // Those that asked for a reload while one was under way wait for the next: this one may have read the files before
    // they changed.
    const auto answered =
        std::stable_partition(scene_waiters_.begin(), scene_waiters_.end(), [&](const SceneWaiter& waiter) {
          return outcome->edit ? waiter.edit != outcome->edit : waiter.load == 0 || waiter.load > outcome->load;
        });
    std::vector<SceneWaiter> waiters(std::make_move_iterator(answered), std::make_move_iterator(scene_waiters_.end()));
    scene_waiters_.erase(answered, scene_waiters_.end());
    if (outcome->edit && outcome->engine)
      for (const SceneWaiter& waiter : waiters)
        if (std::string why = why_not(waiter); !why.empty()) {
          outcome->engine = nullptr;
          outcome->bad_input = true;
          outcome->error = std::move(why);
        }
    install(*outcome);
    for (const SceneWaiter& waiter : waiters) answer_scene_waiter(waiter, *outcome);
  }
  reloader_->begin(engine_, parts_);
}

/// Why a body cannot go now; empty: it can, or is not to go.
std::string Loop::why_not(const SceneWaiter& waiter) const {
  if (!waiter.removes) return "";
  const auto& bodies = engine_->scene().bodies();
  const std::uint32_t gone = engine_->scene().find_body(waiter.name);
  for (std::uint32_t i = 0; i < bodies.size(); ++i)
    if (engine_->body_state(i).parent == gone)
      return "remove_body: \"" + bodies[i].name + "\" follows \"" + waiter.name + "\": set it free before";
  return "";
}

void Loop::install(Reloader::Outcome& outcome) {
  const char* what = outcome.edit ? "scene_edit" : "reload";
  if (!outcome.engine) {
    ++counter(std::string(what) + "s.failed");
    if (outcome.edit)
      spdlog::info("event=scene_edit_failed seconds={:.3f} error=\"{}\"", outcome.seconds, log_text(outcome.error));
    else
      spdlog::error("event=reload_failed seconds={:.3f} error=\"{}\"", outcome.seconds, log_text(outcome.error));
    return;
  }
  outcome.engine->take_poses(*engine_);
  engine_ = std::move(outcome.engine);
  parts_ = std::move(outcome.parts);
  poses_changed_ = true;
  ++counter(std::string(what) + "s");
  spdlog::info("event={} bodies={} revision={:016x} seconds={:.3f}", outcome.edit ? "scene_edited" : "reloaded",
               engine_->scene().bodies().size(), engine_->scene_revision(), outcome.seconds);
  if (!outcome.left_out.empty()) spdlog::warn("event=added_bodies_left_out error=\"{}\"", log_text(outcome.left_out));
  if (!outcome.edit) log_hull_warnings(engine_->scene());
}

void Loop::answer_scene_waiter(const SceneWaiter& waiter, const Reloader::Outcome& outcome) {
  leave(waiter.sink->client());
  guarded(*waiter.sink, waiter.request, [&] {
    if (!outcome.error.empty())
      throw Refusal{outcome.edit && outcome.bad_input ? ErrorCode::kBadQuery : ErrorCode::kReloadFailed, outcome.error};
    wire::SceneChange change;
    change.scene_revision = engine_->scene_revision();
    change.body_count = static_cast<std::uint32_t>(engine_->scene().bodies().size());
    change.body = engine_->scene().find_body(waiter.name);
    change.seconds = outcome.seconds;
    answer(*waiter.sink, waiter.request, FrameType::kSceneChanged, std::as_bytes(std::span(&change, 1)));
  });
}

}  // namespace clearance
