#!/usr/bin/env python3
"""What proving whole edges costs, by margin and by tolerance, and beside it what sampling them costs and misses.

    bench/tradeoff/edges.py [--edges 2000] [--rounds 5] [--csv FILE]

The arm of scenes/cell/robot.yaml goes from random free states in random directions by 0.2 to 1.5 rad: of each edge the
proof says whether it is free by the margin all along, or finds where it is not; sampling asks about states that are no
more than a step apart. One engine, one thread, batches of 500, processor time; settings take turns, `ratio` is the
median over the rounds of time over that of the proof with the same margin in the same round.

`missed` counts edges that samples call free and on which the proof has found two bodies within the margin; `wrong`
those that are proved free and have a sample that is not: exit code 1 unless it is 0.
"""

import argparse
import csv
import statistics
import sys
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
CSV = ROOT / "docs" / "results" / "edges.csv"
SCENE = ROOT / "scenes" / "cell" / "robot.yaml"
COLUMNS = ["question", "margin_m", "setting", "edges", "us_an_edge", "ratio", "configurations", "free", "hits",
           "undecided", "missed", "wrong", "width_mm"]  # fmt: skip
MARGINS = (0.0, 1e-3, 5e-3, 2e-2)
STEPS = (0.2, 0.1, 0.05, 0.02, 0.01, 0.005)
SAMPLED_MARGINS = (0.0, 5e-3)
TOLERANCES = (0.1, 1e-2, 1e-3, 1e-4, 1e-5)
AT_ONCE = 500


# ---- what docs/tradeoff.md shows of the CSV --------------------------------------------------------------------------


class Edges:
    """The rows of the CSV, by question, margin and setting."""

    def __init__(self, path=CSV):
        with open(path, newline="") as f:
            self.remark = f.readline().lstrip("# ").strip()
            self.rows = list(csv.DictReader(f))
        self.by_setting = {(r["question"], float(r["margin_m"]), float(r["setting"] or 0)): r for r in self.rows}

    def proof(self, margin=0.0):
        return self.by_setting["proof", margin, 0.0]

    def sampled(self, step, margin=0.0):
        return self.by_setting["samples", margin, step]

    def least(self, tolerance):
        return self.by_setting["least", 0.0, tolerance]

    def ratio(self, row):
        return float(row["ratio"])

    def decisions(self):
        """Rows of (what, cells) that answer whether edges are free."""
        for r in self.rows:
            if r["question"] == "least":
                continue
            what = "proved" if r["question"] == "proof" else f"samples, {float(r['setting']):g} rad apart"
            yield [f"{what}, margin {1000 * float(r['margin_m']):g} mm", r["us_an_edge"], r["ratio"],
                   r["configurations"], r["free"], r["hits"], r["undecided"],
                   "" if r["question"] == "proof" else r["missed"]]  # fmt: skip

    def distances(self):
        """Rows of cells of the least distance of edges."""
        for r in self.rows:
            if r["question"] == "least":
                yield [f"{1000 * float(r['setting']):g} mm", r["us_an_edge"], r["ratio"], r["configurations"],
                       r["width_mm"], r["undecided"]]  # fmt: skip


def tables(edges, markdown):
    """What stands between the markers."""
    return "\n\n".join(
        [
            f"From `docs/results/edges.csv` ({edges.remark}), by `make tradeoff`. Time is in proportion to that of the "
            "proof with the same margin. *Missed*: samples call it free, and two bodies are proved within the margin "
            "on it.",
            markdown(
                ["is an edge free?", "us an edge", "time", "configurations", "free", "hits", "undecided", "missed"],
                edges.decisions(),
            ),
            "The least distance of a whole edge, by the tolerance asked for (`abs_tol`); time over that of the proof "
            "that it is free, margin 0:",
            markdown(
                ["`abs_tol`", "us an edge", "time", "configurations", "width, 99 % [mm]", "not so near after 256"],
                edges.distances(),
            ),
        ]
    )


