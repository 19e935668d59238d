#!/usr/bin/env python3
"""Writes Source.v: the expressions that the bounds of two convex parts are made of, read from the C++ source.

    proof/extract.py SOURCE_ROOT >Source.v

Each operation of the source becomes one operation of `arith` (Arithmetic.v), in the same order. A text that this
program does not know is an error, and so is a changed one of PASSAGES.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from cpp import MATRIX, SCALAR, VECTOR, Scope, Unknown, number, tokens_of
from statements import Runner, parameters, scalar

VEC, ARITHMETIC = "engine/base/vec.h", "engine/base/arithmetic.h"
CERTIFY, CERTIFY_CPP, RUN = "engine/narrow/certify.h", "engine/narrow/certify.cpp", "engine/narrow/pair_run.h"
ATTEMPT, LANES, GJK = "engine/narrow/attempt.h", "engine/narrow/lanes/lanes_kernel.h", "engine/narrow/gjk/gjk.h"
SCAN, OVERLAP, SUPPORT = "engine/hull/lanes/lanes_scan.h", "engine/narrow/overlap.h", "engine/hull/support.cpp"

# Passages without arithmetic of their own that the theorem relies on: each must stand in its file, once.
PASSAGES = [
    (RUN, "struct RunSetup { static constexpr bool kFromCentres = false;"),
    (RUN, "return static_cast<S>(RunSetup<S>::kFromCentres ? hull.spread * (1 + 0x1p-20) : hull.rho);"),
    (RUN, "if constexpr (!RunSetup<S>::kFromCentres) { return {R, D}; } else {"),
    (RUN, "S extra{0};"),
    (CERTIFY, "const T& extra = T(0), const T& stop_below = T(-__builtin_inf()), const T& round_units = T(0))"),
    (CERTIFY, "const Mask proved = (!open_end) & (g.squared_distance > T(Arithmetic<T>::kSafelySquared));"),
    (CERTIFY, "lower = select(proved, low, -infinite); upper = select(proved, high, infinite);"),
    (LANES, "radius.at[lane] = static_cast<T>(hull_a.radius + hull_b.radius);"),
    (LANES, "round_units.at[lane] = static_cast<T>(is_round(lane) ? kRoundUnits : 0);"),
    (LANES, "rho_a.at[lane] = reach_of<T>(hull_a); rho_b.at[lane] = reach_of<T>(hull_b);"),
    (LANES, "scale = pair_scale(at.D, lanes.rho_a.pack(), lanes.rho_b.pack(), limits.radius);"),
    (LANES, "find_farthest<T, kSameHulls>(lanes, -g.v, at.R.transpose_times(g.v), a, b);"),
    (LANES, "const CsoVertex<P> vertex{at.cso_vertex(a.p, b.p), a.index, b.index};"),
    (GJK, "gap = select(running, support_gap, gap);"),
    (GJK, "last = vertex; gap = support_gap;"),
    (CERTIFY_CPP, "double round_down(double x) { return x; } double round_up(double x) { return x; }"),
    (CERTIFY_CPP, "if (!(length > T(0))) return -kInf;"),
    (CERTIFY_CPP, "if (is_round()) units += kRoundUnits;"),
    (CERTIFY_CPP, "return std::isnan(lower) ? -kInf : lower;"),
    (CERTIFY_CPP, "return {std::isnan(upper) ? kInf : upper, to_double(point.core_a)"),
    (CERTIFY_CPP, "simplex.vertex[i].w = pair.cso_vertex(simplex.vertex[i].a, simplex.vertex[i].b);"),
    (CERTIFY_CPP, "const Vec3<T> n = rescaled(direction); const SupportPoint<T> sa = support(*pair.a, n);"),
    (CERTIFY, "double lower_error() const { return error(RoundingUnits<T>::kLower); }"),
    (CERTIFY, "double upper_error() const { return error(RoundingUnits<T>::kUpper); }"),
    (OVERLAP, "const SimplexPoint<T> point(simplex);"),
    (OVERLAP, "w = point.w;"),
    (SUPPORT, "if (const double s = dot(n, part.vertices[i]); s > best.value) best = {i, s};"),
]


class Source:
    """Texts of the source's files, without comments and with single blanks."""

    def __init__(self, root: Path):
        self.root, self.texts = root, {}
        self.read: list[tuple[str, int, int]] = []  # the parts that became terms: file, begin, end

    def text(self, file: str) -> str:
        if file not in self.texts:
            text = re.sub(r"//[^\n]*", "", (self.root / file).read_text())
            self.texts[file] = re.sub(r"\s+", " ", text)
        return self.texts[file]

    def after(self, file: str, anchor: str) -> int:
        """The end of a passage that stands in the file once."""
        text = self.text(file)
        if text.count(anchor) != 1:
            raise Unknown(f"{file}: {text.count(anchor)} times, not once: {anchor}")
        return text.index(anchor) + len(anchor)

    def part(self, file: str, begin: int, end: int) -> str:
        self.read.append((file, begin, end))
        return self.text(file)[begin:end]

    def body(self, file: str, anchor: str) -> str:
        """The block in braces that follows a signature."""
        text = self.text(file)
        begin = text.index("{", self.after(file, anchor))
        depth = 0
        for i in range(begin, len(text)):
            depth += {"{": 1, "}": -1}.get(text[i], 0)
            if depth == 0:
                return self.part(file, begin + 1, i)
        raise Unknown(f"{file}: no end of {anchor}")

    def until(self, file: str, anchor: str, end: str) -> str:
        """The text between two passages."""
        begin = self.after(file, anchor)
        at = self.text(file).find(end, begin)
        if at < 0:
            raise Unknown(f"{file}: no {end!r} after {anchor!r}")
        return self.part(file, begin, at)

    def value(self, file: str, struct: str, name: str) -> str:
        """The constant of a struct for double."""
        begin = self.after(file, f"struct {struct}<double> {{")
        found = re.search(rf"\b{name} = ([^,;]+)[,;]", self.text(file)[begin:].split("}")[0])
        if not found:
            raise Unknown(f"{file}: {struct}<double>::{name}")
        return self.part(file, begin + found.start(1), begin + found.end(1))


