#!/usr/bin/env python3
"""What accuracy costs: time of least distances against tolerance, and of decisions against margin.

    bench/run.py tradeoff [--robots panda ur5] [--problems 2] [--states 200] [--rounds 5] [--results FOLDER]

Robots move among the obstacles of MotionBenchMaker's problems, as hulls and as true meshes, also against a cloud, along
edges, and with the pairs of their own links; free bodies move anywhere. Each least distance is requested to each
tolerance, each decision with each margin, without covers (the exact engine alone) and with them, by turns: processor
time of one thread, a batch a call. Ratios are medians over the rounds of two times of the same round. `over_off`: time
without covers over that with them; `over_exact`: time of the exact distance without covers over this one.
Least distances are those of states that are apart, decisions those of all.

Every interval is compared with the exact one, and every decision. `wrong` counts contradictions, `wider` intervals that
are wider than requested without a flag: exit code 1 unless both are 0. tradeoff_models.csv has the error of
hulls in place of meshes, tradeoff_extremes.csv numerical extremes.
"""

import statistics
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np

import extremes
import problems
from clearance import Flag, Status
from harness import shown, stamped, timed, write
from workloads import COVERS, MODELS, ROBOTS, unseen, workloads

EXACT = "exact"
TOLERANCES = {
    EXACT: {"rel_tol": 1e-12, "abs_tol": 0.0},
    **{f"{t:g}": {"rel_tol": 0.0, "abs_tol": t} for t in (1e-6, 1e-4, 1e-3, 1e-2, 5e-2, 1e-1)},
    "10%": {"rel_tol": 0.1, "abs_tol": 0.0},
}
MARGINS = (0.0, 0.005, 0.02, 0.1)


class Sums:
    """Times and counts of one setting over all batches."""

    def __init__(self, rounds):
        self.seconds = {covers: [0.0] * rounds for covers in COVERS}
        self.items = self.free = self.hit = self.wrong = self.wider = 0
        self.unresolved, self.widths = dict.fromkeys(COVERS, 0), []

    def ratios(self, other, covers="background"):
        return [a / b for a, b in zip(other, self.seconds[covers])]


class Measurement:
    """One workload: every question and setting."""

    def __init__(self, workload, options):
        self.workload, self.options = workload, options
        self.sums = defaultdict(lambda: Sums(options.rounds))  # by (question, setting)
        self.exact = {}  # lower and upper bounds of all states, by batch
        self.unseen = []

    def run(self):
        for batch in self.workload.batches(self.options):
            answer = batch.least("off", **TOLERANCES[EXACT])(*batch.inputs)
            lower, upper = answer.lower.ravel(), answer.upper.ravel()
            self.exact[batch.key] = lower, upper
            is_apart = lower > 0
            apart = tuple(rows[is_apart] for rows in batch.inputs)
            queries = {}
            for setting, tolerance in TOLERANCES.items():
                queries["least", setting] = {c: batch.least(c, **tolerance) for c in COVERS}, apart
                self.check_least(setting, batch, apart, lower[is_apart], upper[is_apart], tolerance)
            for margin in MARGINS:
                runs = {covers: batch.decision(covers, margin) for covers in COVERS}
                queries["decision", f"{margin:g}"] = runs, batch.inputs
                self.check_decision(margin, runs, batch.inputs, lower, upper)
            if self.workload.is_motion:
                runs = {covers: batch.sampled(covers, 0.0) for covers in COVERS}
                queries["sampled", "0"] = runs, batch.inputs
                self.check_sampled(runs, batch.inputs, upper)
                self.unseen.append(unseen(batch))
            self.time(queries)

    def time(self, queries):
        for turn in range(self.options.rounds):
            for key, (runs, inputs) in queries.items():
                for covers in COVERS if turn % 2 else reversed(COVERS):
                    seconds, _ = timed(runs[covers], *inputs)
                    self.sums[key].seconds[covers][turn] += seconds

    def check_least(self, setting, batch, inputs, lower, upper, tolerance):
        sums = self.sums["least", setting]
        sums.items += len(lower)
        for covers in COVERS:
            answer = batch.least(covers, **tolerance)(*inputs)
            low, high = answer.lower.ravel(), answer.upper.ravel()
            width, is_open = high - low, answer.status.ravel() == Status.UNCONVERGED
            requested = np.maximum(tolerance["abs_tol"], tolerance["rel_tol"] * high)
            sums.wrong += int(((low > upper) | (high < lower)).sum())
            is_wider = ~is_open & (width > requested * (1 + 1e-9) + 1e-12)
            if is_wider.any():
                flags = batch.least(covers, fields="flags", **tolerance)(*inputs).flags.ravel()
                is_wider &= (flags & Flag.UNCERTAINTY_LIMITED) == 0
            sums.wider += int(is_wider.sum())
            sums.unresolved[covers] += int(is_open.sum())
            if covers != "off":
                sums.widths += list(width)

    def check_decision(self, margin, runs, inputs, lower, upper):
        sums = self.sums["decision", f"{margin:g}"]
        sums.items += len(lower)
        for covers, run in runs.items():
            verdict = run(*inputs).verdict.ravel()
            free, hit = verdict == Status.BEYOND, verdict == Status.OK
            sums.wrong += int((free & (upper <= margin)).sum() + (hit & (lower > margin)).sum())
            sums.unresolved[covers] += int((~free & ~hit).sum())
            if covers != "off":
                sums.free, sums.hit = sums.free + int(free.sum()), sums.hit + int(hit.sum())

    def check_sampled(self, runs, inputs, upper):
        """`wrong` are edges with free samples on which bodies meet."""
        sums = self.sums["sampled", "0"]
        free = runs["background"](*inputs)
        sums.items += len(free)
        sums.free += int(free.sum())
        sums.wrong += int((free & (upper <= 0)).sum())

    def rows(self):
        exact = self.sums["least", EXACT].seconds["off"]
        exact_items = self.sums["least", EXACT].items
        for (question, setting), sums in self.sums.items():
            us = {c: statistics.median(sums.seconds[c]) / sums.items * 1e6 for c in COVERS}
            scale = sums.items / exact_items
            yield {
                "workload": self.workload.name,
                "question": question,
                "setting": setting,
                "items": sums.items,
                "us_off": f"{us['off']:.3g}",
                "us": f"{us['background']:.3g}",
                "over_off": f"{statistics.median(sums.ratios(sums.seconds['off'])):.3g}",
                "over_exact": f"{scale * statistics.median(sums.ratios(exact)):.3g}",
                "width_mm": f"{1e3 * np.quantile(sums.widths, 0.99):.3g}" if sums.widths else
                            f"{1e3 * statistics.median(self.unseen):.3g}" if question == "sampled" else "",
                "unresolved_off": sums.unresolved["off"],
                "unresolved": sums.unresolved["background"],
                "free": sums.free if question != "least" else "",
                "hit": sums.hit if question == "decision" else "",
                "wrong": sums.wrong,
                "wider": sums.wider,
            }  # fmt: skip


