#include "server/core/scene_changes.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <iterator>
#include <utility>

#include "server/base/log.h"
#include "server/base/log_text.h"
#include "server/core/scene_log.h"
#include "server/requests/scene_check.h"

namespace clearance {
namespace {

using wire::ErrorCode;

/// Copy of a body's shape as a client sent it.
NewShape shape_of(const wire::NewBodyParts& parts) {
  static_assert(sizeof(Vec3d) == sizeof(wire::VertexRecord) && sizeof(Triangle) == sizeof(wire::TriangleRecord));
  const auto& [x, y, z] = parts.record.size;
  NewShape shape{static_cast<wire::BodyShape>(parts.record.shape), {x, y, z}};
  shape.vertices.resize(parts.vertices.size());
  shape.triangles.resize(parts.triangles.size());
  shape.mesh_as = parts.mesh_as;
  shape.points.resize(parts.points.size());
  if (!shape.vertices.empty()) std::memcpy(shape.vertices.data(), parts.vertices.data(), parts.vertices.size_bytes());
  if (!shape.triangles.empty())
    std::memcpy(shape.triangles.data(), parts.triangles.data(), parts.triangles.size_bytes());
  if (!shape.points.empty()) std::memcpy(shape.points.data(), parts.points.data(), parts.points.size_bytes());
  return shape;
}

engine::Scene::BodyOptions options_of(const wire::NewBodyParts& parts, std::string parent) {
  engine::Scene::BodyOptions options;
  options.parent = std::move(parent);
  options.uncertainty = {parts.uncertainties.uncertainty_position, parts.uncertainties.uncertainty_angle};
  options.padding = parts.uncertainties.padding;
  options.max_speed = parts.uncertainties.max_speed;
  options.radius = parts.record.radius;
  options.is_static = parts.record.is_static;
  if (parts.record.has_pose) {
    options.pose.emplace();
    static_assert(sizeof parts.record.pose == sizeof(Pose));
    std::memcpy(&*options.pose, parts.record.pose, sizeof parts.record.pose);
  }
  return options;
}

/// Adds a body up to the limit. Throws SceneError.
Reloader::Edit addition(const wire::NewBodyParts& parts, std::string parent, std::uint32_t most) {
  return [name = wire::name_of(parts.record.name), shape = shape_of(parts),
          options = options_of(parts, std::move(parent)), most](SceneParts& scene) {
    if (scene.added.size() >= most)
      throw engine::SceneError("add_body: " + std::to_string(most) +
                               " bodies were added already, the maximum (limit max-added-bodies)");
    scene.added.push_back(make_body(name, shape, options));
  };
}

/// \param may_any whether the client may replace bodies of the scene file
Reloader::Edit reshaping(const wire::NewBodyParts& parts, bool may_any) {
  return [name = wire::name_of(parts.record.name), shape = shape_of(parts), radius = parts.record.radius,
          may_any](SceneParts& scene) {
    if (!may_any) scene.check_added(name, "replace: ", "replacing it needs the right \"admin\"");
    scene.reshape(name, shape, radius);
  };
}

}  // namespace

void SceneChanges::allow(Reloader::Make make, Reloader::Build build, std::function<void()> wake) {
  reloader_ = std::make_unique<Reloader>(std::move(make), std::move(build), std::move(wake));
}

bool SceneChanges::reload() noexcept {
  if (reloader_) reloader_->request();
  return reloader_ != nullptr;
}

// --- requests

void SceneChanges::let_wait(Request& request, Waiter waiter) {
  waiter.pending.header = request.header;
  waiter.pending.share = quotas_.take(request.sink->client(), request.sink->service_class(), 0);
  waiters_.push_back(std::move(waiter));
  waiters_.back().pending.sink = std::move(request.sink);  // last, as the caller needs it after an exception
}

void SceneChanges::request_reload(Request& request) {
  if (!reloader_) throw RejectedRequest{ErrorCode::kNotSupported, "there is no scene file to reload"};
  quotas_.check_requests(request.sink->client());
  log::info("event=reload_requested client={}", request.sink->client());
  let_wait(request, {.pending = {}, .load = reloader_->next_load(), .name = ""});
  reloader_->request();
}

void SceneChanges::begin_edit(Request& request, const std::string& name, Change change, Reloader::Edit edit) {
  if (!reloader_ || !reloader_->can_edit())
    throw RejectedRequest{ErrorCode::kNotSupported, "bodies can be neither added nor removed here"};
  quotas_.check_requests(request.sink->client());
  const std::uint64_t number = reloader_->push(std::move(edit));
  let_wait(request, {.pending = {}, .edit = number, .name = name, .change = change});
}

void SceneChanges::add_body(Request& request) {
  const wire::PayloadParts split = wire::split_payload(request.header, request.payload);
  const wire::NewBodyParts parts = wire::parse_new_body(split.body, split.records);
  answers_.check_epoch(request.header, parts.epoch);
  stats_.records_ignored += parts.passed_over.size();
  check_size(parts);
  const std::string name = wire::name_of(parts.record.name);
  if (parts.replaces) {
    const std::uint32_t body = engine_->scene().find_body(name);
    const bool may_any = request.sink->rights() & kMayAdmin;
    if (body != kNone && !may_any && !parts_.was_added(name))
      throw RejectedRequest{ErrorCode::kForbidden, "replacing a body of the scene file needs the right \"admin\""};
    check_scene(*engine_, request.header, std::array{body});
    return begin_edit(request, name, Change::kReshape, reshaping(parts, may_any));
  }
  const std::uint32_t parent = parts.record.parent;
  if (parent != kNone) check_scene(*engine_, request.header, std::array{parent});
  const auto& bodies = engine_->scene().bodies();
  if (parent != kNone && parent >= bodies.size())
    throw RejectedRequest{ErrorCode::kBadQuery,
                          "add_body: the parent, body " + std::to_string(parent) + ", is not in the scene"};
  begin_edit(request, name, Change::kAdd,
             addition(parts, parent == kNone ? "" : bodies[parent].name, limits_.max_added_bodies));
}

void SceneChanges::check_size(const wire::NewBodyParts& parts) const {
  const auto check = [](std::uint64_t got, std::uint64_t most, const std::string& what) {
    if (got > most)
      throw RejectedRequest{ErrorCode::kTooLarge, "add_body: " + std::to_string(got) + " " + what +
                                                      " are more than the " + std::to_string(most) +
                                                      " that an added body may have (limit max-added-" + what + ")"};
  };
  check(parts.vertices.size(), limits_.max_added_vertices, "vertices");
  check(parts.triangles.size(), limits_.max_added_triangles, "triangles");
  check(parts.points.size(), limits_.max_added_points, "points");
}

void SceneChanges::remove_body(Request& request) {
  const std::string name = wire::name_of(wire::parse_remove_body(request.payload).name);
  check_scene(*engine_, request.header, std::array{engine_->scene().find_body(name)});
  begin_edit(request, name, Change::kRemove, [name](SceneParts& scene) { scene.remove(name); });
}

// --- ends of changes

bool SceneChanges::turn() {
  if (!reloader_) return false;
  bool is_new = false;
  if (std::optional<Reloader::Outcome> outcome = reloader_->take()) is_new = end(*outcome);
  reloader_->begin(engine_, parts_);
  return is_new;
}

bool SceneChanges::end(Reloader::Outcome& outcome) {
  std::vector<Waiter> waiters = take_waiters(outcome);
  if (outcome.edit && outcome.engine)
    for (const Waiter& waiter : waiters)
      if (std::string why = why_not(waiter); !why.empty()) {
        outcome.engine = nullptr;
        outcome.bad_input = true;
        outcome.error = std::move(why);
      }
  const auto reshapes = std::ranges::find(waiters, Change::kReshape, &Waiter::change);
  const bool is_new = install(outcome, reshapes == waiters.end() ? "" : reshapes->name);
  for (Waiter& waiter : waiters) answer(waiter, outcome);
  return is_new;
}

/// Takes the requests that this outcome answers. A reload requested while another was under way waits for the next one,
/// as that may have read the files before they changed.
std::vector<SceneChanges::Waiter> SceneChanges::take_waiters(const Reloader::Outcome& outcome) {
  const auto first = std::stable_partition(waiters_.begin(), waiters_.end(), [&](const Waiter& waiter) {
    return outcome.edit ? waiter.edit != outcome.edit : waiter.load == 0 || waiter.load > outcome.load;
  });
  std::vector<Waiter> waiters(std::make_move_iterator(first), std::make_move_iterator(waiters_.end()));
  waiters_.erase(first, waiters_.end());
  return waiters;
}

/// Reason for which a body cannot be removed now, or empty.
std::string SceneChanges::why_not(const Waiter& waiter) const {
  if (waiter.change != Change::kRemove) return "";
  return why_not_removed(engine_->scene(), waiter.name,
                         [this](std::uint32_t body) { return engine_->body_state(body).parent; });
}

bool SceneChanges::install(Reloader::Outcome& outcome, std::string_view reshaped) {
  const char* what = outcome.edit ? "scene_edit" : "reload";
  if (!outcome.engine) {
    ++stats_[std::string(what) + "s.failed"];
    if (outcome.edit)
      log::info("event=scene_edit_failed seconds={:.3f} error=\"{}\"", outcome.seconds, log_text(outcome.error));
    else
      log::error("event=reload_failed seconds={:.3f} error=\"{}\"", outcome.seconds, log_text(outcome.error));
    return false;
  }
  outcome.engine->take_poses(*engine_, reshaped);
  engine_ = std::move(outcome.engine);
  parts_ = std::move(outcome.parts);
  ++stats_[std::string(what) + "s"];
  log::info("event={} bodies={} revision={:016x} seconds={:.3f}", outcome.edit ? "scene_edited" : "reloaded",
            engine_->scene().bodies().size(), engine_->scene_revision(), outcome.seconds);
  if (!outcome.left_out.empty()) log::warn("event=added_bodies_left_out error=\"{}\"", log_text(outcome.left_out));
  log_mesh_warnings(engine_->scene(), outcome.warnings);
  if (!outcome.edit) log_file_warnings(engine_->scene());
  return true;
}

void SceneChanges::answer(Waiter& waiter, const Reloader::Outcome& outcome) {
  waiter.pending.share.give_back();
  ReplySink& sink = *waiter.pending.sink;
  answers_.guard(sink, waiter.pending.header, [&] {
    if (!outcome.error.empty())
      throw RejectedRequest{outcome.edit && outcome.bad_input ? ErrorCode::kBadQuery : ErrorCode::kReloadFailed,
                            outcome.error};
    wire::SceneChange change;
    change.scene_revision = engine_->scene_revision();
    change.body_count = static_cast<std::uint32_t>(engine_->scene().bodies().size());
    change.body = engine_->scene().find_body(waiter.name);
    change.seconds = outcome.seconds;
    answers_.reply(sink, waiter.pending.header, wire::FrameType::kSceneChanged, std::as_bytes(std::span(&change, 1)));
  });
}

std::size_t SceneChanges::drop_gone() {
  return std::erase_if(waiters_, [](const Waiter& waiter) {
    return !waiter.pending.sink->alive() && waiter.change == Change::kAdd;  // end() needs those of the others
  });
}

}  // namespace clearance
