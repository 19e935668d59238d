"""Mutants of second derivatives of distances, and of the intervals of their rates."""

from __future__ import annotations

from mutant import mutants_of

_PAIR, _ORDER, _RATE = "evaluate/feature_pair.cpp", "evaluate/second_order.cpp", "evaluate/rate_bounds.cpp"
_GAP = "evaluate/part_gap.h"
_KINEMATIC = "dot(features.normal(), @cross(carrier.spin, carried.shift)@)"

SECOND_ORDER_MUTANTS = [
    # Terms of the Hessian: docs/trust/bounds_robots.md, "Second order".
    *mutants_of(
        "second_order SecondOrder.O*:SecondOrder.T*:SecondOrder.W*",
        ("term_across", _PAIR, "(motion.shift - @normal_ * dot(normal_, motion.shift)@)", "normal_ * 0.0"),
        ("term_slide", _PAIR, "double sum = @dot(along(i), motion.shift) / root@", "0.0"),
        ("term_turn", _PAIR, "/ root + @root * dot(normal_, cross(spin, along(i)))@", "0.0"),
        ("term_turn_b", _PAIR, "spin = i < b_.size ? @motion.spin_b@", "motion.spin_a"),
        ("slides_metric", _PAIR, "whole = @dot(along(i), along(j))@", "(i == j ? 1.0 : 0.0)"),
        ("kinematic_hessian", _ORDER, _KINEMATIC, "Vec3d{0, 0, 0}"),
        ("kinematic_order", _ORDER, _KINEMATIC, "cross(carried.spin, carried.shift)"),
        ("curvature_twice", _ORDER, "curvature += (x == y ? 1 : @2@)", "1"),
        ("twist_arm", _ORDER, "1, 1, spin, @cross(spin, point - origin)@", "Vec3d{0, 0, 0}"),
        ("radius_interior", _PAIR, "std::min({@interior@, a.cone_radius", "__builtin_inf()"),
        ("radius_cone", _PAIR, "return std::min(@distance * std::sqrt(gap_squared / arm_squared)@", "__builtin_inf()"),
    ),
    # Those of robots alone.
    *mutants_of(
        "second_order SecondOrder.Is*",
        ("term_turn_a", _PAIR, "motion.spin_b : @motion.spin_a@", "motion.spin_b"),
        ("term_complement", _PAIR, "sum -= @factor_[i][k] * term.slide[k]@", "0.0"),
        ("hessian_mimic", _ORDER, "value * carried.scale * @carrier.scale@", "1.0"),
        ("joint_arm", _ORDER, "speed(at), axis, @cross(axis, point - link.t_w)@", "cross(axis, point)"),
    ),
    # Curved cores.
    *mutants_of(
        "second_order SecondOrderOfRoundCores.*",
        ("term_bend", _PAIR, "@distance_ * bend(i, j)@", "0.0"),
    ),
    # Intervals of rates: "Rates".
    *mutants_of(
        "second_order RateBounds.*",
        ("rate_turn_a", _RATE, "along_a = d + @lean.a * time@", "lean.a * 0.0"),
        ("rate_turn_b", _RATE, "along_b = d + @lean.b * time@", "lean.b * 0.0"),
        ("rate_shift", _RATE, "(dot(d, away_) + @time * dot(normal_, shift)@)", "0.0"),
        ("rate_lean", _RATE, "lean.normal = @features_->lean(lean.a, lean.b, begin_with_a)@", "Vec3d{0, 0, 0}"),
        ("rate_upper", _RATE, "longest = norm(normal_ + lean.normal * t) * @upper_@", "0.999 * upper_"),
        ("rate_inner", _RATE, "difference_below(gap, error), @longest * inner_ * kUp@)", "0.0"),
        ("rate_part_gap", _GAP, "apart = boxes > 0 ? @boxes@", "1.001 * boxes"),
        ("rate_part_overlap", _GAP, "? boxes : @-std::numeric_limits<double>::infinity()@", "0.0"),
        ("rate_parts", _RATE, "if (@other.beyond@) continue", "true"),
        ("radius_parts", _ORDER, "radius = @std::clamp((other.bounds.lower - distance) / 2, 0.0, radius)@", "radius"),
        ("rate_turn_errors", _ORDER, "sum += @errors[0]@ * (away", "0.0"),
        ("rate_tilt_errors", _ORDER, "displaced = @(norm(m.shift) + turn * turn_arm) * tilt@", "0.0"),
        ("rate_shift_errors", _ORDER, "(away + reach) + @errors[1]@", "0.0"),
    ),
]
