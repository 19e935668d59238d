// Scene files of tests, written into a temporary folder.
#pragma once

#include <string>

#include "engine/scene/scene.h"
#include "tests/temporary_folder.h"

namespace clearance::test {

inline constexpr const char* kTetrahedron = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";

/// Writes a scene file into the folder and loads it.
inline engine::Scene load_text(const TemporaryFolder& folder, const std::string& yaml, bool allow_outside = false) {
  return engine::Scene::load(folder.write("scene.yaml", yaml), allow_outside);
}

}  // namespace clearance::test
