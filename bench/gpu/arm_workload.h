// An arm whose joints move, among things that stay.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/scene/scene.h"

namespace clearance::test {

/// Seven joints, a hull of 48 to 96 vertices on each of the arm's eight links, and 21 things of 8 to 256 vertices.
Scene arm_scene_of_hulls();

/// The same arm in a cloud of kRoomPoints points, as a depth camera sees a room: body "room".
Scene arm_scene_in_room();
inline constexpr std::size_t kRoomPoints = 100'000;
/// Walls, a floor and 40 boxes, no point within 25 cm of the arm's axis, noise of 2 mm.
std::vector<CloudPoint> room_points(std::size_t count, std::uint64_t seed);

/// The same arm in a cell of one mesh, a solid that is not convex: floor, walls and a shelf before the arm, body
/// "cell".
Scene arm_scene_in_cell();

/// An arm of links that are meshes of 576 triangles, solids that are not convex, among the 21 things.
Scene arm_scene_of_meshes();

/// The same in the cell: meshes before a mesh.
Scene arm_scene_of_meshes_in_cell();

/// Each moving link's hull against all things, and links' hulls against each other where no joint is between them
/// alone; in a room or a cell each moving link's hull against that, and meshes of links against things alone.
std::vector<BodyPair> arm_pairs(const Scene& scene);
/// (configurations, joints) within the joints' limits.
std::vector<double> arm_positions(const Scene& scene, std::uint32_t configurations, std::uint64_t seed);

}  // namespace clearance::test
