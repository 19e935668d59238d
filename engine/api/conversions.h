// Conversions between the installed types and those of the engine.
#pragma once

#include <utility>

#include "engine/engine.h"
#include "engine/scene/scene.h"
#include "wire/api/errors.h"
#include "wire/api/query.h"
#include "wire/api/scene_info.h"

namespace clearance {

inline Pose pose_of(const Pose7& X) {
  return {{X[0], X[1], X[2]}, X[3], X[4], X[5], X[6]};
}

/// Converts the engine's errors to those of the installed library, whose types programs can catch.
template <class F>
auto translated(F&& f) {
  try {
    return f();
  } catch (const engine::SceneError& error) {
    throw SceneError(error.what());
  } catch (const engine::QueryError& error) {
    throw QueryError(static_cast<std::uint16_t>(error.code), error.what());
  }
}

/// A view of a query except its configurations and positions. Throws std::invalid_argument for options of daemons.
QueryView view_without_inputs(const Query& query);
/// Adds views of the configurations and positions. Throws std::invalid_argument for a fractional number.
void take_inputs(const Query& query, QueryView& view);
/// A view of a whole query. Throws as the two functions above.
QueryView view_of(const Query& query);

std::vector<BodyInfo> bodies_of(const engine::Scene& scene);
std::vector<GroupInfo> groups_of(const engine::Scene& scene);
SceneInfo scene_info_of(const engine::Engine& engine);
/// Only the revision, the names of bodies and groups, and the parents.
SceneInfo scene_names_of(const engine::Engine& engine);
JointsInfo joints_of(const engine::Engine& engine);

}  // namespace clearance
