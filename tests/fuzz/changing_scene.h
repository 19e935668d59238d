// A loop whose scene may change: bodies come and go, and the scene is loaded anew.
#pragma once

#include <memory>
#include <utility>

#include "server/core/loop.h"
#include "tests/server/test_scene.h"

namespace clearance::fuzz {

/// Has a loop over small_scene() take bodies and load that scene anew.
inline void serve_changing_scenes(Loop& loop) {
  const auto build = [](Scene scene) {
    Engine::Options options;
    options.threads = 1;
    return std::make_unique<Engine>(std::move(scene), options);
  };
  loop.reload_by([build] { return build(small_scene()); }, build);
}
/// Until nothing is under way, also beside the loop.
inline void turn_until_idle(Loop& loop) {
  while (loop.turn() || loop.is_reloading()) {
  }
}

}  // namespace clearance::fuzz