def model_row(name, hulls, meshes):
    """How much nearer a robot's hulls are than its meshes, and which of the free states the hulls do not prove free."""
    short, rejected, free = [], 0, 0
    for key, (lower, _) in meshes.exact.items():
        is_free, (hull_lower, hull_upper) = lower > 0, hulls.exact[key]
        short += list(np.maximum(lower - hull_upper, 0)[is_free])
        rejected += int((is_free & (hull_lower <= 0)).sum())
        free += int(is_free.sum())
    return {"robot": name, "free": free, "rejected": rejected, "short_mm": f"{1e3 * np.median(short):.3g}",
            "short_most_mm": f"{1e3 * max(short):.3g}"}  # fmt: skip


def main():
    parser = problems.parser(__doc__, "panda ur5", seed=1)
    parser.add_argument("--problems", type=int, default=2, help="of each family: numbers 1 to this")
    parser.add_argument("--states", type=int, default=200, help="of each problem")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--workloads", nargs="+", default=[""], help="only those with one of these words in the name")
    parser.add_argument("--results", type=Path, help="folder of the files to write")
    options = parser.parse_args()
    rows, models, measured = [], [], {}
    for workload in workloads(options.robots):
        if any(word in workload.name for word in options.workloads):
            measured[workload.name] = Measurement(workload, options)
            measured[workload.name].run()
            rows += shown(measured[workload.name].rows())
    for robot in map(ROBOTS.get, options.robots):
        for what in ("", " and itself"):
            hulls, meshes = (measured.get(f"{robot}, {model}{what}") for model in MODELS)
            if hulls and meshes:
                models += shown([model_row(f"{robot}{what}", hulls, meshes)])
    extreme = shown(extremes.rows(options))
    if options.results:
        remark = stamped(f"problems 1 to {options.problems} of each family, {options.states} states of each, "
                         f"{options.rounds} rounds")
        for name, found in (("tradeoff", rows), ("tradeoff_models", models), ("tradeoff_extremes", extreme)):
            write(found, options.results / f"{name}.csv", remark)
    return int(any(row["wrong"] or row["wider"] for row in [*rows, *extreme] if row.get("question") != "sampled"))


if __name__ == "__main__":
    sys.exit(main())