def plain(text: str) -> str:
    """Calls that choose an overload by its last argument, indexed points and error terms, as names."""
    text = re.sub(r"(\w), T\(\)\)", r"\1)", text)
    text = re.sub(r"\b(points_[ab])\[(i[ab])\]", r"\1.\2", text)
    text = re.sub(r"\bto_double\((D)\)", r"\1", text)
    return re.sub(r"\bpair\.(?:lower|upper)_error\(\)", "error", text)


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
            if result is None or runner.at != len(runner.tokens):
                raise Unknown("statements after return, or none")
            self.define(name, kinds, kind, " ".join([*scope.lets, result]), f"{file}: {anchor.strip()}")
        except Unknown as unknown:
            raise Unknown(f"{file}: {name} ({anchor.strip()}): {unknown}") from unknown

    def expression(self, file, anchor, end, name, kinds, kind, names=None) -> None:
        """A single expression between two passages."""
        try:
            scope = self.scope(kinds, names)
            runner = Runner(tokens_of(plain(f"return {self.source.until(file, anchor, end)};")), scope, kind)
            self.define(name, kinds, kind, runner.run(), f"{file}: {anchor.strip()} ...")
        except Unknown as unknown:
            raise Unknown(f"{file}: {name} ({anchor.strip()}): {unknown}") from unknown


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
        Runner(tokens_of(w.source.body(CERTIFY, "explicit SimplexPoint(const Simplex<T>& s)")), scope).run()
    except Unknown as unknown:
        raise Unknown(f"{CERTIFY}: SimplexPoint: {unknown}") from unknown
    w.lines.append(
        "(* engine/narrow/certify.h: SimplexPoint *)\nDefinition simplex_point (size : nat) "
        f"{parameters(kinds)} : vec T :=\n  " + "\n  ".join(scope.lets) + f"\n  {scope.values['w'][1]}.\n"
    )


def write_frame(w: Writer) -> None:
    rotations, points = dict(R_wa=MATRIX, R_wb=MATRIX), dict(R_wa=MATRIX, t_a=VECTOR, t_b=VECTOR)
    w.expression(RUN, "const Mat3d R =", "; Vec3d D =", "frame_R", rotations, MATRIX)
    w.expression(RUN, "Vec3d D =", "; if constexpr", "frame_D", points, VECTOR)
    cso = dict(R=MATRIX, D=VECTOR, a=VECTOR, b=VECTOR)
    w.function(
        RUN, "CLEARANCE_HD Vec3<S> cso_vertex(const Vertex& a, const Vertex& b) const", "cso_vertex", cso, VECTOR
    )


def write_placed(w: Writer) -> None:
    """PlacedPair and certify_*(), which single pairs use."""
    vectors, scalars = dict(b=VECTOR, a=VECTOR), dict(a=SCALAR, b=SCALAR)
    w.function(
        CERTIFY_CPP, "Vec3<double> difference(const Vec3d& b, const Vec3d& a, double)", "difference", vectors, VECTOR
    )
    w.function(CERTIFY_CPP, "double sum(double a, double b, double)", "sum", scalars, SCALAR)
    rotations, points = dict(R_a=MATRIX, R_b=MATRIX), dict(R_a=MATRIX, t_a=VECTOR, t_b=VECTOR)
    w.expression(CERTIFY_CPP, ", R(", "), D(R_a", "placed_R", rotations, MATRIX)
    w.expression(CERTIFY_CPP, ", D(", "), points_a(part_a)", "placed_D", points, VECTOR)
    radii = dict(r_a=SCALAR, r_b=SCALAR)
    names = dict(r_a="part_a.radius", r_b="part_b.radius")
    w.expression(CERTIFY_CPP, "{ radius =", "; scale =", "placed_radius", radii, SCALAR, names)
    kinds = dict(D=VECTOR, rho_a=SCALAR, rho_b=SCALAR) | radii
    w.expression(
        CERTIFY_CPP,
        "; scale =",
        "; }",
        "placed_scale",
        kinds,
        SCALAR,
        names | dict(rho_a="part_a.rho", rho_b="part_b.rho"),
    )
    w.expression(
        CERTIFY_CPP,
        "if (is_round()) units += kRoundUnits; return",
        "; }",
        "placed_error",
        dict(units=SCALAR, scale=SCALAR),
        SCALAR,
    )
    w.function(
        CERTIFY,
        "Vec3<T> cso_vertex(std::uint32_t ia, std::uint32_t ib) const",
        "placed_cso_vertex",
        dict(R=MATRIX, D=VECTOR, a=VECTOR, b=VECTOR),
        VECTOR,
        {"a": "points_a.ia", "b": "points_b.ib"},
    )
    kinds = dict(gap=SCALAR, length=SCALAR, radius=SCALAR, error=SCALAR)
    w.expression(
        CERTIFY_CPP,
        "const double lower = round_down(",
        "); return std::isnan(lower)",
        "placed_lower",
        kinds,
        SCALAR,
        {"radius": "pair.radius"},
    )
    kinds = dict(w=VECTOR, radius=SCALAR, error=SCALAR)
    w.expression(
        CERTIFY_CPP,
        "const double upper = round_up(",
        "); return {std::isnan(upper)",
        "placed_upper",
        kinds,
        SCALAR,
        {"w": "point.w", "radius": "pair.radius"},
    )


