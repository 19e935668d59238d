#include "scene_log.h"

#include <spdlog/spdlog.h>

#include <map>
#include <string>

namespace clearance {

void log_hull_warnings(const Scene& scene) {
  std::map<const Piece*, std::pair<const Body*, int>> meshes;  // the first body of each, and how many there are
  for (const Body& body : scene.bodies())
    if (!hull_warning(body).empty()) ++meshes.try_emplace(body.pieces[0].get(), &body, 0).first->second.second;
  for (const auto& [piece, bodies] : meshes)
    spdlog::warn("event=hull_stands_out body=\"{}\" more={} hull_excess_m={:.4g} empty_share={:.3g} text=\"{}\"",
                 bodies.first->name, bodies.second - 1, bodies.first->hull_excess, bodies.first->empty_share,
                 hull_warning(*bodies.first));
}

}  // namespace clearance
