"""Tables, claims and picture of docs/tradeoff.md: cost of each setting of a query."""

import math
import statistics

from pages import markdown, plot, results

PICTURE = "tradeoff.png"
INF = math.inf


class Sweep:
    """The rows of one backend by scene and setting."""

    def __init__(self, rows, backend):
        self.rows = [r for r in rows if r["backend"] == backend]
        self.backend = backend
        self.scenes = list(dict.fromkeys(r["scene"] for r in self.rows))
        self.by_setting = {(r["scene"], r["precision"], r["asked"], float(r["reach"]), float(r["rel_tol"]),
                            float(r["abs_tol"])): r for r in self.rows}

    def at(self, scene, rel_tol=1e-6, abs_tol=0.0, reach=INF, precision="f64", requested="steps"):
        """The row of a setting; by default that of the default query."""
        return self.by_setting[scene, precision, requested, reach, 0.0 if abs_tol else rel_tol, abs_tol]

    def ratios(self, scenes=None, **setting):
        """Time relative to the default query, for each scene."""
        return [float(self.at(s, **setting)["ratio"]) for s in scenes or self.scenes]


def time_table(s):
    columns = [
        ("`rel_tol` 1e-1", dict(rel_tol=1e-1)),
        ("1e-2", dict(rel_tol=1e-2)),
        ("1e-4", dict(rel_tol=1e-4)),
        ("1e-8", dict(rel_tol=1e-8)),
        ("1e-12", dict(rel_tol=1e-12)),
        ("`abs_tol` 1 mm", dict(abs_tol=1e-3)),
        ("1 µm", dict(abs_tol=1e-6)),
        ("f32 at 1e-4", dict(rel_tol=1e-4, precision="f32")),
        ("batch", dict(requested="batch")),
        ("batch, f32 at 1e-4", dict(requested="batch", rel_tol=1e-4, precision="f32")),
        ("`max_distance` median", dict(reach=1.0)),
        ("a tenth of it", dict(reach=0.1)),
    ]
    rows = []
    for scene in s.scenes:
        default = s.at(scene)
        rows.append([f"`{scene}`", default["pairs"], f"{float(default['ns_per_pair']):.0f}",
                     *(f"{float(s.at(scene, **setting)['ratio']):.2f}" for _, setting in columns)])
    return markdown(["scene", "pairs", "default [ns a pair]", *(name for name, _ in columns)], rows)


def accuracy_table(s):
    def cell(row, what):
        return f"{float(row[what]):.1g}"

    rows = []
    for scene in s.scenes:
        loose, usual, tight = (s.at(scene, rel_tol=t) for t in (1e-2, 1e-6, 1e-12))
        rows.append(
            [
                f"`{scene}`",
                *(f"{cell(r, 'rel_error_p99')} / {cell(r, 'rel_width_p99')}" for r in (loose, usual, tight)),
                cell(usual, "error_max"),
                cell(usual, "width_max"),
                f"{100 * float(usual['overlap']):.3g} %",
                f"{100 * float(usual['contact']):.2g} %",
                f"{100 * max(float(s.at(scene, rel_tol=t)['unconverged']) for t in (1e-2, 1e-6)):.2g} %",
                f"{100 * float(tight['unconverged']):.2g} %",
            ]
        )
    return markdown(
        [
            "scene",
            "error / width at 1e-2",
            "at 1e-6",
            "at 1e-12",
            "largest error at 1e-6 [m]",
            "largest width [m]",
            "overlap",
            "contact",
            "wider than requested at 1e-2 and 1e-6",
            "at 1e-12",
        ],
        rows,
    )


def span(values):
    return f"{min(values):.2f} to {max(values):.2f} (median {statistics.median(values):.2f})"


def unused(s, **setting):
    """Whether a setting gives the same answers as the query without it."""
    columns = [c for c in s.rows[0] if c.split("_")[0] in ("error", "width", "rel")]
    plain = {k: v for k, v in setting.items() if k not in ("precision", "asked")}
    return all(
        s.at(scene, **setting)[c] == s.at(scene, **plain)[c] for scene in s.scenes for c in columns if c != "rel_tol"
    )


