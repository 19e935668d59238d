"""The passages of the C++ source that the proof is about: found by what stands before and after them."""

from __future__ import annotations

import re
from pathlib import Path

from cpp import Unknown

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
