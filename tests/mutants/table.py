"""The mutants: deliberate errors in the engine, each of which a test must find.

Each has a name, the program that must find it (CMakeLists.txt), a file below engine/, and edits. Where other tests of
the program are slow, a group of mutants names the tests that must find them. An edit is a text that stands in the file
exactly once, and an expression that replaces it, or the part of it between two @. All mutants of a file are compiled
together, each as `clearance_mutant == NUMBER ? (replacement) : (original)`; the environment variable CLEARANCE_MUTANT
selects one. A replacement that begins with = stands in all of them.
"""

from __future__ import annotations

from decision_table import DECISION_MUTANTS
from kernel_table import KERNEL_MUTANTS
from mutant import mutants_of
from second_order_table import SECOND_ORDER_MUTANTS

#: The engine's sources that compile a mutated header. Kernels are compiled into their tests.
SOURCES_OF_HEADERS = {
    "uncertainty/uncertainty_step.h": ["uncertainty/pose_uncertainty.cpp", "selection/body_poses.cpp"],
    "bvh/crossing.h": ["bvh/winding.cpp"],
    "mesh_distance/element_search.h": [
        "evaluate/evaluate.cpp",
        "evaluate/evaluate_elements.cpp",
        "evaluate/evaluate_search.cpp",
        "evaluate/evaluate_containment.cpp",
    ],
    "robot/motion_path_step.h": ["robot/motion_path.cpp"],
    # Without its definitions for instruction sets, the list of kernels has that of the baseline alone.
    "decision/kernel/decide_kernel.h": ["decision/kernel/decide_baseline.cpp", "decision/kernel/decision_kernels.cpp"],
    "decision/kernel/ball_pairs.h": ["decision/kernel/decide_baseline.cpp", "decision/kernel/decision_kernels.cpp"],
    "decision/kernel/placed_balls.h": ["decision/kernel/decide_baseline.cpp"],
    "decision/kernel/ball_frames.h": ["decision/kernel/decide_baseline.cpp"],
    "decision/kernel/cloud_gaps.h": ["decision/kernel/decide_baseline.cpp"],
    "decision/kernel/hit_guess.h": ["decision/kernel/decide_baseline.cpp", "decision/kernel/decision_kernels.cpp"],
    "decision/kernel/table_lookup.h": ["decision/kernel/decide_baseline.cpp"],
    "decision/kernel/distance_kernel.h": [
        "decision/kernel/decide_baseline.cpp",
        "decision/kernel/decision_kernels.cpp",
    ],
    "decision/kernel/cell_bounds.h": ["decision/kernel/decide_baseline.cpp"],
    "decision/kernel/least_bounds.h": ["decision/kernel/decide_baseline.cpp"],
    "motion/motion_step.h": [
        "motion/half_spans.cpp",
        "motion/motion_search.cpp",
        "motion/motion_span.cpp",
        "motion/motion_bounds.cpp",
    ],
}

