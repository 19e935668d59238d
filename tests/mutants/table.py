"""The mutants: deliberate errors in the engine, each of which a test must find.

Each has a name, the program that must find it (CMakeLists.txt), a file below engine/, and edits. Where other tests of
the program are slow, a group of mutants names the tests that must find them. An edit is a text that stands in the file
exactly once, and an expression that replaces it, or the part of it between two @. All mutants of a file are compiled
together, each as `clearance_mutant == NUMBER ? (replacement) : (original)`; the environment variable CLEARANCE_MUTANT
selects one. A replacement that begins with = stands in all of them.
"""

from __future__ import annotations

from cover_table import COVER_MUTANTS
from decision_table import DECISION_MUTANTS
from kernel_table import KERNEL_MUTANTS
from motion_decision_table import MOTION_DECISION_MUTANTS
from motion_table import MOTION_MUTANTS
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
    "decision/kernel/ball_search.h": ["decision/kernel/decide_baseline.cpp", "decision/kernel/decision_kernels.cpp"],
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
    # Jobs that answer again.
    *mutants_of(
        "held_jobs",
        ("held_snapshot", "engine.cpp", "snapshot = @impl_->poses.same(state.kept_for)@;", "state.kept_for.lock()"),
    ),
    *COVER_MUTANTS,
    *MOTION_MUTANTS,
    *DECISION_MUTANTS,
    *MOTION_DECISION_MUTANTS,
    *KERNEL_MUTANTS,
    *SECOND_ORDER_MUTANTS,
]
