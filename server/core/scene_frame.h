// The scene and its state as payloads of replies.
#pragma once

#include <cstddef>
#include <vector>

#include "engine/engine.h"

namespace clearance {

/// Payload of kScene.
std::vector<std::byte> scene_payload(const engine::Engine& engine);
/// Payload of kJoints.
std::vector<std::byte> joints_payload(const engine::Engine& engine);
/// Payload of kBodyStates.
std::vector<std::byte> states_payload(const engine::Engine& engine);

}  // namespace clearance
