// A scene with convex proxies in place of meshes.
#include <algorithm>

#include "engine/base/fp_environment.h"
#include "engine/base/slack.h"
#include "engine/bvh/surface.h"
#include "engine/geometry/make_geometry.h"
#include "engine/hull/decomposition.h"
#include "engine/scene/scene.h"

namespace clearance {

namespace {

const Decomposition* proxies_of(const ConvexPart& part) {
  return part.surface ? part.surface->decomposition() : nullptr;
}

bool has_proxies_of_its_own(const Body& body) {
  return std::ranges::any_of(body.parts, [](const ConvexPartPtr& part) { return proxies_of(*part) != nullptr; });
}

// The deviation of convex proxies from their mesh is slack of the shape, and proxies are grown as the mesh is. Parts
// without proxies are unchanged.
Body body_by_parts(const Body& body) {
  Body made = body;
  made.parts.clear();
  double inner = 0, outer = 0;
  for (const ConvexPartPtr& part : body.parts) {
    const Decomposition* const of = proxies_of(*part);
    if (!of) {
      made.parts.push_back(part);
      continue;
    }
    inner = std::max(inner, of->inner);
    outer = std::max(outer, of->most_outer());
    for (const ConvexPartPtr& core : of->parts)
      made.parts.push_back(part->radius > 0 ? with_radius(*core, part->radius) : core);
  }
  made.model_inner = sum_above(body.model_inner, inner);
  made.model_error = sum_above(body.model_error, outer);
  made.exact_body = std::make_shared<const Body>(body);
  return made;
}

}  // namespace

void engine::Scene::find_proxies() {
  by_parts_ = nullptr;
  if (std::ranges::none_of(bodies_, has_proxies_of_its_own)) return;
  const FpEnvironment environment;
  auto made = std::make_shared<engine::Scene>(without_memory());
  for (Body& body : made->bodies_) {
    if (!has_proxies_of_its_own(body)) continue;
    body = body_by_parts(body);
    made->grow(body, false);
  }
  made->has_proxies_ = true;
  made->has_surfaces_ = std::ranges::any_of(made->bodies_, has_surface);
  made->has_uncertainties_ = std::ranges::any_of(made->bodies_, has_uncertainty);
  by_parts_ = std::move(made);
}

}  // namespace clearance