def write_runs(w: Writer) -> None:
    gap = dict(D=VECTOR, v=VECTOR, value_a=SCALAR, value_b=SCALAR)
    w.expression(
        ATTEMPT,
        "return {vertex(a.index, b.index),",
        "};",
        "support_gap",
        gap,
        SCALAR,
        {"D": "pair_.D", "value_a": "a.value", "value_b": "b.value"},
    )
    w.expression(
        LANES,
        "g.step(vertex,",
        ", limits, running);",
        "lanes_gap",
        gap,
        SCALAR,
        {"D": "at.D", "v": "g.v", "value_a": "a.value", "value_b": "b.value"},
    )
    along = dict(R=MATRIX, v=VECTOR)
    w.expression(ATTEMPT, "pair_.points_a.farthest(", "); const SupportPoint", "along_a", along, VECTOR)
    w.expression(ATTEMPT, "pair_.points_b.farthest(", "); return", "along_b", along, VECTOR, {"R": "pair_.R"})
    direction = dict(D=VECTOR, n=VECTOR, value_a=SCALAR, value_b=SCALAR)
    w.expression(
        CERTIFY_CPP,
        "return certify_lower(pair,",
        ", norm(n));",
        "direction_gap",
        direction,
        SCALAR,
        {"D": "pair.D", "value_a": "sa.value", "value_b": "sb.value"},
    )
    w.expression(
        CERTIFY_CPP,
        "sb = support(*pair.b,",
        "); return",
        "direction_back",
        dict(R=MATRIX, n=VECTOR),
        VECTOR,
        {"R": "pair.R"},
    )
    # The product that a scan takes the largest of.
    text = w.source.until(SCAN, "const auto reach = [&](std::size_t i) { return", ";")
    text = re.sub(r"Real::load_unaligned\(v\.([xyz]) \+ i\)", r"vertex.\1", text)
    scope = w.scope(dict(n=VECTOR, vertex=VECTOR), {"n": "direction"})
    w.define("scan_product", dict(n=VECTOR, vertex=VECTOR), SCALAR, scalar(tokens_of(text), scope), f"{SCAN}: reach")

    write_run_bounds(w)


def write_run_bounds(w: Writer) -> None:
    """RunBounds: `low` and `high`, with the lengths and units that they name."""
    rest = dict(radius=SCALAR, scale=SCALAR, extra=SCALAR, round_units=SCALAR)
    lengths = {
        "v_length": w.source.until(CERTIFY, ": nearest(g.simplex), v_length(", "), length("),
        "length": w.source.until(CERTIFY, "v_length(norm(g.v)), length(", ") { const T zero(0)"),
    }
    units = "lower_units =" + w.source.until(CERTIFY, "const T lower_units =", "; const T low =")
    for name, kinds, names, length, line in (
        ("run_lower", dict(v=VECTOR, gap=SCALAR) | rest, {"v": "g.v", "gap": "g.gap"}, "v_length", "const T low ="),
        ("run_upper", dict(w=VECTOR) | rest, {"w": "nearest.w"}, "length", "const T high ="),
    ):
        scope = w.scope(kinds, names)
        scope.values[length] = (SCALAR, scalar(tokens_of(lengths[length]), scope))
        for unit in units.split(","):
            cpp, text = unit.split("=")
            scope.values[cpp.strip()] = (SCALAR, scalar(tokens_of(text), scope))
        term = scalar(tokens_of(w.source.until(CERTIFY, line, ";")), scope)
        w.define(name, kinds, SCALAR, term, f"{CERTIFY}: RunBounds")


def write(source: Source) -> str:
    for file, passage in PASSAGES:
        count = source.text(file).count(passage)
        if count != 1:
            raise Unknown(f"{file}: {count} times, not once: {passage}")
    w = Writer(source)
    for part in (write_vectors, write_terms, write_simplex_point, write_frame, write_runs, write_placed):
        part(w)
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
