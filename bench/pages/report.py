"""Tables, claims and picture of docs/notes/report.md: the 2023 report's experiments on each machine."""

import functools
import math
import re

from harness import RESULTS, read
from pages import all_of, markdown, plot

PICTURE = "pictures/report.png"

# Microseconds as the report prints them (AMD Ryzen 9 5900X, NVIDIA GeForce RTX 3060), by experiment and case.
REPORTED = {
    ("close_pairs", "1000 meshes; margin inf"): {"aabb_naive": 634560, "aabb_naive_omp": 281005, "aabb_tree": 3001880,
                                                 "aabb_tree_omp": 2053380},
    ("close_pairs", "2 meshes; margin inf"): {"aabb_naive": 8, "aabb_naive_omp": 21, "aabb_tree": 23,
                                              "aabb_tree_omp": 20},
    ("support", "2 large spheres"): {"gjk": 12717400, "gjk_hill": 2566810, "gjk_omp": 1248690,
                                     "cuda_support_seq": 235575, "cuda_support_par": 25758},
    ("terms", "2 large spheres"): {"cuda_terms_seq": 25118, "cuda_terms_par": 21985},
    ("pairs", "1000 spheres"): {"gjk": 34328600, "gjk_omp": 3575860, "cuda_pairwise": 1619300, "cuda_batched": 1028300},
    ("pairs", "5000 spheres"): {"cuda_pairwise": 54142600, "cuda_batched": 26261300},
}
# Speed-ups that the report gives without times.
IN_WORDS = {
    ("close_pairs", "1000 meshes; margin inf", "aabb_tree_noheuristic"): "about 0.25x",
    ("lite", "benchmark_lite", "naive"): "1x",
    ("lite", "benchmark_lite", "naive_omp"): "about 10x",
    ("lite", "benchmark_lite", "cuda_pairwise"): "13.5x over `gjk`",
}
LABELS = {
    "clearance_1": "Clearance, one thread",
    "clearance": "Clearance, all cores",
    "clearance_cuda": "Clearance on the GPU",
    "clearance_brute": "Clearance, all pairs of boxes, one thread",
    "clearance_tree": "Clearance, tree, one thread",
    "clearance_tree_kept": "Clearance, tree that follows, one thread",
    "clearance_nearest": "Clearance, nearest neighbours",
    "coal": "Coal, one thread",
}


class Results:
    """The rows of one machine."""

    def __init__(self, path):
        remark, self.rows = read(path)
        self.machine, *load, self.command = remark.split("; ")
        self.load = "".join(f", {x}" for x in load)
        self.gpu = self.machine.split(", ")[1] if ", " in self.machine else None
        self.path = path

    @property
    def short(self):
        """The column's head."""
        cpu = re.sub(r"\((R|TM)\)|CPU|Processor|@.*GHz", "", self.machine.split(", ")[0])
        cpu = " ".join(cpu.split())
        return f"{cpu} and {self.gpu}" if self.gpu else cpu

    def case(self, experiment, name):
        return [r for r in self.rows if (r["experiment"], r["case"]) == (experiment, name)]

    def row(self, experiment, name, method):
        return next((r for r in self.case(experiment, name) if r["method"] == method), None)

    def us(self, experiment, name, method, key="wall_us"):
        r = self.row(experiment, name, method)
        return float(r[key]) if r else math.nan


@functools.cache
def machines():
    return [Results(path) for path in (RESULTS / "report.csv", *sorted(RESULTS.glob("report_*.csv")))]


LARGE = "2 large spheres"


def depth(x, method):
    return int(x.row("tree_profile", "build", method)["note"].split("; ")[0].split()[1])


def time_of(us):
    if math.isnan(us):
        return ""
    for limit, unit, scale in ((1e3, "us", 1), (1e6, "ms", 1e3), (math.inf, "s", 1e6)):
        if us < limit:
            value = us / scale
            return f"{value:,.0f} {unit}" if value >= 100 else f"{value:.3g} {unit}"


def ratio_of(value):
    return "" if math.isnan(value) else f"{value:,.0f}x" if value >= 100 else f"{value:.3g}x"


def label(method):
    return LABELS.get(method, f"`{method}`")


def comparison(results, experiment, name, base, methods=None):
    """One row for each method; each column has times and speed-ups over `base` (or over the report's first)."""
    reported = REPORTED.get((experiment, name), {})
    methods = methods or list(dict.fromkeys(r["method"] for x in results for r in x.case(experiment, name)))
    rows = []
    for method in methods:
        cells = [label(method)]
        first = reported.get(base) or next(iter(reported.values()), math.nan)
        us = reported.get(method, math.nan)
        words = IN_WORDS.get((experiment, name, method), "")
        cells.append(words if math.isnan(us) else f"{time_of(us)} ({ratio_of(first / us)})")
        for x in results:
            r = x.row(experiment, name, method)
            us = x.us(experiment, name, method)
            if r is None:
                cells.append("")
            elif math.isnan(us):
                cells.append(r["note"].replace("refused", "rejected"))
            else:
                scaled = "" if r["measured"] == r["pairs"] else " \\*"
                start = x.us(experiment, name, base)
                cells.append(f"{time_of(us)}{scaled}" + ("" if math.isnan(start) else f" ({ratio_of(start / us)})"))
        rows.append(cells)
    return markdown(["system", "the report", *(x.short for x in results)], rows)


