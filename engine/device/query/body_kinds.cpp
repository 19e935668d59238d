#include "engine/device/query/body_kinds.h"

#include <algorithm>
#include <vector>

#include "engine/hull/primitive.h"

namespace clearance::cuda {

namespace {

std::string description(const Body& body) {
  if (is_cloud(body)) return "a cloud of points";
  if (has_surface(body)) return "a mesh of triangles";
  for (const ConvexPartPtr& part : body.parts)
    if (part->primitive) return std::string("a closed form (") + name_of(part->primitive->kind) + ")";
  return "a hull with too many vertices for the device";
}

}  // namespace

BodyKind kind_of(const engine::Scene& scene, const Device& device, std::uint32_t body) {
  if (body >= scene.bodies().size()) return BodyKind::kUnknown;
  if (device.hull_of(body) != kNone) return BodyKind::kHull;
  const Body& of = scene.bodies()[body];
  if (is_cloud(of)) return BodyKind::kPoints;
  if (!has_surface(of)) return BodyKind::kUnknown;
  return of.parts.size() == 1 ? BodyKind::kMesh : BodyKind::kLeft;
}

bool ElementKinds::* kernel_for(BodyKind a, BodyKind b) {
  if (a == BodyKind::kMesh && b == BodyKind::kMesh) return &ElementKinds::meshes;
  if (a != BodyKind::kHull && b != BodyKind::kHull) return nullptr;
  switch (a == BodyKind::kHull ? b : a) {
    case BodyKind::kPoints:
      return &ElementKinds::points_and_hull;
    case BodyKind::kMesh:
      return &ElementKinds::mesh_and_hull;
    default:
      return nullptr;
  }
}

std::string unsupported_pair(const engine::Scene& scene, const Device& device, const Plan& plan, bool with_elements) {
  std::vector<BodyKind> kinds(scene.bodies().size());
  for (std::uint32_t body = 0; body < kinds.size(); ++body) kinds[body] = kind_of(scene, device, body);
  const bool are_hulls = std::all_of(kinds.begin(), kinds.end(), [](BodyKind kind) { return kind == BodyKind::kHull; });
  if (are_hulls && plan.query.all_pairs) return {};  // named pairs may have unknown bodies
  const auto of = [&](std::uint32_t body) { return body < kinds.size() ? kinds[body] : BodyKind::kUnknown; };
  constexpr std::uint64_t kSlice = 1u << 16;
  std::vector<BodyPair> storage;
  for (std::uint64_t first = 0; first < plan.pairs.size(); first += kSlice)
    for (const auto [a, b] : plan.pairs.slice(first, std::min(kSlice, plan.pairs.size() - first), storage)) {
      const BodyKind of_a = of(a), of_b = of(b);
      if (of_a == BodyKind::kHull && of_b == BodyKind::kHull) continue;
      if (with_elements && kernel_for(of_a, of_b)) continue;
      const std::uint32_t body = of_a == BodyKind::kHull ? b : a;
      if (body >= scene.bodies().size()) return "body " + std::to_string(body) + ", which the device does not hold";
      const Body& named = scene.bodies()[body];
      return "'" + named.name + "' is " + description(named);
    }
  return {};
}

}  // namespace clearance::cuda
