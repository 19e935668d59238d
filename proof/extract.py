#!/usr/bin/env python3
"""Writes Source.v: the expressions that the bounds of two convex parts are made of, read from the C++ source.

    proof/extract.py SOURCE_ROOT >Source.v

Each operation of the source becomes one operation of `arith` (Arithmetic.v), in the same order. A text that this
program does not know is an error, and so is a passage that differs from proof/text.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from cpp import MATRIX, SCALAR, VECTOR, Scope, Unknown, number, tokens_of
from passages import ARITHMETIC, CERTIFY, CERTIFY_CPP, VEC, Source, passages
from statements import Runner, parameters, value


def plain(text: str) -> str:
    """Calls that choose an overload by its last argument, indexed points and error terms, as names."""
    text = re.sub(r"(\w), T\(\)\)", r"\1)", text)
    text = re.sub(r"\b(points_[ab])\[(i[ab])\]", r"\1.\2", text)
    text = re.sub(r"\bto_double\((D)\)", r"\1", text)
    text = re.sub(r"Real::load_unaligned\(v\.([xyz]) \+ i\)", r"vertex.\1", text)
    return re.sub(r"\bpair\.(lower|upper)_error\(\)", r"pair.\1_error", text)


class Writer:
    def __init__(self, source: Source):
        self.source, self.lines = source, []
        self.constants: dict[str, tuple[str, str]] = {}

    def define(self, name: str, kinds: dict[str, str], kind: str, term: str, where: str) -> None:
        where = where.replace("(*", "( *")  # no comment in the comment
        self.lines.append(f"(* {where} *)\nDefinition {name} {parameters(kinds)} : {kind} :=\n  {term}.\n")

    def scope(self, kinds: dict[str, str], names: dict[str, str] | None = None) -> Scope:
        """Parameters of a function by their C++ names, where these differ from those in Coq."""
        values = dict(self.constants)
        for coq, kind in kinds.items():
            values[(names or {}).get(coq, coq)] = (kind, coq)
        return Scope(values)

    def constant(self, file: str, struct: str, cpp: str, coq: str) -> None:
        self.define(coq, {}, SCALAR, number(self.source.value(file, struct, cpp)), f"{file}: {struct}<double>::{cpp}")
        self.constants[f"{struct}::{cpp}"] = (SCALAR, coq)

    def function(
        self, file: str, anchor: str, name: str, kinds: dict[str, str], kind: str, names=None, extra=None
    ) -> None:
        """A function whose statements are all known."""
        try:
            scope = self.scope(kinds, names)
            scope.values.update(extra or {})
            runner = Runner(tokens_of(plain(self.source.body(file, anchor))), scope, kind)
            result = runner.run()
            if result is None:
                raise Unknown("no return")
            runner.finish()
            self.define(name, kinds, kind, " ".join([*scope.lets, result]), f"{file}: {anchor.strip()}")
        except Unknown as unknown:
            raise Unknown(f"{file}: {name} ({anchor.strip()}): {unknown}") from unknown

    def term(self, hole: str, scope: Scope, kind: str) -> tuple[str, str]:
        """File and term of an expression in a passage, every token of which is used."""
        file, text = self.source.expression(hole)
        try:
            return file, value(tokens_of(plain(text)), scope, kind)
        except Unknown as unknown:
            raise Unknown(f"{file}: {hole} ({text}): {unknown}") from unknown

    def expression(self, name: str, kinds: dict[str, str], kind: str, names: dict[str, str] | None = None) -> None:
        file, term = self.term(name, self.scope(kinds, names), kind)
        self.define(name, kinds, kind, term, f"{file}: @{name}@ of proof/text")


def write_vectors(w: Writer) -> None:
    two = dict(a=VECTOR, b=VECTOR)
    w.function(VEC, "friend Vec3 operator+(const Vec3& a, const Vec3& b)", "vadd", two, VECTOR)
    w.function(VEC, "friend Vec3 operator-(const Vec3& a, const Vec3& b)", "vsub", two, VECTOR)
    w.function(VEC, "friend Vec3 operator-(const Vec3& a)", "vneg", dict(a=VECTOR), VECTOR)
    w.function(VEC, "friend Vec3 operator*(const Vec3& a, const T& s)", "vscale", dict(a=VECTOR, s=SCALAR), VECTOR)
    w.function(VEC, "inline T dot(const Vec3<T>& a, const Vec3<T>& b)", "dot", two, SCALAR)
    w.function(VEC, "inline T squared_norm(const Vec3<T>& a)", "squared_norm", dict(a=VECTOR), SCALAR)
    w.function(VEC, "inline T norm(const Vec3<T>& a)", "norm", dict(a=VECTOR), SCALAR)
    apply = dict(m=MATRIX, v=VECTOR)
    w.function(VEC, "friend Vec3<T> operator*(const Mat3& m, const Vec3<T>& v)", "mat_times", apply, VECTOR)
    rows = {f"row[{i}]": (VECTOR, f"(row{i} m)") for i in range(3)}
    w.function(VEC, "Vec3<T> transpose_times(const Vec3<T>& v) const", "transpose_times", apply, VECTOR, extra=rows)
    w.function(
        VEC,
        "Mat3 transpose_times(const Mat3& b) const",
        "transpose_times_mat",
        dict(m=MATRIX, b=MATRIX),
        MATRIX,
        extra=rows,
    )


def write_terms(w: Writer) -> None:
    w.constant(ARITHMETIC, "Arithmetic", "kUnit", "unit")
    w.constant(ARITHMETIC, "Arithmetic", "kUnderflowLength", "underflow_length")
    w.constant(ARITHMETIC, "Arithmetic", "kSafelySquared", "safely_squared")
    w.constant(CERTIFY, "RoundingUnits", "kLower", "lower_units")
    w.constant(CERTIFY, "RoundingUnits", "kUpper", "upper_units")
    w.function(
        CERTIFY,
        "inline T pair_scale(const Vec3<T>& D, const T& rho_a, const T& rho_b, const T& radius)",
        "pair_scale",
        dict(D=VECTOR, rho_a=SCALAR, rho_b=SCALAR, radius=SCALAR),
        SCALAR,
    )
    w.function(
        CERTIFY,
        "inline T rounding_error(const T& units, const T& scale)",
        "rounding_error",
        dict(units=SCALAR, scale=SCALAR),
        SCALAR,
    )
    names = dict(gap=SCALAR, length=SCALAR, radius=SCALAR, error=SCALAR)
    w.function(
        CERTIFY,
        "inline T lower_from_gap(const T& gap, const T& length, const T& radius, const T& error)",
        "lower_from_gap",
        names,
        SCALAR,
    )
    del names["gap"]
    w.function(
        CERTIFY,
        "inline T upper_from_point(const T& length, const T& radius, const T& error)",
        "upper_from_point",
        names,
        SCALAR,
    )


def write_simplex_point(w: Writer) -> None:
    kinds = {f"weight{i}": SCALAR for i in range(4)} | {f"w{i}": VECTOR for i in range(4)}
    names = {f"weight{i}": f"s.weight[{i}]" for i in range(4)} | {f"w{i}": f"s.vertex[{i}].w" for i in range(4)}
    scope = w.scope(kinds, names)
    unset = "(whole 0)"  # of members, which are set before they are read: a loop sets all four shares first
    scope.values.update({f"share[{i}]": (SCALAR, unset) for i in range(4)}, w=(VECTOR, f"(V {unset} {unset} {unset})"))
    try:
        runner = Runner(tokens_of(w.source.body(CERTIFY, "explicit SimplexPoint(const Simplex<T>& s)")), scope)
        runner.run()
        runner.finish()
    except Unknown as unknown:
        raise Unknown(f"{CERTIFY}: SimplexPoint: {unknown}") from unknown
    w.lines.append(
        "(* engine/narrow/certify.h: SimplexPoint *)\nDefinition simplex_point (size : nat) "
        f"{parameters(kinds)} : vec T :=\n  " + "\n  ".join(scope.lets) + f"\n  {scope.values['w'][1]}.\n"
    )


def write_frame(w: Writer) -> None:
    w.expression("frame_R", dict(R_wa=MATRIX, R_wb=MATRIX), MATRIX)
    w.expression("frame_D", dict(R_wa=MATRIX, t_a=VECTOR, t_b=VECTOR), VECTOR)
    w.expression("cso_vertex", dict(R=MATRIX, D=VECTOR, a=VECTOR, b=VECTOR), VECTOR)


def write_placed(w: Writer) -> None:
    """PlacedPair and certify_*(), which single pairs use."""
    vectors, scalars = dict(b=VECTOR, a=VECTOR), dict(a=SCALAR, b=SCALAR)
    w.function(
        CERTIFY_CPP, "Vec3<double> difference(const Vec3d& b, const Vec3d& a, double)", "difference", vectors, VECTOR
    )
    w.function(CERTIFY_CPP, "double sum(double a, double b, double)", "sum", scalars, SCALAR)
    w.expression("placed_R", dict(R_a=MATRIX, R_b=MATRIX), MATRIX)
    w.expression("placed_D", dict(R_a=MATRIX, t_a=VECTOR, t_b=VECTOR), VECTOR)
    radii, names = dict(r_a=SCALAR, r_b=SCALAR), dict(r_a="part_a.radius", r_b="part_b.radius")
    w.expression("placed_radius", radii, SCALAR, names)
    names |= dict(rho_a="part_a.rho", rho_b="part_b.rho")
    w.expression("placed_scale", dict(D=VECTOR, rho_a=SCALAR, rho_b=SCALAR) | radii, SCALAR, names)
    w.expression("placed_error", dict(units=SCALAR, scale=SCALAR), SCALAR)
    points = {"a": "points_a.ia", "b": "points_b.ib"}
    w.expression("placed_cso_vertex", dict(R=MATRIX, D=VECTOR, a=VECTOR, b=VECTOR), VECTOR, points)
    rest = dict(radius=SCALAR, error=SCALAR)
    names = {"radius": "pair.radius", "error": "pair.lower_error"}
    w.expression("placed_lower", dict(gap=SCALAR, length=SCALAR) | rest, SCALAR, names)
    names = {"w": "point.w", "radius": "pair.radius", "error": "pair.upper_error"}
    w.expression("placed_upper", dict(w=VECTOR) | rest, SCALAR, names)


def write_runs(w: Writer) -> None:
    gap = dict(D=VECTOR, v=VECTOR, value_a=SCALAR, value_b=SCALAR)
    values = {"value_a": "a.value", "value_b": "b.value"}
    w.expression("support_gap", gap, SCALAR, {"D": "pair_.D"} | values)
    w.expression("lanes_gap", gap, SCALAR, {"D": "at.D", "v": "g.v"} | values)
    along = dict(R=MATRIX, v=VECTOR)
    w.expression("along_a", along, VECTOR, {"R": "pair_.R"})
    w.expression("along_b", along, VECTOR, {"R": "pair_.R"})
    direction = dict(D=VECTOR, n=VECTOR, value_a=SCALAR, value_b=SCALAR)
    w.expression("direction_gap", direction, SCALAR, {"D": "pair.D", "value_a": "sa.value", "value_b": "sb.value"})
    w.expression("direction_back", dict(R=MATRIX, n=VECTOR), VECTOR, {"R": "pair.R"})
    # The product that a scan takes the largest of.
    w.expression("scan_product", dict(n=VECTOR, vertex=VECTOR), SCALAR, {"n": "direction"})
    write_run_bounds(w)


def write_run_bounds(w: Writer) -> None:
    """RunBounds: `low` and `high`, with the lengths and units that they name."""
    rest = dict(radius=SCALAR, scale=SCALAR, extra=SCALAR, round_units=SCALAR)
    for name, kinds, names, length, units in (
        ("run_lower", dict(v=VECTOR, gap=SCALAR) | rest, {"v": "g.v", "gap": "g.gap"}, "v_length", "lower_units"),
        ("run_upper", dict(w=VECTOR) | rest, {"w": "nearest.w"}, "length", "upper_units"),
    ):
        scope = w.scope(kinds, names)
        for named in (length, units):
            scope.values[named] = (SCALAR, w.term(named, scope, SCALAR)[1])
        file, term = w.term(name, scope, SCALAR)
        w.define(name, kinds, SCALAR, term, f"{file}: RunBounds")


def write(source: Source) -> str:
    for file, passage in passages():
        source.compare(file, passage)
    w = Writer(source)
    for part in (write_vectors, write_terms, write_simplex_point, write_frame, write_runs, write_placed):
        part(w)
    if source.holes:
        raise Unknown(f"expressions of proof/text that are not read: {', '.join(source.holes)}")
    return (
        "(* Written by proof/extract.py from the C++ source: not to be edited. *)\n"
        "From Coq Require Import ZArith Bool.\nFrom Clearance Require Import Arithmetic Model.\n\n"
        "Section Source.\nContext {A : arith}.\n\n" + "\n".join(w.lines) + "\nEnd Source.\n"
    )


if __name__ == "__main__":
    try:
        sys.stdout.write(write(Source(Path(sys.argv[1]))))
    except Unknown as unknown:
        sys.exit(f"error: the proof does not cover the source as it is now: {unknown}")