def tree_table(results):
    x = results[0]
    rows = []
    for r in x.case("tree_profile", "build"):
        method = r["method"]
        depth, visited, costs = (int(part.split()[i]) for part, i in zip(r["note"].split("; "), (1, 0, 0)))
        rows.append(
            [
                f"{method}",
                f"{visited / 1000:,.0f}",
                f"{costs / 1000:,.0f}",
                str(depth),
                time_of(float(r["wall_us"])),
                time_of(x.us("tree_profile", "query margin 0", method)),
                time_of(x.us("tree_profile", "query margin inf", method)),
            ]
        )
    return markdown(
        [
            "insertion",
            "nodes visited by one",
            "costs compared by one",
            "depth",
            "building",
            "queries, margin 0",
            "queries, margin inf",
        ],
        rows,
    )


def sphere_table(results):
    """Time of every size, one column for each method and machine."""
    counts = list(dict.fromkeys(r["case"] for x in results for r in x.rows if r["experiment"] == "spheres"))
    parts = []
    for x in results:
        methods = [
            m
            for m in (
                "naive",
                "gjk",
                "gjk_omp",
                "cuda_batched",
                "coal",
                "clearance",
                "clearance_cuda",
                "clearance_nearest",
            )
            if any(x.row("spheres", c, m) for c in counts)
        ]
        rows = []
        for count in counts:
            row = [f"{int(count):,}"]
            for method in methods:
                r = x.row("spheres", count, method)
                row.append(
                    "" if r is None else time_of(float(r["wall_us"])) + ("" if r["measured"] == r["pairs"] else " \\*")
                )
            naive, gjk = x.us("spheres", count, "naive"), x.us("spheres", count, "gjk")
            parallel = x.us("spheres", count, "cuda_batched" if x.gpu else "gjk_omp")
            row += [ratio_of(naive / parallel), ratio_of(gjk / parallel)]
            rows.append(row)
        parallel = "`cuda_batched`" if x.gpu else "`gjk_omp`"
        parts.append(f"{x.short}:\n\n" + markdown(["spheres", *(label(m) for m in methods), f"{parallel} over `naive`",
                                                    f"{parallel} over `gjk`"], rows))
    return "\n\n".join(parts)


def transfer_table(results):
    x = next((x for x in results if x.gpu), None)
    if x is None:
        return "Measured without a GPU."
    rows = [["the report: all copies, no kernel", "", time_of(58133)]]
    for r in x.case("transfers", "1000 spheres"):
        name = {
            "cuda_batched": "`cuda_batched`: vertices and pairs there, kernel, answers back",
            "clearance_cuda": "Clearance, geometry and poses resident: the whole query",
        }.get(r["method"], r["method"])
        rows.append([name, r["note"].split()[0] if r["note"].endswith("bytes") else "", time_of(float(r["wall_us"]))])
    return markdown(["transfer", "bytes", "time"], rows)


def block_table(results):
    x = next((x for x in results if x.gpu), None)
    if x is None:
        return "Measured without a GPU."
    rows = x.case("block_size", "1000 spheres")
    return markdown(["threads of a block", *(r["note"].split()[1] for r in rows)],
                    [["kernel", *(time_of(float(r["kernel_us"])) for r in rows)]])


def terms_table(results):
    rows = []
    for name in ("2 large spheres", "1000 spheres"):
        for method in ("cuda_terms_seq", "cuda_terms_par"):
            reported = REPORTED.get(("terms", name), {}).get(method, math.nan)
            row = [name, f"`{method}`", "" if math.isnan(reported) else
                   f"{time_of(reported)} ({ratio_of(REPORTED['terms', name]['cuda_terms_seq'] / reported)})"]
            for x in results:
                if x.gpu:
                    us = x.us("terms", name, method, "kernel_us")
                    row.append(f"{time_of(us)} ({ratio_of(x.us('terms', name, 'cuda_terms_seq', 'kernel_us') / us)})")
            rows.append(row)
    return markdown(["case", "system", "the report", *(f"{x.short}, kernels" for x in results if x.gpu)], rows, words=2)


def machine_list(results):
    return "\n".join(
        f"- {x.machine}{x.load}, by `{x.command}`: [results/{x.path.name}](../results/{x.path.name})" for x in results
    )