# What the page says of edges in its own words, as conditions on the figures.
CLAIMS = {
    "edges proved": lambda e: all(r["wrong"] == "0" for r in e.rows),
    "a proof is cheaper than samples": lambda e: min(e.ratio(e.sampled(0.02, m)) for m in SAMPLED_MARGINS) > 3,
    # What samples that are no dearer than the proof miss.
    "cheap samples miss": lambda e: all(
        e.ratio(e.sampled(0.2, m)) < 1 and int(e.sampled(0.2, m)["missed"]) > 0 for m in SAMPLED_MARGINS
    ),
    "seldom undecided": lambda e: all(1000 * int(e.proof(m)["undecided"]) < int(e.proof(m)["edges"]) for m in MARGINS),
    "margins are cheap": lambda e: all(
        float(e.proof(m)["us_an_edge"]) < 1.3 * float(e.proof()["us_an_edge"]) for m in MARGINS
    ),
    "ten times nearer": lambda e: all(
        e.ratio(e.least(fine)) < 2 * e.ratio(e.least(coarse)) for coarse, fine in zip(TOLERANCES, TOLERANCES[1:])
    ),
}


# ---- measuring -------------------------------------------------------------------------------------------------------


class Asked:
    """The edges, and what is asked of them."""

    def __init__(self, count, seed):
        import numpy as np

        import clearance

        self.np, self.clearance = np, clearance
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

    def motions(self, **asked):
        """Columns of all edges, and the time that they took."""
        answers, seconds = [], 0.0
        for start, end in self.batches():
            begin = time.process_time()
            answers.append(self.engine.motions(joints=self.joints, start=start, end=end, **asked))
            seconds += time.process_time() - begin
        names = ("status", "steps", "lower", "upper")
        return seconds, {n: self.np.concatenate([getattr(a, n) for a in answers]) for n in names}

    def proof(self, margin, _):
        fields = ("status", "steps", "lower", "upper")
        return self.motions(margin=margin, reduce="any", rel_tol=1e-6, abs_tol=0.0, fields=fields)

    def least(self, _, tolerance):
        return self.motions(reduce="min", abs_tol=tolerance, fields=("status", "steps", "lower", "upper"))

    def samples(self, margin, step):
        """As a planner would: one check for all samples of a batch."""
        np, free, counts, seconds = self.np, [], [], 0.0
        for start, end in self.batches():
            begin = time.process_time()
            n = np.maximum(np.ceil(np.abs(end - start).max(axis=1) / step).astype(int), 1) + 1
            rows = np.concatenate([s + np.linspace(0, 1, k)[:, None] * (e - s) for s, e, k in zip(start, end, n)])
            good = self.engine.check(rows, joints=self.joints, margin=margin).free
            free.append(np.logical_and.reduceat(good, np.concatenate([[0], np.cumsum(n)[:-1]])))
            seconds += time.process_time() - begin
            counts.append(n)
        return seconds, {"free": np.concatenate(free), "steps": np.concatenate(counts)}


def settings():
    for margin in MARGINS:
        yield "proof", margin, 0.0
        if margin in SAMPLED_MARGINS:
            for step in STEPS:
                yield "samples", margin, step
    for tolerance in TOLERANCES:
        yield "least", 0.0, tolerance


def measure(asked, rounds):
    """(seconds by round, answer) of each setting; all take turns."""
    taken, answers = {}, {}
    for _ in range(rounds):
        for setting in settings():
            question, margin, value = setting
            seconds, answers[setting] = getattr(asked, question)(margin, value)
            taken.setdefault(setting, []).append(seconds)
    return taken, answers


def row_of(setting, taken, answers, Status):
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
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--edges", type=int, default=2000)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--csv", type=Path)
    options = parser.parse_args()
    sys.path.insert(0, str(ROOT / "build/python"))
    asked = Asked(options.edges, options.seed)
    taken, answers = measure(asked, options.rounds)
    rows = [row_of(setting, taken, answers, asked.clearance.Status) for setting in settings()]
    for row in rows:
        print("  ".join(f"{name} {value}" for name, value in row.items() if value != ""), flush=True)
    if options.csv:
        with open(options.csv, "w", newline="") as f:
            f.write(f"# {options.edges} edges, seed {options.seed}, {options.rounds} rounds, one thread\n")
            writer = csv.DictWriter(f, COLUMNS, lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
    return 1 if any(row["wrong"] for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
