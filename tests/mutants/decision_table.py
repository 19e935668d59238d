"""The mutants of decisions by covers (table.py)."""

from mutant import mutants_of

DECISION_MUTANTS = [
    *mutants_of(
        "decisions",
        # Errors of placed balls and of obstacles.
        ("decision_reach_error", "decision/cover_plan.cpp", "(@40 * reach@ + 8 * farthest)", "0.0"),
        ("decision_place_error", "decision/cover_plan.cpp", "(40 * reach + @8 * farthest@)", "0.0"),
        ("decision_world_error", "decision/cover_pairs.cpp", "up(obstacle->error + @world_error@)", "0.0"),
        # Radii of a pair.
        (
            "decision_margin",
            "decision/cover_pairs.cpp",
            "grow = (@p.margin@ + p.slack.inner + error)",
            "0.999 * p.margin",
        ),
        (
            "decision_hit_margin",
            "decision/cover_pairs.cpp",
            "shrink = @p.margin@ - (p.slack.outer + error)",
            "1.001 * p.margin",
        ),
        ("decision_slack", "decision/cover_pairs.cpp", "(p.margin + @p.slack.inner@ + error)", "0.0"),
        ("decision_moved_margin", "decision/cover_pairs.cpp", "up((@margin@ + slack.inner + error)", "0.999 * margin"),
        (
            "decision_moved_hit_margin",
            "decision/cover_pairs.cpp",
            "down(@margin@ - (slack.outer + error)",
            "1.001 * margin",
        ),
        ("decision_moved_slack", "decision/cover_pairs.cpp", "up((margin + @slack.inner@ + error)", "0.0"),
        ("decision_root_outer", "decision/cover_pairs.cpp", "up(@root.outer@ + grow)", "0.99 * root.outer"),
        ("box_reach", "decision/cover_pairs.cpp", "up((@root.outer@ + grow + boxed", "0.98 * root.outer"),
        ("box_grow", "decision/cover_pairs.cpp", "up((root.outer + @grow@ + boxed", "0.0"),
        ("box_half", "decision/cover_pairs.cpp", "up(@sum@ * (1 + 0x1p-20))", "0.9 * sum"),
        ("box_axes", "decision/cover_pairs.cpp", "o.axes[@3 * k + i@]", "3 * i + k"),
        (
            "box_planes",
            "decision/cover_pairs.cpp",
            "{box, @double{o.outer_radius}@ + o.radius}",
            "0.9 * o.outer_radius",
        ),
        ("decision_root_inner", "decision/cover_pairs.cpp", "down(@root.inner@ + shrink)", "1.01 * root.inner"),
        (
            "decision_moved_reach",
            "decision/cover_pairs.cpp",
            "cover(pair.b)->root.outer + @pair.grow@)",
            "0.0",
        ),
        # Slack of all states.
        (
            "decision_slack_of_parent",
            "decision/slack_bounds.cpp",
            "parent == kNone ? nullptr : @&uncertainty(parent)@",
            "nullptr",
        ),
        ("decision_farthest", "decision/slack_bounds.cpp", "(@own@ + (is_carried ?", "0.1 * own"),
        # The search through balls.
        ("decision_open", "decision/kernel/decide_kernel.h", "if (!(result & @kOpen@)) return;", "Bits{8}"),
        (
            "decision_packets",
            "decision/kernel/decide_kernel.h",
            "Bits result = 0; for (std::uint32_t p = 0; p < @b.root_packets@; ++p) {",
            "1u",
        ),
        (
            "decision_outer",
            "decision/kernel/decide_kernel.h",
            "still = @Eight::load(packet.outer)@ + Eight(grow)",
            "Eight(0.0f)",
        ),
        (
            "decision_grow",
            "decision/kernel/decide_kernel.h",
            "still = Eight::load(packet.outer) + @Eight(grow)@",
            "Eight(0.99f * grow)",
        ),
        (
            "decision_inner",
            "decision/kernel/decide_kernel.h",
            "inner = @Eight::load(packet.inner)@ + Eight(shrink)",
            "Eight::load(packet.outer)",
        ),
        (
            "decision_shrink",
            "decision/kernel/decide_kernel.h",
            "inner = Eight::load(packet.inner) + @Eight(shrink)@",
            "Eight(1.01f * shrink)",
        ),
        (
            "decision_leaf",
            "decision/kernel/decide_kernel.h",
            "stand_out(packet, i)) || --packets_left_ < 0) { result |= @kOpen@;",
            "Bits{0}",
        ),
        (
            "decision_moved_roots",
            "decision/kernel/decide_kernel.h",
            "@v_.moved_root_inner[pair.a]@ + v_.moved_root_inner",
            "2 * v_.moved_root_inner[pair.a]",
        ),
        ("decision_near_a", "decision/kernel/placed_balls.h", "Eight(@v_.moved_root_outer[other]@ + grow)", "0.0f"),
        (
            "decision_near_grow",
            "decision/kernel/placed_balls.h",
            "Eight(v_.moved_root_outer[other] + @grow@)",
            "0.0f",
        ),
        (
            "decision_moved_leaf",
            "decision/kernel/ball_pairs.h",
            "result |= near >> j & 1 ? kOpen | kNear : @kOpen@;",
            "Bits{0}",
        ),
        (
            "decision_moved_children",
            "decision/kernel/ball_pairs.h",
            "ball = {&packet, &below, @first(packet.count)@};",
            "first(packet.count) >> 1",
        ),
        (
            "decision_moved_outer",
            "decision/kernel/ball_pairs.h",
            "still = outer_q + @Eight(p.outer[i])@",
            "Eight(0.0f)",
        ),
        (
            "decision_moved_inner",
            "decision/kernel/ball_pairs.h",
            "greater(inner_q + @Eight(p.inner[i])@, d)",
            "Eight(p.outer[i])",
        ),
        (
            "decision_moved_grow",
            "decision/kernel/ball_pairs.h",
            "outer_q = Eight::load(q.outer) + @Eight(pair.grow)@",
            "Eight(0.99f * pair.grow)",
        ),
        # Tables.
        (
            "decision_table_margin",
            "decision/table_plan.cpp",
            "-cells_below(-(@margin@ + of_pair.inner)",
            "0.9 * margin",
        ),
        ("decision_table_hit", "decision/table_plan.cpp", "cells_below(@margin@ - of_pair.outer", "1.1 * margin"),
        (
            "decision_table_of",
            "decision/table_plan.cpp",
            "[&](const auto& m) { return @m.column == column@; }",
            "m.column + 1 == column",
        ),
        (
            "decision_table_free",
            "decision/kernel/table_lookup.h",
            "is_free_[t] = cell && @cell->low@ > pair.free_above",
            "cell->high",
        ),
        (
            "decision_table_hit_above",
            "decision/kernel/table_lookup.h",
            "if (cell && @cell->high@ < pair.hit_below) hit",
            "cell->low",
        ),
        # Pairs that the exact engine decides.
        (
            "decision_unknown",
            "query/decision_job.cpp",
            "Verdict::kFree && @covers().unknown().empty()@",
            "true",
        ),
        (
            "decision_left_unknown",
            "query/decision_job.cpp",
            "open.insert(open.end(), @covers().unknown().begin()@",
            "covers().unknown().end()",
        ),
        # Distances.
        ("distance_drop_far", "decision/kernel/least_bounds.h", "lay_aside(@of[i].lower@, of[i].position)", "1e30f"),
        ("distance_no_upper", "decision/kernel/least_bounds.h", "result.upper = upper_ > @kMost@ ?", "1e38"),
        (
            "distance_left_again",
            "decision/kernel/least_bounds.h",
            "known->lower = @lower < known->lower@ ? lower : known->lower",
            "false",
        ),
        (
            "distance_sift",
            "decision/kernel/least_bounds.h",
            "far = greater(lower, F(@threshold_@))",
            "0.9f * threshold_",
        ),
        (
            "distance_box",
            "decision/kernel/placed_roots.h",
            "return root(@squares_to_box(obstacle, begin)@) -",
            "Sixteen(4.0f) * squares_to_box(obstacle, begin)",
        ),
        (
            "distance_root_low",
            "decision/kernel/cell_bounds.h",
            "Eight::load(gaps.low) - @outer@).store(room_.lows + at)",
            "Eight::load(v_.root_inner + at)",
        ),
        (
            "distance_root_high",
            "decision/kernel/cell_bounds.h",
            "Eight::load(gaps.high) - @Eight::load(v_.root_inner + at)@",
            "Eight::load(v_.root_outer + at)",
        ),
        (
            "distance_moved_low",
            "decision/kernel/cell_bounds.h",
            "d - @Eight::load(v_.moved_reach + k)@",
            "Eight::load(batch_.moved_inner + k)",
        ),
        (
            "distance_moved_high",
            "decision/kernel/cell_bounds.h",
            "d - @Eight::load(batch_.moved_inner + k)@",
            "Eight::load(v_.moved_reach + k)",
        ),
        (
            "distance_table_low",
            "decision/kernel/cell_bounds.h",
            "static_cast<float>(@cell.low@ - pair.free_above)",
            "cell.high",
        ),
        (
            "distance_table_high",
            "decision/kernel/cell_bounds.h",
            "static_cast<float>(@cell.high@ - pair.hit_below)",
            "cell.low",
        ),
        (
            "distance_outer",
            "decision/kernel/ball_search.h",
            "const F outer = @of_balls(packets->outer)@ + F(v_.grow[cell])",
            "of_balls(packets->inner)",
        ),
        (
            "distance_inner",
            "decision/kernel/ball_search.h",
            "inner = @of_balls(packets->inner)@ + F(v_.shrink[cell])",
            "of_balls(packets->outer)",
        ),
        (
            "distance_pair_outer",
            "decision/kernel/ball_search.h",
            "sift(d - (outer + @Eight(of.b.outer[j])@)",
            "Eight(of.b.inner[j])",
        ),
        (
            "distance_pair_inner",
            "decision/kernel/ball_search.h",
            "take_upper(d - (inner + @Eight(of.b.inner[j])@)",
            "Eight(of.b.outer[j])",
        ),
        (
            "distance_moved_shrink",
            "query/distance/cover_bounds.cpp",
            "view.moved_root_inner[pair.b] + @pair.shrink@",
            "0.0",
        ),
        ("distance_parts", "query/distance/pair_groups.cpp", "cell < @of_obstacles@; ++cell)", "view.columns"),
        (
            "distance_packets",
            "decision/kernel/ball_search.h",
            "F::load_blocks(from, @sizeof(BallPacket) / sizeof(float)@)",
            "0",
        ),
        (
            "distance_centres",
            "decision/kernel/ball_search.h",
            "F::load_blocks(from, @sizeof(Centres) / sizeof(float)@)",
            "0",
        ),
    ),
    # Bounds of roots by boxes, and of those that boxes do not leave out.
    *mutants_of(
        "decisions DistanceBounds.*",
        (
            "distance_box_reach",
            "decision/kernel/placed_roots.h",
            "begin)) - @Sixteen::load(v_.box_reach + std::size_t{obstacle} * v_.columns + begin)@;",
            "Sixteen(0.5f) * Sixteen::load(v_.box_reach + std::size_t{obstacle} * v_.columns + begin)",
        ),
        (
            "distance_gap_low",
            "decision/kernel/cell_bounds.h",
            "(gap - @Sixteen::load(v_.root_outer + first)@).store(room_.lows + first)",
            "Sixteen::load(v_.root_inner + first)",
        ),
        (
            "distance_gap_high",
            "decision/kernel/cell_bounds.h",
            "high.take(gap - @Sixteen::load(v_.root_inner + first)@,",
            "Sixteen::load(v_.root_outer + first)",
        ),
        (
            "distance_gap_radius",
            "decision/kernel/cloud_gaps.h",
            "core_gap(kind, half, along_x, along_y, along_z) - @F(obstacle.radius)@",
            "F(0.0f)",
        ),
        ("distance_gap_axes", "decision/kernel/cloud_gaps.h", "F(obstacle.axes[@3 * row + k@])", "3 * k + row"),
        ("distance_near_blocks", "decision/kernel/distance_kernel.h", "near >>= @kBalls@, at += kBalls", "2 * kBalls"),
        (
            "distance_aside_raised",
            "decision/kernel/distance_kernel.h",
            "least_.lay_aside(@aside.bound()@, v_.position[cell])",
            "room_.lows[cell]",
        ),
        ("distance_least_lane", "decision/kernel/cell_bounds.h", "@lowest(equal(least_, Sixteen(bound)))@;", "0"),
        ("distance_least_cell", "decision/kernel/cell_bounds.h", "static_cast<float>(@first / kColumns@)", "0"),
        (
            "distance_lay_aside",
            "decision/kernel/distance_kernel.h",
            "if (const std::size_t cell = aside.at(); @cell != LeastCell::kNoCell@)",
            "false",
        ),
    ),
    # States side by side.
    *mutants_of(
        "decisions StateLanes.*",
        ("distance_cells", "decision/kernel/cell_bounds.h", "batch_.cells + @k * v_.tabled_count@ : find(k)", "0"),
        ("lane_frames", "decision/kernel/placed_balls.h", "frames_ = &of_states_[0][0][@k@],", "0"),
        ("lane_usable", "decision/state_lanes.cpp", "usable_[k] &= @is_good@;", "true"),
        ("lane_first", "query/covered_job.cpp", "lanes.place(@k@, here)", "begin"),
    ),
    # Poses that the query gives.
    *mutants_of(
        "decisions PoseDecisions.RowsNear*",
        ("pose_along", "decision/slack_bounds.cpp", "uncertainty_of(body, {{@own@, 0, 0}}", "0.1 * own"),
        ("pose_length", "decision/cover_plan.cpp", "@normalize(poses[m])@", "(void)0"),
    ),
    *mutants_of(
        "decisions PoseDecisions.SlackIs*",
        (
            "pose_far",
            "decision/cover_plan.cpp",
            "norm(poses[m].translation) <= @most_distance_[m]@)",
            "HUGE_VAL",
        ),
    ),
    *mutants_of(
        "decisions PoseDecisions.Followers*",
        ("pose_carrier", "decision/cover_plan.cpp", "? @!has_pose_[decided.carrier]@ :", "false"),
    ),
    *mutants_of(
        "decisions PoseDecisions.Stale*",
        (
            "pose_parent",
            "decision/cover_plan.cpp",
            "parent != kNone && @snapshot_.placed[parent].status != Status::kOk@)",
            "false",
        ),
    ),
    # The tree of obstacles, and an open pair that is forgotten.
    *mutants_of(
        "decisions PoseDecisions.RowsAmong*",
        ("node_reach", "decision/cover_pairs.cpp", "@longer(o.outer_radius)@", "0.5 * longer(o.outer_radius)"),
        ("node_box", "decision/cover_pairs.cpp", "longer(std::sqrt(@x * x + y * y + z * z@))", "x * x + y * y"),
        ("node_cylinder", "decision/cover_pairs.cpp", "longer(std::sqrt(@x * x + z * z@))", "z * z"),
        ("node_below", "decision/cover_pairs.cpp", "take(out.node_bound_.data() + @below@ * columns", "(n + 1)"),
        ("node_skip", "decision/cover_pairs.cpp", "below = @out.nodes_[below].skip@)", "node.skip"),
        (
            "decision_left_open",
            "query/decision_job.cpp",
            "room.open.begin() + @decision.open_end@)",
            "(decision.open_end > decision.open_begin + 1 ? decision.open_end - 1 : decision.open_end)",
        ),
    ),
    # Pairs of bodies that stay.
    *mutants_of(
        "decisions StillPairs.Rows*",
        ("still_box", "evaluate/still_pairs.cpp", "(@gap > plan.margins.of(p)@)", "true"),
        ("still_answer", "evaluate/still_pairs.cpp", "decides_ && @answers_[i].status == Status::kBeyond@", "true"),
    ),
    *mutants_of(
        "decisions StillPairs.Distances*",
        (
            "still_lower",
            "evaluate/still_pairs.cpp",
            "bounds_[i].lower = @answers_[i].lower@",
            "answers_[i].upper + 0.01",
        ),
        ("still_upper", "query/distance/cover_bounds.cpp", "@-down(-pair.upper)@", "0.99f * -down(-pair.upper)"),
    ),
    # Cells of joint tables, found before the kinematics.
    *mutants_of(
        "table_decisions TableDecisions.CellsOf*",
        (
            "state_cells",
            "decision/state_lanes.cpp",
            "cells_.begin() + static_cast<std::ptrdiff_t>(@k * tabled.size()@)",
            "0",
        ),
        (
            "decision_cells",
            "decision/kernel/decide_kernel.h",
            "batch.cells ? batch.cells + @k * v_.tabled_count@ :",
            "0",
        ),
    ),
]
