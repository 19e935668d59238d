#!/usr/bin/env python3
"""Cost of proving whole edges, by margin and tolerance, compared with the cost and misses of sampling them.

    bench/run.py edges [--edges 2000] [--rounds 5] [--csv FILE]

The arm of scenes/cell/robot.yaml moves from random free states in random directions by 0.2 to 1.5 rad. The proof
decides for each edge whether it is free by the margin throughout, or finds a violation; sampling checks states at most
a step apart. One engine, one thread, batches of 500, processor time. Settings alternate; `ratio` is the median over the
rounds of the time relative to the proof with the same margin in the same round.

`missed` counts edges that samples report free although the proof found two bodies within the margin; `wrong` counts
edges that are proved free although a sample is not: exit code 1 unless it is 0.
"""

import statistics
import sys
from typing import Any

import numpy as np

import clearance
from clearance import Status
from harness import ROOT, parser, shown, timed, write
from sampled import within_samples

SCENE = ROOT / "scenes" / "cell" / "robot.yaml"
COLUMNS = ["question", "margin_m", "setting", "edges", "us_an_edge", "ratio", "configurations", "free", "hits",
           "undecided", "missed", "wrong", "width_mm"]  # fmt: skip
MARGINS = (0.0, 1e-3, 5e-3, 2e-2)
STEPS = (0.2, 0.1, 0.05, 0.02, 0.01, 0.005)
SAMPLED_MARGINS = (0.0, 5e-3)
TOLERANCES = (0.1, 1e-2, 1e-3, 1e-4, 1e-5)
AT_ONCE = 500
FIELDS = ("status", "steps", "lower", "upper")


class EdgeQueries:
    """The edges, and their queries."""

    def __init__(self, count, seed):
        self.engine = clearance.Engine(clearance.Scene.load(SCENE), backend="cpu", threads=1)
        self.engine.allow("arm/wrist_1", "arm/flange")
        self.joints = self.engine.joints("arm")
        rng = np.random.default_rng(seed)
        low, high = np.maximum(self.joints.lower, -np.pi), np.minimum(self.joints.upper, np.pi)
        states = rng.uniform(low, high, (20 * count, len(low)))
        self.start = states[self.engine.check(states, joints=self.joints, margin=max(MARGINS)).free][:count]
        if len(self.start) < count:
            raise RuntimeError(f"only {len(self.start)} of {20 * count} random states are free")
        way = rng.normal(size=self.start.shape)
        way[:, -1] = 0  # the gripper's fingers
        self.end = self.start + way * rng.uniform(0.2, 1.5, (count, 1)) / np.linalg.norm(way, axis=1, keepdims=True)

    def batches(self):
        for first in range(0, len(self.start), AT_ONCE):
            yield self.start[first : first + AT_ONCE], self.end[first : first + AT_ONCE]

    def motions(self, **requested):
        """Columns of all edges, and the time taken."""
        answers, seconds = [], 0.0
        for start, end in self.batches():
            took, answer = timed(self.engine.motions, start, end, joints=self.joints, fields=FIELDS, **requested)
            answers.append(answer)
            seconds += took
        return seconds, {n: np.concatenate([getattr(a, n) for a in answers]) for n in FIELDS}

    def proof(self, margin, _):
        return self.motions(margin=margin, reduce="any", rel_tol=1e-6, abs_tol=0.0)

    def least(self, _, tolerance):
        return self.motions(reduce="min", abs_tol=tolerance)

    def samples(self, margin, step):
        answers, seconds = [], 0.0
        for start, end in self.batches():
            took, answer = timed(within_samples, self.engine, self.joints, start, end, margin, step)
            answers.append(answer)
            seconds += took
        free, counts = (np.concatenate(column) for column in zip(*answers))
        return seconds, {"free": free, "steps": counts}


def settings():
    for margin in MARGINS:
        yield "proof", margin, 0.0
        if margin in SAMPLED_MARGINS:
            for step in STEPS:
                yield "samples", margin, step
    for tolerance in TOLERANCES:
        yield "least", 0.0, tolerance


def measure(requested, rounds):
    """(seconds by round, answer) of each setting; all alternate."""
    taken, answers = {}, {}
    for _ in range(rounds):
        for setting in settings():
            question, margin, value = setting
            seconds, answers[setting] = getattr(requested, question)(margin, value)
            taken.setdefault(setting, []).append(seconds)
    return taken, answers


def row_of(setting, taken, answers):
    question, margin, value = setting
    base = taken["proof", margin, 0.0]
    mine, answer = taken[setting], answers[setting]
    count = len(answer["steps"])
    row: dict[str, Any] = dict.fromkeys(COLUMNS, "")
    row |= {
        "question": question,
        "margin_m": f"{margin:g}",
        "setting": f"{value:g}" if value else "",
        "edges": count,
        "us_an_edge": f"{1e6 * statistics.median(mine) / count:.3g}",
        "ratio": f"{statistics.median(a / b for a, b in zip(mine, base)):.3g}",
        "configurations": f"{answer['steps'].mean():.3g}",
        "wrong": 0,
    }
    if question == "least":
        width = sorted(answer["upper"] - answer["lower"])
        row["width_mm"] = f"{1000 * width[int(0.99 * (count - 1))]:.3g}"
        row["undecided"] = int((answer["status"] == Status.UNCONVERGED).sum())
        return row
    truth = answers["proof", margin, 0.0]["status"]
    proved, hit = truth == Status.BEYOND, truth <= Status.CONTACT
    if question == "proof":
        return row | {"free": int(proved.sum()), "hits": int(hit.sum()), "undecided": int((~proved & ~hit).sum())}
    free = answer["free"]
    return row | {
        "free": int(free.sum()),
        "hits": int((~free).sum()),
        "undecided": 0,
        "missed": int((free & hit).sum()),
        "wrong": int((~free & proved).sum()),
    }


def main():
    made = parser(__doc__, seed=1)
    made.add_argument("--edges", type=int, default=2000)
    made.add_argument("--rounds", type=int, default=5)
    options = made.parse_args()
    requested = EdgeQueries(options.edges, options.seed)
    taken, answers = measure(requested, options.rounds)
    rows = shown(row_of(setting, taken, answers) for setting in settings())
    write(rows, options.csv, f"{options.edges} edges, seed {options.seed}, {options.rounds} rounds, one thread")
    return 1 if any(row["wrong"] for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
