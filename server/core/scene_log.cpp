#include "server/core/scene_log.h"

#include <string>
#include <unordered_map>
#include <vector>

#include "server/base/log.h"
#include "server/base/log_text.h"

namespace clearance {

void log_mesh_warnings(const engine::Scene& scene, std::span<const MeshWarning> warnings) {
  struct Warned {
    const Body* first;
    const std::string* text;
    int bodies = 0;
  };
  std::vector<Warned> meshes;  // in the order of the scene
  std::unordered_map<const ConvexPart*, std::size_t> place;
  for (const MeshWarning& warning : warnings) {
    const Body& body = scene.bodies()[warning.body];
    const auto [at, fresh] = place.try_emplace(body.parts[0].get(), meshes.size());
    if (fresh) meshes.push_back({&body, &warning.text});
    ++meshes[at->second].bodies;
  }
  for (const auto& [first, text, bodies] : meshes)
    log::warn("event=mesh_suspicious body=\"{}\" more={} hull_excess_m={:.4g} empty_share={:.3g} text=\"{}\"",
              log_text(first->name), bodies - 1, first->hull_excess, first->empty_share, log_text(*text));
}

void log_file_warnings(const engine::Scene& scene) {
  for (const std::string& warning : scene.warnings())
    log::warn("event=scene_suspicious text=\"{}\"", log_text(warning));
  for (const auto& robot : scene.robots())
    for (const std::string& warning : robot->model.warnings)
      log::warn("event=robot_left_out robot=\"{}\" text=\"{}\"", log_text(robot->name), log_text(warning));
}

}  // namespace clearance
