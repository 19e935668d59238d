// A moving arm among fixed objects.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/scene/scene.h"

namespace clearance::test {

/// Seven joints, a hull of 48 to 96 vertices on each of the arm's eight links, and 21 objects of 8 to 256 vertices.
engine::Scene arm_scene_of_hulls();

/// The same arm in a cloud of kRoomPoints points, as a depth camera records its surroundings: body "`room`".
engine::Scene arm_scene_in_room();
inline constexpr std::size_t kRoomPoints = 100'000;
/// Walls, a floor and 40 boxes, no point within 25 cm of the arm's axis, noise of 2 mm.
std::vector<CloudPoint> room_points(std::size_t count, std::uint64_t seed);

/// The same arm in a cell of one mesh, a non-convex solid: floor, walls and a shelf in front of the arm, body "cell".
engine::Scene arm_scene_in_cell();

/// An arm whose links are non-convex solid meshes of 576 triangles, among the 21 objects.
engine::Scene arm_scene_of_meshes();

/// The same in the cell: meshes with a mesh.
engine::Scene arm_scene_of_meshes_in_cell();

/// Each moving link's hull with all objects, and links' hulls with each other if more than one joint is between them.
/// In a `room` or cell: each moving link's hull with that only. For links that are meshes: links with objects only.
std::vector<BodyPair> arm_pairs(const engine::Scene& scene);
/// (configurations, joints) within the joints' limits.
std::vector<double> arm_positions(const engine::Scene& scene, std::uint32_t configurations, std::uint64_t seed);

}  // namespace clearance::test