def sentences(s):
    """Sentences with numbers from the results, true of any results."""
    others = [x for x in s.scenes if x != "touching"]
    answers = sum(int(r["pairs"]) * int(r["steps"]) for r in s.rows)
    wrong = sum(int(r["violations"]) for r in s.rows)

    def f32(requested):
        return [
            a / b
            for a, b in zip(s.ratios(rel_tol=1e-4, precision="f32", requested=requested),
                s.ratios(rel_tol=1e-4, requested=requested))
        ]

    lines = [
        f"Of {answers:,} answers, in {len(s.rows):,} settings, {wrong} intervals miss the exact distance.",
        f"**Tolerance.** Time over that of the default (1e-6): at 1e-1 {span(s.ratios(others, rel_tol=1e-1))}, at 1e-2 "
        f"{span(s.ratios(others, rel_tol=1e-2))}, at 1e-12 {span(s.ratios(others, rel_tol=1e-12))}; of touching pairs "
        f"{s.ratios(['touching'], rel_tol=1e-1)[0]:.2f}, {s.ratios(['touching'], rel_tol=1e-2)[0]:.2f} and "
        f"{s.ratios(['touching'], rel_tol=1e-12)[0]:.2f}, or {s.ratios(['touching'], abs_tol=1e-6)[0]:.2f} with "
        "`abs_tol` 1e-6 m "
        "in place of `rel_tol`.",
        f"**max_distance.** At the median distance {span(s.ratios(reach=1.0))}, at a tenth of it "
        f"{span(s.ratios(reach=0.1))}.",
        f"**float32 iterations.** Time over that of float64 at the same tolerance (1e-4): {span(f32('steps'))}; in "
        f"batches {span(f32('batch'))}."
        + (
            " The answers are the same to the last digit: this backend always iterates in float64."
            if unused(s, precision="f32", rel_tol=1e-4)
            else ""
        ),
        f"**Batches.** All steps as the configurations of one query, over one query for each step: "
        f"{span(s.ratios(requested='batch'))}.",
    ]
    return "\n".join(f"- {line}" for line in lines)


def settings():
    """All settings of every backend."""
    remark, rows = results("tradeoff")
    parts = [f"From `docs/results/tradeoff.csv` ({remark}), by `make bench SUITE=tradeoff`."]
    for backend in dict.fromkeys(r["backend"] for r in rows):
        s = Sweep(rows, backend)
        parts += [
            f"### Backend `{backend}`",
            sentences(s),
            "Time over that of the default query (float64, `rel_tol` 1e-6, no `max_distance`, one query per "
            "step); each column changes one setting.\n`max_distance` is the median of all distances, and a tenth of "
            "it.",
            time_table(s),
            "Error and certified width over the exact distance, 99th percentile of the separate pairs, by `rel_tol`.",
            accuracy_table(s),
        ]
    return "\n\n".join(parts)


def no_more_than(values, limit):
    return all(v <= limit for v in values)


# Claims of the page about the CPU, as conditions on the results.
CLAIMS = {
    "contained": lambda s: all(r["violations"] == "0" for r in s.rows),
    # Loosening from 1e-6 to 1e-2 saves less than two fifths if bodies do not touch.
    "loose saves little": lambda s: all(
        r >= 0.6 for x in s.scenes if x != "touching" for r in s.ratios([x], rel_tol=1e-2)
    ),
    # Two more digits than the default cost less than a tenth.
    "tight is cheap": lambda s: no_more_than(s.ratios(rel_tol=1e-8), 1.1),
    # A tolerance of 1e-2 is never slower than 1e-6, up to timing noise.
    "looser is no slower": lambda s: no_more_than(s.ratios(rel_tol=1e-2) + s.ratios(rel_tol=1e-1), 1.1),
    # Where the curve is flat, the answer is already exact at 1e-4.
    "exact already": lambda s: all(
        float(s.at(x, rel_tol=1e-4)["rel_width_p99"]) < 1e-9 for x in ("near", "boxes", "spheres", "capsules")
    ),
    # max_distance at a tenth of the median at least halves the time, except in scenes whose boxes all overlap.
    "max_distance is the lever": lambda s: no_more_than(
        s.ratios([x for x in s.scenes if float(s.at(x, reach=0.1)["evaluated"]) < 0.4], reach=0.1), 0.5
    ),
    "boxes that overlap": lambda s: all(
        float(s.at(x, reach=0.1)["evaluated"]) > 0.9 and s.ratios([x], reach=0.1)[0] > 0.5 for x in ("near", "touching")
    ),
    # Touching pairs: an absolute tolerance of a micrometre is at least three times as fast.
    "abs_tol for touching": lambda s: no_more_than(s.ratios(["touching"], abs_tol=1e-6), 1 / 3),
    # Spheres and capsules take less than half of the time of hulls, small or fine.
    "cheap forms": lambda s: all(
        float(s.at(x)["ns_per_pair"]) < 0.5 * min(float(s.at(y)["ns_per_pair"]) for y in ("near", "fine"))
        for x in ("spheres", "capsules")
    ),
    "batches": lambda s: no_more_than(
        s.ratios(["near", "boxes", "spheres", "capsules", "dense", "fine", "extremes"], requested="batch"), 0.75
    ),
    "heavy batches": lambda s: s.ratios(["cell"], requested="batch")[0] < 0.75,
    "f32 takes as long": lambda s: all(
        5 / 6 < single / double < 7 / 6
        for single, double in zip(s.ratios(rel_tol=1e-4, precision="f32"), s.ratios(rel_tol=1e-4))
    ),
    # An absolute tolerance below rounding only costs time.
    "abs_tol below rounding": lambda s: s.ratios(["extremes"], abs_tol=1e-6)[0] > 1.5,
    "none wider than asked": lambda s: all(
        float(s.at(x, rel_tol=t)["unconverged"]) == 0 for x in s.scenes for t in (1e-1, 1e-2, 1e-4, 1e-6)
    ),
}


