"""The mutants of kernels that are compiled for the host, too (table.py)."""

from mutant import mutants_of

KERNEL_MUTANTS = [
    # Kernels that evaluate clouds and meshes.
    *mutants_of(
        "element_kernels ElementKernels.HoldTheExactDistance",
        (
            "element_boxes",
            "cuda/mesh/element_parts.cuh",
            "- @(x.half[k] + box_.half[k])@",
            "0.5 * (x.half[k] + box_.half[k])",
        ),
        ("element_radius", "cuda/mesh/element_parts.cuh", "radii = @set.hull.radius + part.radius@", "part.radius"),
        ("element_direction", "cuda/mesh/element_parts.cuh", "support(part, R_.transpose_times(@-n_@))", "n_"),
        ("element_planes", "cuda/mesh/element_parts.cuh", "is_ahead ? x.high : -x.low", "is_ahead ? x.low : -x.high"),
        ("element_slabs", "cuda/mesh/element_set.cuh", "along * (@along > 0 ? high : low@)", "along > 0 ? low : high"),
        (
            "element_corners",
            "cuda/mesh/element_set.cuh",
            "fmax(fmax(dot(n, corners[0]), dot(n, corners[1])), dot(n, corners[2]))",
            "dot(n, corners[0])",
        ),
        ("element_held", "cuda/mesh/element_search.cuh", "winding.number == 0", "winding.number < 1000"),
        ("element_inverted", "cuda/mesh/element_search.cuh", "winding.number == 0", "winding.number <= 0"),
        (
            "element_rays",
            "cuda/mesh/element_winding.cuh",
            "sum += crossing(flushed(corners[0]), flushed(corners[1]), flushed(corners[2]), point, oriented)",
            "sum = crossing(flushed(corners[0]), flushed(corners[1]), flushed(corners[2]), point, oriented)",
        ),
    ),
    # Kernels that evaluate pairs of meshes.
    *mutants_of(
        "element_kernels MeshKernels.HoldTheExactDistance",
        (
            "mesh_boxes",
            "cuda/mesh/mesh_parts.cuh",
            "dot(absolute(at_.R.row[k]), b.half)",
            "0.5 * dot(absolute(at_.R.row[k]), b.half)",
        ),
        ("mesh_radius", "cuda/mesh/mesh_parts.cuh", "radii = @a.hull.radius + b.hull.radius@", "a.hull.radius"),
        ("mesh_planes_of_a", "cuda/mesh/mesh_parts.cuh", "is_ahead ? a.high : -a.low", "is_ahead ? a.low : -a.high"),
        ("mesh_planes_of_b", "cuda/mesh/mesh_parts.cuh", "is_ahead ? -b.low : b.high", "is_ahead ? -b.high : b.low"),
        ("mesh_direction", "cuda/mesh/mesh_parts.cuh", "b.reach(at_.R.transpose_times(@-n@)) - a.reach(n)", "n"),
        (
            "mesh_children",
            "cuda/mesh/mesh_parts.cuh",
            "i > 0 && is_into_nodes() ? right_ : first_ + i",
            "is_into_nodes() ? right_ : first_ + i",
        ),
        ("mesh_parts", "cuda/mesh/mesh_search.cuh", "part < @other.part_count@ && !(", "1"),
        (
            "mesh_outer",
            "cuda/mesh/mesh_search.cuh",
            "&outer = @a_holds ? of_a_ : of_b_@, &inner",
            "a_holds ? of_b_ : of_a_",
            "&inner = @a_holds ? of_b_ : of_a_@",
            "a_holds ? of_a_ : of_b_",
        ),
        ("mesh_held", "cuda/mesh/mesh_search.cuh", "!winding.is_sure || @winding.number == 0@", "winding.number <= 0"),
    ),
    # Kernels that evaluate motions.
    *mutants_of(
        "motion_kernels *Arm*:*plate:*graze",
        (
            "motion_kernel_boxes",
            "cuda/motion/motion_kernel.cuh",
            "sum_above(speed(ref.a), speed(ref.b)) * span.half()",
            "0.3 * sum_above(speed(ref.a), speed(ref.b)) * span.half()",
        ),
        (
            "motion_kernel_halves",
            "cuda/motion/motion_rates.cuh",
            "along = @h == 0 ? gaps.before : gaps.after@",
            "gaps.middle",
        ),
        (
            "motion_kernel_behind",
            "cuda/motion/motion_kernel.cuh",
            "wanted = @m.shares[i] != ~0u@",
            "i % 2 == 0 && m.shares[i] != ~0u",
        ),
        (
            "motion_kernel_late",
            "cuda/motion/motion_kernel.cuh",
            "begins_late(@span.begin@, time_of_hit(m, span.motion))",
            "span.end",
        ),
        (
            "motion_kernel_contact",
            "cuda/motion/motion_kernel.cuh",
            "free_no_longer(m, span.motion, @span.begin@)",
            "span.end",
        ),
        ("motion_kernel_beyond", "cuda/motion/motion_lean.cuh", "end = @lower > required@ ?", "lower > margin"),
        ("motion_kernel_before", "cuda/motion/motion_kernel.cuh", "m.seeks_contact && pair.way > 0", "false"),
        ("motion_kernel_least_low", "cuda/motion/motion_rates.cuh", "leave_out(m, span, most.low)", "void(0)"),
        ("motion_kernel_least_halves", "cuda/motion/motion_rates.cuh", "leave_out(m, span, low)", "void(0)"),
        (
            "motion_kernel_least_enough",
            "cuda/motion/motion_least.cuh",
            "required_distance_for(upper, @m.abs_tol@",
            "8 * m.abs_tol",
        ),
        (
            "motion_kernel_least_late",
            "cuda/motion/motion_least.cuh",
            "if (m.seeks_contact && span.late) @free_no_longer(m, span.motion, span.begin)@",
            "void(0)",
        ),
    ),
    # Kernels that evaluate reductions.
    *mutants_of(
        "reduce_kernels ReduceKernels.DecideAsTheCpuDoesUncertainBodies",
        (
            "near_hulls_beyond",
            "cuda/reduce/near_hulls.cuh",
            "!(@true_lower@ > margin)",
            "lower",
        ),
        ("near_boxes", "cuda/reduce/reduce_kernel.cuh", "boxes_of(r.chunk, item.ref, @k@)", "0"),
    ),
    # The bodies that kernels place.
    *mutants_of(
        "reduce_kernels SlackKernels.DifferentiateByJointsAsTheCpuDoes",
        ("placed_frames", "device/placed_slots.h", "is_read[ref & ~kMovedBit] = @1@", "0"),
    ),
]
