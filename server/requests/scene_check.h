// Checks that a request's ids are valid in the engine's scene.
#pragma once

#include <span>
#include <string>

#include "engine/engine.h"
#include "server/base/rejected_request.h"
#include "wire/protocol.h"

namespace clearance {

/// False if the ids mean something else in the engine's scene than in the one that the request names, if it names one.
inline bool knows_scene(const engine::Engine& engine, const wire::FrameHeader& request,
                        std::span<const std::uint32_t> ids, bool with_parents = false) {
  return !request.scene_revision || engine.ids_valid_since(request.scene_revision, ids, with_parents);
}

[[noreturn]] inline void reject_scene(const engine::Engine& engine, const wire::FrameHeader& request) {
  throw RejectedRequest{wire::ErrorCode::kWrongScene,
                        "the request is for scene revision " + std::to_string(request.scene_revision) +
                            ", the daemon's is " + std::to_string(engine.scene_revision()) + ": fetch the scene again"};
}

/// Throws RejectedRequest (kWrongScene) if joint ids mean something else in the engine's scene.
inline void check_joint_scene(const engine::Engine& engine, const wire::FrameHeader& request,
                              std::span<const std::uint32_t> joints) {
  if (request.scene_revision && !engine.joints_still_mean(request.scene_revision, joints))
    reject_scene(engine, request);
}

/// Throws RejectedRequest (kWrongScene) if body ids mean something else in the engine's scene.
inline void check_scene(const engine::Engine& engine, const wire::FrameHeader& request,
                        std::span<const std::uint32_t> ids, bool with_parents = false) {
  if (!knows_scene(engine, request, ids, with_parents)) reject_scene(engine, request);
}

}  // namespace clearance