def close_tables(results):
    titles = {"inf": "1000 meshes, margin infinite", "1": "margin 1 m", "0": "margin 0"}
    return "\n\n".join(
        f"{title}:\n\n" + comparison(results, "close_pairs", f"1000 meshes; margin {margin}", "aabb_naive", CLOSE_PAIRS)
        for margin, title in titles.items()
    )


CLOSE_PAIRS = ["aabb_naive", "aabb_naive_omp", "aabb_tree", "aabb_tree_noheuristic", "aabb_tree_omp",
               "clearance_brute", "clearance_tree", "clearance_tree_kept"]  # fmt: skip
MAKERS = {
    "machines": machine_list,
    "close 1000": close_tables,
    "close 2": lambda x: comparison(x, "close_pairs", "2 meshes; margin inf", "aabb_naive", CLOSE_PAIRS),
    "tree": tree_table,
    "support": lambda x: comparison(x, "support", "2 large spheres", "gjk"),
    "terms": terms_table,
    "pairs 1000": lambda x: comparison(x, "pairs", "1000 spheres", "gjk"),
    "pairs 5000": lambda x: comparison(x, "pairs", "5000 spheres", "gjk"),
    "blocks": block_table,
    "lite": lambda x: comparison(x, "lite", "benchmark_lite", "naive"),
    "spheres": sphere_table,
    "transfers": transfer_table,
}
TABLES = {name: lambda make=make: make(machines()) for name, make in MAKERS.items()}


# Claims of the page, as conditions on the results.
# Each takes the results of all machines; where a GPU or many cores matter, those of machines that have them.
CLOSE = [f"1000 meshes; margin {m}" for m in ("0", "1", "inf")]
CLAIMS = {
    "tree loses": lambda all, gpu: all_of(
        x.us("close_pairs", c, "aabb_tree") > 3 * x.us("close_pairs", c, "aabb_naive") for x in all for c in CLOSE
    ),
    "pairs in parallel win": lambda all, gpu: all_of(
        x.us("close_pairs", c, "aabb_naive_omp")
        == min(
            x.us("close_pairs", c, m)
            for m in ("aabb_naive", "aabb_naive_omp", "aabb_tree", "aabb_tree_omp", "aabb_tree_noheuristic")
        )
        for x in gpu
        for c in CLOSE
    ),
    "heuristic makes a list": lambda all, gpu: all_of(
        depth(x, "heuristic as printed") > 0.8 * depth(x, "without it") for x in all
    ),
    "one line wins": lambda all, gpu: all_of(
        x.us("tree_profile", "build", "price of the new parent")
        + x.us("tree_profile", "query margin 0", "price of the new parent")
        < 0.5 * x.us("close_pairs", CLOSE[0], "aabb_naive")
        for x in all
    ),
    "our tree wins": lambda all, gpu: all_of(
        x.us("close_pairs", c, m) < 0.2 * x.us("close_pairs", c, "aabb_naive")
        for x in all
        for c in CLOSE[:2]
        for m in ("clearance_tree", "clearance_tree_kept")
    ),
    "climbing wins": lambda all, gpu: all_of(
        x.us("support", LARGE, "gjk_hill")
        < 0.005 * min(x.us("support", LARGE, "gjk"), x.us("support", LARGE, "cuda_support_par"))
        for x in gpu
    ),
    "one block one multiprocessor": lambda all, gpu: all_of(
        0.5
        < x.us("support", LARGE, "cuda_support_par", "kernel_us") / REPORTED["support", LARGE]["cuda_support_par"]
        < 2
        for x in gpu
    ),
    "terms do not matter": lambda all, gpu: all_of(
        abs(x.us("terms", c, "cuda_terms_par", "kernel_us") / x.us("terms", c, "cuda_terms_seq", "kernel_us") - 1) < 0.1
        for x in gpu
        for c in (LARGE, "1000 spheres")
    ),
    "batching wins": lambda all, gpu: all_of(
        200 < x.us("pairs", c, "cuda_pairwise") / x.us("pairs", c, "cuda_batched") < 1500
        for x in gpu
        for c in ("1000 spheres", "5000 spheres")
    ),
    "launches lose": lambda all, gpu: all_of(
        x.us("pairs", c, "gjk") < x.us("pairs", c, "cuda_pairwise")
        for x in gpu
        for c in ("1000 spheres", "5000 spheres")
    ),
    "a warp is best": lambda all, gpu: all_of(
        min(x.case("block_size", "1000 spheres"), key=lambda r: float(r["kernel_us"]))["note"]
        in ("block 16", "block 26", "block 32")
        for x in gpu
    ),
    "a thread for each pair": lambda all, gpu: all_of(
        x.us("pairs", "1000 spheres", "clearance_cuda", "kernel_us")
        < 0.35 * min(float(r["kernel_us"]) for r in x.case("block_size", "1000 spheres"))
        for x in gpu
    ),
    "one pair belongs on the CPU": lambda all, gpu: all_of(
        x.us("lite", "benchmark_lite", "gjk") < x.us("lite", "benchmark_lite", "cuda_batched", "kernel_us") for x in gpu
    ),
    "speed-up stays": lambda all, gpu: (
        all_of(
            20 < x.us("spheres", n, "gjk") / x.us("spheres", n, "cuda_batched") < 80
            for x in gpu
            for n in ("100", "200", "1000", "5000")
        )
        and all_of(x.us("spheres", "10", "gjk") < 2 * x.us("spheres", "10", "cuda_batched") for x in gpu)
    ),
    "nearest is cheap": lambda all, gpu: all_of(
        x.us("spheres", n, "clearance_nearest") < 0.15 * x.us("spheres", n, "clearance")
        for x in all
        for n in ("5000", "20000")
    ),
    "mesh by mesh": lambda all, gpu: all_of(
        x.us("transfers", "1000 spheres", "vertices mesh by mesh")
        > 50 * x.us("transfers", "1000 spheres", "vertices in one array")
        for x in gpu
    ),
}


