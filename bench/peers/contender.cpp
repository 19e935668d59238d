#include "bench/peers/contender.h"

#include "engine/hull/hull.h"

namespace clearance {

Pose pose_of(const peers::Problem& p, std::uint64_t k, std::uint32_t body) {
  const auto& x = p.poses[k * p.bodies.size() + body];
  return {{x[0], x[1], x[2]}, x[3], x[4], x[5], x[6]};
}

engine::Scene scene_of(const peers::Problem& p, std::uint64_t k) {
  std::vector<ConvexPartPtr> parts;
  for (const peers::Shape& s : p.shapes) {
    std::vector<Vec3d> vertices;
    for (const peers::Point& v : s.vertices) vertices.push_back({v[0], v[1], v[2]});
    parts.push_back(make_hull_part(vertices, s.triangles, s.radius));
  }
  engine::Scene scene;
  for (std::uint32_t b = 0; b < p.bodies.size(); ++b) {
    Body body;
    body.name = "body" + std::to_string(b);
    for (const std::uint32_t s : p.bodies[b]) body.parts.push_back(parts[s]);
    body.pose = pose_of(p, k, b);
    scene.add_body(std::move(body));
  }
  return scene;
}

std::vector<std::uint32_t> moved_bodies(const peers::Problem& p) {
  std::vector<std::uint32_t> moved;
  const std::size_t count = p.bodies.size();
  for (std::uint32_t b = 0; b < count; ++b)
    for (std::uint64_t k = 1; k < p.configurations; ++k)
      if (p.poses[k * count + b] != p.poses[b]) {
        moved.push_back(b);
        break;
      }
  return moved;
}

std::vector<BodyPair> pairs_of(const peers::Problem& p) {
  std::vector<BodyPair> pairs;
  for (const auto& pair : p.pairs) pairs.push_back({pair[0], pair[1]});
  return pairs;
}

}  // namespace clearance
