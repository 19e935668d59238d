// A loop whose scene may change: bodies are added and removed, and the scene is reloaded.
#pragma once

#include <memory>
#include <utility>

#include "server/core/loop.h"
#include "tests/server/test_scene.h"

namespace clearance::fuzz {

/// Lets a loop over small_scene() add bodies and reload that scene.
inline void serve_changing_scenes(Loop& loop) {
  const auto build = [](engine::Scene scene) {
    engine::Engine::Options options;
    options.threads = 1;
    return std::make_unique<engine::Engine>(std::move(scene), options);
  };
  loop.reload_by([build] { return build(small_scene()); }, build);
}
/// Runs the loop until nothing is in progress, including in its workers.
inline void turn_until_idle(Loop& loop) {
  while (loop.turn() || loop.is_reloading()) {
  }
}

}  // namespace clearance::fuzz