def claims():
    sweep = Sweep(results("tradeoff")[1], "cpu")
    return {name: holds(sweep) for name, holds in CLAIMS.items()}


def draw(path):
    _, rows = results("tradeoff")
    plt = plot()
    backends = list(dict.fromkeys(r["backend"] for r in rows))
    sweeps = [Sweep(rows, b) for b in backends]
    scenes = sweeps[0].scenes
    columns = 5
    figure, axes = plt.subplots(
        math.ceil(len(scenes) / columns), columns, figsize=(17, 3.6 * math.ceil(len(scenes) / columns))
    )
    for axis, scene in zip(axes.flat, scenes):
        for k, s in enumerate(sweeps):
            for colour, (precision, requested) in enumerate(
                (("f64", "steps"), ("f32", "steps"), ("f64", "batch"), ("f32", "batch"))
            ):
                mine = sorted(
                    (
                        r
                        for r in s.rows
                        if (r["scene"], r["precision"], r["asked"]) == (scene, precision, requested)
                        and float(r["reach"]) == INF
                        and float(r["rel_tol"]) > 0
                    ),
                    key=lambda r: -float(r["rel_tol"]),
                )
                x = [float(r["ns_per_pair"]) for r in mine]
                label = f"{s.backend} {precision}{'' if requested == 'steps' else ' ' + requested}"
                axis.plot(
                    x,
                    [max(1e-16, float(r["rel_width_p99"])) for r in mine],
                    "o-" if k == 0 else "s--",
                    color=f"C{colour}",
                    ms=4,
                    lw=1,
                    label=label + ", width",
                )
                if requested == "steps":
                    axis.plot(x, [max(1e-16, float(r["rel_error_p99"])) for r in mine], ":", color=f"C{colour}", lw=1,
                              label=label + ", error")
            for reach, mark in ((1.0, "^"), (0.1, "v")):
                r = s.at(scene, reach=reach)
                axis.plot([float(r["ns_per_pair"])], [max(1e-16, float(r["rel_width_p99"]))], mark, color="black", ms=6,
                          label=f"{s.backend} f64, max_distance at {reach:g} median")
        axis.set(yscale="log", xscale="log", title=scene, ylim=(5e-17, 1))
        axis.xaxis.set_major_formatter(lambda v, _: f"{v:g}")
        axis.xaxis.set_minor_formatter(lambda v, _: f"{v:g}" if f"{v:g}"[0] in "235" else "")
        axis.tick_params(axis="x", which="both", labelsize=7)
        axis.grid(alpha=0.3)
    for axis in axes.flat[len(scenes):]:
        axis.set_visible(False)
    for axis in axes[-1]:
        axis.set_xlabel("ns a pair")
    for row in axes:
        row[0].set_ylabel("over the exact distance, 99 %")
    handles, labels = axes.flat[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=4, fontsize=9, frameon=False)
    figure.suptitle("Certified width and error against time, rel_tol from 1e-1 (top) to 1e-12 (bottom)")
    figure.tight_layout(rect=(0, 0.09, 1, 0.98))
    figure.savefig(path, dpi=80)


def shapes_table():
    """Results of bench/robots/bench_shapes.py."""
    _, rows = results("shapes")
    header = ["robot, `mesh_as`", "triangles", "valid [us a state]", "least distance [us]", "short by, median [mm]",
              "most [mm]", "free states rejected", "missed overlaps"]
    return markdown(header, [
        [f"{r['robot']}, `{r['mesh_as']}`", r["triangles"], f"{float(r['valid_us']):.4g}",
         f"{float(r['least_us']):.4g}", r["short_mm"], r["short_most_mm"],
         f"{r['false_refusals']} of {r['free']}", r["missed"]]
        for r in rows
    ])


TABLES = {"tradeoff": settings, "shapes": shapes_table}