def claims():
    results = machines()
    gpu = [x for x in results if x.gpu]
    return {name: holds(results, gpu) for name, holds in CLAIMS.items()}


def draw(path):
    from matplotlib.lines import Line2D

    plt, results = plot(), machines()
    figure, axes = plt.subplots(4, 2, figsize=(15, 22), layout="constrained")
    panels = [
        ("close_pairs", "1000 meshes; margin inf", "Close pairs of 1000 meshes, margin infinite"),
        ("close_pairs", "1000 meshes; margin 0", "The same, margin 0"),
        ("support", LARGE, "One pair of 1,998,002 vertices each (Coal rejects it)"),
        ("lite", "benchmark_lite", "One pair of 2400 faces (the report's figure 4)"),
        ("pairs", "1000 spheres", "All pairs of 1000 spheres"),
        ("pairs", "5000 spheres", "All pairs of 5000 spheres"),
    ]
    colours = ["black", "C0", "C1", "C2", "C3"]
    for axis, (experiment, name, title) in zip(axes.flat, panels):
        reported = REPORTED.get((experiment, name), {})
        found = list(dict.fromkeys(r["method"] for x in results for r in x.case(experiment, name)))
        methods = [m for m in found if not m.startswith(("clearance", "coal"))] + [
            m for m in found if m.startswith(("coal", "clearance"))
        ]
        sides = [("the report", reported.get, "gray")] * bool(reported) + [
            (x.short, functools.partial(x.us, experiment, name), colour) for x, colour in zip(results, colours[1:])]
        for k, (who, us, colour) in enumerate(sides):
            values = [us(m) or math.nan for m in methods]
            axis.barh(
                [i + (k - (len(sides) - 1) / 2) * 0.26 for i in range(len(methods))],
                values,
                0.26,
                label=who,
                color=colour,
            )
        axis.set_yticks(range(len(methods)), [label(m).strip("`") for m in methods])
        axis.invert_yaxis()
        axis.set(xscale="log", title=title, xlabel="us")
        axis.grid(axis="x", alpha=0.3)
        axis.legend(fontsize=8)
    styles = ["-", "--", ":"]
    methods = ["naive", "gjk", "gjk_omp", "cuda_batched", "coal", "clearance", "clearance_cuda", "clearance_nearest"]
    times, gains = axes.flat[6], axes.flat[7]
    for x, style in zip(reversed(results), styles):
        for k, method in enumerate(methods):
            rows = [r for r in x.rows if (r["experiment"], r["method"]) == ("spheres", method)]
            counts = [int(r["case"]) for r in rows]
            times.plot(counts, [float(r["wall_us"]) for r in rows], style, marker="o", ms=3, color=f"C{k}")
            if method not in ("naive", "gjk"):
                gains.plot(
                    counts,
                    [x.us("spheres", r["case"], "gjk") / float(r["wall_us"]) for r in rows],
                    style,
                    marker="o",
                    ms=3,
                    color=f"C{k}",
                )
    handles = [Line2D([], [], color=f"C{k}", label=label(m).strip("`")) for k, m in enumerate(methods)]
    handles += [Line2D([], [], color="black", ls=style, label=x.short) for x, style in zip(reversed(results), styles)]
    for axis, title, unit in ((times, "Random spheres, all pairs (the report's figure 5, and on)", "us"),
                              (gains, "Their speed-up over gjk on the same machine", "")):
        axis.set(xscale="log", yscale="log", title=title, xlabel="spheres", ylabel=unit)
        axis.grid(alpha=0.3)
    gains.legend(handles=handles, fontsize=8)
    figure.savefig(path, dpi=60)