MUTANTS = [
    # Rounding and radii: the mined cases find these.
    *mutants_of(
        "rounding",
        ("rounding", "narrow/certify.cpp", "units * Arithmetic<T>::kUnit", "0 * units * Arithmetic<T>::kUnit"),
        ("radius", "narrow/certify.cpp", "dd::two_sum(a, b)", "DoubleDouble(a + b)"),
    ),
    # Support functions and direction tables.
    *mutants_of(
        "mutants",
        ("scan", "hull/support.cpp", "count = @part.x.size()@", "(part.x.size() + 8) / 16 * 8"),
        ("lookup", "hull/direction_table.cpp", "table.cells[@v * grid + u@] = at", "u * grid + v"),
        (
            "corners",
            "hull/cell_division.cpp",
            "@constexpr int kCorner@[4][4]",
            "=const int kCorner",
            "{{0, @1@, 3, 4},",
            "0",
            "{{0, 1, @3@, 4},",
            "0",
            "{{0, 1, 3, @4@},",
            "0",
        ),
    ),
    # Bounds that all contradict each other, except those of the lanes.
    *mutants_of(
        "contradiction",
        ("contradiction", "narrow/certify.cpp", "units * Arithmetic<T>::kUnit", "-1e30 * units * Arithmetic<T>::kUnit"),
    ),
    # Uncertainty of poses.
    *mutants_of(
        "slack Slack.*",
        ("slack_boxes", "selection/body_poses.cpp", "grown(box, slack.inner)", "grown(box, 0 * slack.inner)"),
        (
            "slack_side",
            "selection/body_poses.cpp",
            "return @(a.slack + chain_a) + (b.slack + chain_b)@",
            "a.slack + chain_a",
        ),
        (
            "slack_swapped",
            "selection/body_poses.cpp",
            "return @(a.slack + chain_a) + (b.slack + chain_b)@",
            "[](const Slack& s) { return Slack{s.outer, s.inner}; }((a.slack + chain_a) + (b.slack + chain_b))",
        ),
        (
            "slack_tolerance",
            "evaluate/evaluate.cpp",
            "decide(limits, lane.lower, lane.upper, [] { return 0.0; }, answer, slack)",
            "decide(limits, lane.lower - slack.inner, lane.upper + slack.outer, [] { return 0.0; }, answer)",
        ),
        (
            "slack_cut_off",
            "evaluate/evaluate.cpp",
            "@slack.cut_off(pairs_[i].max_distance)@, i",
            "pairs_[i].max_distance",
        ),
        ("slack_age", "uncertainty/uncertainty_step.h", "up(body.max_speed * age_s)", "up(body.max_speed * 0 * age_s)"),
        (
            "slack_parent",
            "uncertainty/uncertainty_step.h",
            "return @parent.shift + parent.turn * (along + shift) + shift@",
            "0 * (parent.shift + parent.turn * (along + shift)) + shift",
        ),
    ),
    # Rounding errors of the kinematics.
    *mutants_of(
        "slack LinkSlack.*",
        ("link_shift", "uncertainty/uncertainty_step.h", "along + shifted + @joints.shift@)", "0.0"),
        ("link_turn", "uncertainty/uncertainty_step.h", "turned + @joints.turn@)", "0.0"),
        ("link_pair", "uncertainty/uncertainty_step.h", "Slack{joints, joints}", "Slack{0 * joints, 0 * joints}"),
        (
            "link_travel",
            "selection/configuration_poses.cpp",
            "motion.travels(k, travels_.data() + k * bodies + at, scratch_)",
            "void(0)",
        ),
    ),
    # Regions of joint space, a tenth larger than proved.
    *mutants_of(
        "slack FreeScale.*",
        ("free_scale", "motion/free_scale.cpp", "@2@ * room / (", "2.2"),
    ),
    # Decisions by margins.
    *mutants_of(
        "slack Margins.*",
        ("margins", "selection/margins.cpp", "= @entries[static_cast<std::size_t>(entry)].margin@", "query.margin"),
        (
            "decision",
            "reduce/reduction_rows.cpp",
            "else if (@answer.status != Status::kBeyond@)",
            "!(answer.upper > plan_.margins.of(candidates_[i]))",
        ),
        ("dropped", "reduce/reduction_rows.cpp", "@i < none@; ++i", "i + 1 < none"),
    ),
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
    # Meshes and point clouds: the search through elements, and containment.
    *mutants_of(
        "surfaces",
        (
            "surface_boxes",
            "bvh/surface.cpp",
            "float_under(box.low[static_cast<int>(k)])",
            "-float_under(-box.low[static_cast<int>(k)])",
        ),
        ("surface_planes", "bvh/surface.cpp", "-(most + wrong)", "-(0.5 * most)"),
        (
            "surface_sides",
            "mesh_distance/part_gaps.cpp",
            "times > 0 ? part.high : part.low",
            "times < 0 ? part.high : part.low",
        ),
        (
            "surface_rest",
            "mesh_distance/part_gaps.cpp",
            "@dot(absolute(rest), part.half)@ +",
            "0 * dot(rest, part.half)",
        ),
        (
            "surface_boxes_of_nodes",
            "mesh_distance/part_gaps.cpp",
            "(own.half[i] + their_half[i])",
            "0.5 * (own.half[i] + their_half[i])",
        ),
        (
            "surface_corners",
            "mesh_distance/part_gaps.cpp",
            "take_greater(most, dot(n, triangles.corner[2]))",
            "void(most = dot(n, triangles.corner[1]))",
        ),
        (
            "surface_voxels",
            "mesh_distance/part_gaps.cpp",
            "s.half = @columns({points.half, points.half, points.half})@",
            "columns({0, 0, 0})",
        ),
        (
            "surface_corners_of_parts",
            "mesh_distance/part_gaps.cpp",
            "take_greater(most, dot(n, columns(corner)))",
            "void(corner)",
        ),
        (
            "surface_radius",
            "mesh_distance/subtree_gaps.cpp",
            "radius + @b_->parts[e.b.part]->radius@ + error_",
            "0.0",
        ),
        (
            "surface_held",
            "mesh_distance/containment.cpp",
            "winding_number(*o->surface, outer_pose.R_wb.transpose_times(turned + shift)) == 0",
            "winding_number(*o->surface, outer_pose.R_wb.transpose_times(turned + shift)) < 1000",
        ),
        (
            "surface_parity",
            "mesh_distance/containment.cpp",
            "winding_number(*o->surface, outer_pose.R_wb.transpose_times(turned + shift)) == 0",
            "winding_number(*o->surface, outer_pose.R_wb.transpose_times(turned + shift)) % 2 == 0",
        ),
        (
            "surface_inverted",
            "mesh_distance/containment.cpp",
            "winding_number(*o->surface, outer_pose.R_wb.transpose_times(turned + shift)) == 0",
            "winding_number(*o->surface, outer_pose.R_wb.transpose_times(turned + shift)) <= 0",
        ),
        ("surface_parts", "mesh_distance/containment.cpp", "any_of(@surface->parts()@,", "surface->parts().first(1)"),
        ("surface_ties", "bvh/crossing.h", "return @sign(a.z - b.z)@", "0"),
    ),
    # Rows of meshes that depend on rows before them.
    *mutants_of(
        "batches SurfaceBatches.*",
        ("remembers", "mesh_distance/element_search.h", "known_ = {}", "known_ = {.are_apart = known_.are_apart}"),
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
        ("gap_depth", "cover/point_gaps.h", "greater(@greater(beyond_x, beyond_y)@, beyond_z)", "beyond_x"),
        ("gap_side", "cover/point_gaps.h", "@magnitude(y)@ - half[1]", "y"),
        ("gap_end", "cover/point_gaps.h", "out_z = @greater(beyond_z, 0.0f)@", "0.0f"),
        ("gap_planes", "cover/point_gaps.h", "(up + @inner_radius@)", "1.5f * inner_radius"),
    ),
    # Bounds on motions.
    *mutants_of(
        "motions HalfSpans.*:JointCurve.*:MotionBounds.*:MotionRates.*:*MotionOracleTest.*",
        ("motion_bend_of_one", "robot/motion_path_step.h", "speed * (turn + 2 * sum.turn)", "speed * (2 * sum.turn)"),
        ("motion_bend_of_two", "robot/motion_path_step.h", "speed * (turn + 2 * sum.turn)", "speed * turn"),
        (
            "motion_bend_of_carrier",
            "robot/motion_path.cpp",
            "outer.acceleration + 2 * outer.turn * speed",
            "outer.acceleration",
        ),
        ("motion_mimic", "robot/motion_path_step.h", "* @mover.scale@ * kMotionSlack", "1.0"),
        ("motion_travel", "robot/motion_path_step.h", "@mover.reach_travel@ * travel)", "0"),
        (
            "motion_reach",
            "robot/motion_path.cpp",
            "mover.reach = (@across(axis, next_) + beyond_@)",
            "0.99 * (across(axis, next_) + beyond_)",
        ),
        ("motion_turn", "selection/body_motion.cpp", "turn_ = (@2@ * half_angle_", "1.98"),
        ("motion_shift", "selection/body_motion.cpp", "shift_ = @length_of(along_)@", "0.99 * length_of(along_)"),
        ("motion_longer_way", "selection/body_motion.cpp", "s = @sign < 0 ? -1 : 1@", "1"),
        (
            "motion_bend_of_body",
            "motion/motion_bounds.cpp",
            "(radius * motion.turn() + 4 * wrong) * motion.turn()",
            "0 * motion.turn()",
        ),
        ("motion_one_side", "motion/motion_bounds.cpp", "@a.speed + b.speed@, a.acceleration", "b.speed"),
        (
            "motion_drift",
            "motion/motion_bounds.cpp",
            "rates.add_drift(@drift_of(pair.a, moving, placed) + drift_of(pair.b, moving, placed)@ +",
            "0 * drift_of(pair.a, moving, placed)",
        ),
        ("motion_held", "motion/motion_bounds.cpp", "(reach + link.offset) * kUp", "reach * kUp"),
        ("motion_bend", "motion/motion_step.h", "gap(end) - bend", "gap(end)"),
        ("motion_middle", "motion/motion_step.h", "(there < middle ? there : middle) - error", "there - error"),
        ("motion_lean", "motion/motion_step.h", "n + lean_a * @s@", "(0 * s)"),
        (
            "motion_way",
            "motion/motion_span.cpp",
            "difference_below(answer.lower, request.way)",
            "difference_below(answer.lower, 0.9 * request.way)",
        ),
        (
            "motion_boxes",
            "motion/motion_span.cpp",
            "sum_above(speed(pair.a), speed(pair.b)) * node.half()",
            "0.5 * sum_above(speed(pair.a), speed(pair.b)) * node.half()",
        ),
        ("motion_slack", "motion/motion_step.h", "inner + drift * half", "drift * half"),
        ("motion_seer", "motion/motion_step.h", "twist.turn = twist.turn - @seer.turn@", "0.0 * seer.turn"),
        ("motion_contact", "motion/motion_search.cpp", "goal.unproved = @std::min(goal.unproved, begin)@", "begin"),
        ("motion_along_boxes", "motion/motion_span.cpp", "low = @std::min(gaps.before, gaps.after)@", "gaps.middle"),
        (
            "motion_proved_until",
            "motion/motion_step.h",
            "(middle - kept) / (middle - end)",
            "1.5 * (middle - kept) / (middle - end)",
        ),
        (
            "motion_bend_of_curve",
            "motion/motion_bounds.cpp",
            "@link.path.rates(moving.bend[link.robot], travel, beyond).speed@) * kUp",
            "0.0",
        ),
        (
            "motion_span_of_curve",
            "motion/motion_span.cpp",
            "take_span(@node.begin@, node.end, moving)",
            "(0.5 * node.begin + 0.5 * node.end)",
        ),
        ("curve_way", "selection/joint_curve.cpp", "way = std::max(way, @std::abs(p)@)", "0.9 * std::abs(p)"),
        (
            "curve_rest",
            "selection/joint_curve.cpp",
            "std::abs(p - joint.slope * @progress_[i]@)",
            "(1.1 * progress_[i])",
        ),
        ("curve_bend", "selection/joint_curve.cpp", "joint.bend = @2@ * (rest + error)", "1.9"),
        ("curve_pace", "selection/joint_curve.cpp", "farthest_ / (@degree@ * step)", "1"),
        ("curve_sign", "selection/joint_curve.cpp", "i <= degree ? @std::min(r, 0.0)@", "r"),
        ("curve_error", "selection/joint_curve.cpp", "error = @kSpanErrors@ * curves[j].rounding()", "0.0"),
        ("derivative_slope", "selection/joint_curve.cpp", "polar(first, degree_ - 1, @middle@, middle, 0)", "begin"),
        (
            "derivative_change",
            "selection/joint_curve.cpp",
            "(greatest_in(first, degree_ - 1, begin, @end@) + unit)",
            "(0.9 * end + 0.1 * begin)",
        ),
        (
            "derivative_bend",
            "selection/joint_curve.cpp",
            "(greatest_in(second, degree_ - 2, @begin@, end) + 2 * d * unit)",
            "(0.9 * begin + 0.1 * end)",
        ),
        ("derivative_error", "selection/joint_curve.cpp", "found.error = @unit@", "1e-3 * unit"),
    ),
    # Bodies that move or grow meanwhile.
    *mutants_of(
        "motions Meanwhile.*:*MotionOracleTest.*meanwhile",
        ("growth_speed", "motion/motion_bounds.cpp", "rates.speed += @grown.change@", "0.0"),
        ("growth_bend", "motion/motion_bounds.cpp", "(rates.acceleration + @grown.bend@)", "0.0"),
        ("growth_most", "motion/motion_bounds.cpp", "sum.most += @at + rounding@", "0.99 * at"),
        ("growth_least", "motion/motion_bounds.cpp", "sum.least += std::max(@at@ - rounding, 0.0)", "1.001 * at"),
        ("growth_of_boxes", "motion/motion_bounds.cpp", "speeds.push_back((speed + @grown@) * kUp)", "0 * grown"),
        ("growth_slope", "motion/motion_span.cpp", "n * (@request.growth.slope@ / norm(n))", "0.0"),
        (
            "given_way",
            "motion/moving_bodies.cpp",
            "@std::hypot(by[0].change, by[1].change, by[2].change)@ * kMotionSlack",
            "0.9 * std::hypot(by[0].change, by[1].change, by[2].change)",
        ),
        (
            "given_bend",
            "motion/moving_bodies.cpp",
            "@std::hypot(by[0].bend, by[1].bend, by[2].bend)@ * kMotionSlack",
            "0.0",
        ),
        ("given_velocity", "motion/motion_poses.cpp", "own.shift = {s[0], s[1], @s[2]@}", "0.0"),
    ),
    *mutants_of(
        "motions Meanwhile.*",
        ("covered_shift", "decision/span_rates.cpp", "(@by.shift@ + path.reach * by.turn) * kUp", "0.5 * by.shift"),
        ("covered_turn", "decision/span_rates.cpp", "(@path.reach * by.turn * by.turn@ + by.bend)", "0.0"),
        ("covered_bend", "decision/span_rates.cpp", "path.reach * by.turn * by.turn + @by.bend@", "0.0"),
        ("covered_velocity", "decision/given_motions.cpp", "@spans_[body].shift@};", "spans_[body].shift * 0.8"),
        ("covered_growth", "decision/motion_placement.cpp", "static_cast<float>((bend + @growth@) * kUp)", "0.0"),
        ("covered_growth_of_pair", "decision/motion_placement.cpp", "@growths_[pair.a]@ + growths_[pair.b]", "0.0"),
        (
            "covered_growth_of_hit",
            "decision/given_motions.cpp",
            "std::max(@growths_[body].at(time)@ - growths_[body].rounding(), 0.0)",
            "1.01 * growths_[body].at(time)",
        ),
        (
            "covered_growth_of_moved_hit",
            "decision/motion_placement.cpp",
            "grown = double{bodies_[pair.a].grown} + @bodies_[pair.b].grown@",
            "1.01 * bodies_[pair.b].grown",
        ),
        ("covered_growth_in_span", "decision/given_motions.cpp", "@spans_[body].growth@ * half", "0.0"),
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
    *DECISION_MUTANTS,
    *KERNEL_MUTANTS,
    *SECOND_ORDER_MUTANTS,
]
