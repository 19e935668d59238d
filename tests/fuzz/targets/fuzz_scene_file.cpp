// Arbitrary scene files: a scene, or an error that names file and line.
#include "engine/scene/scene.h"
#include "tests/fuzz/scratch_file.h"

CLEARANCE_FUZZ_TARGET(scene_file) {
  using namespace clearance;
  using namespace clearance::fuzz;
  static const ScratchFolder folder;
  const std::string path = folder.write("scene.yaml", bytes);
  try {
    const engine::Scene scene = engine::Scene::load(path);
    require(!scene.bodies().empty(), "a scene has a body");
    for (const Body& body : scene.bodies()) {
      require(!body.name.empty() && body.name.size() <= kMaxNameBytes, "names fit the wire");
      require(!body.parts.empty() || !scene.robots().empty(), "a body has a piece, unless it is a robot's frame");
    }
    return true;
  } catch (const engine::SceneError& error) {
    require(std::string(error.what()).find("scene.yaml") != std::string::npos, "an error names the file");
    return false;
  }
}
