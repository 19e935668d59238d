"""The mutants of covers, obstacles and joint tables (table.py)."""

from __future__ import annotations

from mutant import mutants_of

COVER_MUTANTS = [
    # Covers: trees of balls with two radii.
    *mutants_of(
        "covers",
        ("cover_outer", "cover/cover.cpp", "node.ball.outer = up(@outer * kCoverUp@)", "outer * kCoverUp - 5e-4"),
        (
            "cover_inner",
            "cover/cover.cpp",
            "node.ball.inner = down(@shape.inside(centre)@)",
            "shape.inside(centre) + 5e-4",
        ),
        ("cover_rounding", "cover/cover.cpp", "return @rounded < value@ ?", "false"),
        (
            "cover_packets",
            "cover/cover.cpp",
            "children[parent.lane] = static_cast<std::uint32_t>(@cover.packets.size()@)",
            "cover.packets.size() - 1",
        ),
        (
            "cover_share",
            "cover/cover_simplices.cpp",
            "i < @pieces.size()@; ++i) shares",
            "pieces.size() / 16 * 15",
        ),
        ("cover_growth", "cover/cover_simplices.cpp", "kCoverTiny + @s.growth@", "0 * s.growth"),
        ("cover_excess", "cover/cover_shape.cpp", "growth = (growth + @few->excess@) * kUp", "0 * few->excess"),
        ("cover_radius", "cover/cover_shape.cpp", "double growth = @part.radius@;", "0 * part.radius"),
        ("cover_planes", "cover/hull_planes.cpp", "height_.data(), @height_.size()@, c)", "height_.size() / 2"),
        (
            "cover_cylinder",
            "cover/round_core.cpp",
            "std::min(size.x - across, @size.z - std::abs(c.z)@)",
            "size.x - across",
        ),
        ("cover_cone", "cover/round_core.cpp", "std::min(side, @size.z + c.z@)", "side"),
        (
            "cover_ellipsoid",
            "cover/round_core.cpp",
            "* @std::min({size.x, size.y, size.z})@",
            "std::max({size.x, size.y, size.z})",
        ),
    ),
    *mutants_of(
        "covers MeshCover.CellsHold*",
        ("mesh_corners", "cover/mesh/mesh_cells.cpp", "if (@cell.is_inside[i]@) points.push_back", "false"),
        (
            "mesh_cut",
            "cover/mesh/mesh_cells.cpp",
            "add_below(cell.polygon(i), axis, 1, @middle + growth_@, below)",
            "middle - 1e-3",
        ),
    ),
    *mutants_of(
        "covers CloudCover.*",
        ("cloud_cover_radius", "cover/cover_shape.cpp", "growth = (@part.radius@ + std::sqrt(0.75)", "0 * part.radius"),
        ("cloud_cover_edge", "cover/cover_shape.cpp", "@std::sqrt(0.75)@ * cloud.edge()", "0.5"),
        ("cloud_cover_inner", "cover/mesh/mesh_depth.cpp", "(@0.5@ * cloud.edge()", "0.6"),
    ),
    *mutants_of(
        "covers MeshCover.InnerRadiiHold",
        ("mesh_side", "cover/mesh/mesh_depth.cpp", "&& @winding_number(surface, c) != 0@)", "true"),
    ),
    *mutants_of(
        "covers MeshCover.*",
        (
            "mesh_far",
            "cover/mesh/mesh_depth.cpp",
            "far_ = @(high + rounding_) * (high + rounding_)@",
            "0.25 * high * high",
        ),
    ),
    # Obstacles of covers, and the gaps of points from them.
    *mutants_of(
        "obstacles",
        ("obstacle_error", "cover/obstacle.cpp", "above(@rounding + error@)", "0.0"),
        ("obstacle_distance", "cover/obstacle.cpp", "@units * far@ + at", "0.0"),
        ("obstacle_planes_error", "cover/obstacle.cpp", "kFloatUnit * (@9 * far + 3 * shape.spread@", "0.0"),
        ("obstacle_half", "cover/obstacle.cpp", "@turn.column[k]@)] = half[k]", "static_cast<int>(k)"),
        ("obstacle_half_of_segment", "cover/obstacle.cpp", "@turn.column[2]@)])", "0"),
        ("obstacle_axis", "cover/obstacle.cpp", "o.kind == Kind::kCylinder && @turn.column[2] != 2@", "false"),
        ("obstacle_radius", "cover/obstacle.cpp", "o.radius = @static_cast<float>(shape.radius)@", "0.0f"),
        ("obstacle_outer", "cover/obstacle.cpp", "o.outer.push_back(@above(outer)@)", "below(outer)"),
        ("obstacle_inner", "cover/obstacle.cpp", "o.inner.push_back(@below(proved)@)", "above(outer)"),
        ("obstacle_turned", "cover/obstacle.cpp", "middle + plane.outer + @turned@", "0.0"),
        (
            "obstacle_inner_ball",
            "cover/obstacle.cpp",
            "std::max(0.0f, @below(inner_radius)@)",
            "2 * below(inner_radius)",
        ),
        (
            "obstacle_outer_ball",
            "cover/obstacle.cpp",
            "above(@shape.spread + norm(at - centre)@",
            "0.99 * shape.spread",
        ),
        (
            "obstacle_corners",
            "cover/obstacle_shape.cpp",
            "return @support(part, n).value@; };",
            "0.9 * support(part, n).value",
        ),
        ("obstacle_face", "cover/obstacle_shape.cpp", "@std::min({dot(n, a), dot(n, b), dot(n, c)})@ -", "reach(n)"),
        ("obstacle_flat", "cover/obstacle.cpp", "if (@!(o.inner_radius > 0)@)", "false"),
        ("gap_depth", "cover/point_gaps.h", "larger(@larger(beyond_x, beyond_y)@, beyond_z)", "beyond_x"),
        ("gap_side", "cover/point_gaps.h", "@magnitude(y)@ - T(half[1])", "y"),
        ("gap_end", "cover/point_gaps.h", "out_z = @larger(beyond_z, zero)@", "zero"),
        ("gap_planes", "cover/point_gaps.h", "(up + @inner_radius@)", "1.5f * inner_radius"),
    ),
    # Joint tables.
    *mutants_of(
        "tables",
        (
            "table_way",
            "joint_table/joint_table_maker.cpp",
            "std::min(least, @path.way(change, travel_)@)",
            "0.5 * path.way(change, travel_)",
        ),
        (
            "table_low",
            "joint_table/joint_table_maker.cpp",
            "low = @std::floor(lower / JointTable::kUnit - kRounding)@",
            "std::ceil(lower / JointTable::kUnit)",
        ),
        (
            "table_high",
            "joint_table/joint_table_maker.cpp",
            "high = @std::ceil(upper / JointTable::kUnit + kRounding)@",
            "std::floor(upper / JointTable::kUnit)",
        ),
        (
            "table_union",
            "joint_table/block_bounds.cpp",
            "@std::min(bounds.least, of_parts.least)@, std::min(bounds.most",
            "of_parts.least",
        ),
        ("table_column", "joint_table/joint_table_maker.cpp", "@blocks[k].at[c]@ + 0.5", "blocks[k].at[0]"),
        ("table_halved", "joint_table/joint_table_maker.cpp", "next.back().at[axis] += @1u << (shift[axis] - 1)@", "0"),
        (
            "plane_bend",
            "joint_table/block_planes.cpp",
            "bend_ = @0.5 * std::min(of_a, of_b)@ + error_",
            "0.2 * std::min(of_a, of_b)",
        ),
        (
            "plane_turn",
            "joint_table/block_planes.cpp",
            "turned += @cross(towards, movement_[c].turn)@ * side",
            "Vec3d{0, 0, 0}",
        ),
        ("plane_shift", "joint_table/block_planes.cpp", "shift += @dot(towards, movement_[c].shift)@ * side", "0.0"),
        ("plane_corner", "joint_table/block_planes.cpp", "side = @corner >> c & 1 ? 1 : -1@", "1"),
        (
            "plane_seen_from_a",
            "joint_table/block_planes.cpp",
            "b.shift - a.shift - @cross(a.turn, apart)@",
            "Vec3d{0, 0, 0}",
        ),
        (
            "plane_seen_from_b",
            "joint_table/block_planes.cpp",
            "a.shift - b.shift + @cross(b.turn, apart)@",
            "Vec3d{0, 0, 0}",
        ),
        (
            "plane_point",
            "joint_table/block_planes.cpp",
            "@std::abs(dot(n, ways[0]))@ - std::abs(dot(n, ways[1]))",
            "0.0",
        ),
        ("plane_point_bend", "joint_table/block_planes.cpp", "std::abs(dot(n, ways[1])) - @bend_@", "0.0"),
        ("plane_point_held", "joint_table/block_planes.cpp", "spare = @-of_moving.above(worst, in_moving)@", "1.0"),
        ("plane_radius", "joint_table/block_planes.cpp", "value + @part.radius * norm(n)@", "0.0"),
        ("table_levels", "joint_table/joint_table.cpp", "joined = {@std::min(joined.low, cell.low)@", "cell.low"),
    ),
    *mutants_of(
        "tables JointTable.HoldsForMeshes",
        ("table_contained", "joint_table/mesh_gap.cpp", "if (@!(gap.lower > 0)@) return gap", "true"),
    ),
]
