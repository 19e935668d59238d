#!/usr/bin/env python3
"""Edges of MotionBenchMaker's problems: proved free or not, compared with sampling by the same engine.

    bench/run.py motions [--robots panda ur5 fetch] [--problems 10] [--edges 100] [--margins 0 0.005]

From each problem's start and goal, edges of 0.2 to 1.5 rad go in random directions; pairs of the robot with itself are
included. One batch for each problem, one thread, processor time. Sampling checks every 0.02 rad of the joint that moves
most. `missed` counts edges that are free by samples but not by proof, `wrong` edges that are free by proof but not by
samples. The verdict alone is timed with covers and without: `changed` counts verdicts that differ. Both must be 0 (exit
code 1 otherwise).
"""

import sys

import numpy as np

import problems
from clearance import Status
from contenders import engine_of
from harness import shown, timed, write
from sampled import within_samples

STEP = 0.02  # radians between samples


def edges_of(problem, joints, count, rng):
    """(count, J) starts and ends."""
    ends = np.array([[at[j] for j in joints] for at in (problem.start, problem.goal)])
    start = ends[np.arange(count) % 2]
    way = rng.normal(size=start.shape)
    way *= rng.uniform(0.2, 1.5, (count, 1)) / np.linalg.norm(way, axis=1, keepdims=True)
    return start, start + way


def measure(robot, resources, margin, options):
    requested = problems.load(resources, robot, options.problems)
    sums = dict.fromkeys(("edges", "free", "steps", "steps_free", "undecided", "missed", "wrong", "changed"), 0)
    proof_s = sampling_s = 0.0
    verdict_s = {"off": 0.0, "background": 0.0}  # by covers
    for problem in requested:
        joints = list(problem.goal)
        engine = engine_of(problem, resources)
        names = [f"{robot}/{joint}" for joint in joints]
        start, end = edges_of(problem, joints, options.edges, np.random.default_rng([problem.number, options.seed]))
        proof = {"joints": names, "margin": margin, "reduce": "any", "fields": ("status", "pair", "steps")}
        engine.motions(start[:2], end[:2], **proof)  # fills the caches
        seconds, r = timed(engine.motions, start, end, **proof)
        proof_s += seconds
        verdicts = {}
        for covers in verdict_s:
            each = engine_of(problem, resources, covers=covers)
            each.wait_covers()
            requested_only = {**proof, "fields": "verdict"}
            each.motions(start[:2], end[:2], **requested_only)
            seconds, found = timed(each.motions, start, end, **requested_only)
            verdict_s[covers] += seconds
            verdicts[covers] = np.asarray(found.verdict)
        decided = verdicts["off"] != Status.UNCONVERGED
        sums["changed"] += int((decided & (verdicts["off"] != verdicts["background"])).sum())
        seconds, (free_at_samples, _) = timed(within_samples, engine, names, start, end, margin, STEP)
        sampling_s += seconds
        free = r.status == Status.BEYOND
        sums["edges"] += len(start)
        sums["free"] += int(free.sum())
        sums["steps"] += int(r.steps.sum())
        sums["steps_free"] += int(r.steps[free].sum())
        sums["undecided"] += int((r.status == Status.UNCONVERGED).sum())
        sums["missed"] += int((free_at_samples & (r.status <= Status.CONTACT)).sum())
        sums["wrong"] += int((free & ~free_at_samples).sum())
    return {
        "robot": robot,
        "margin_m": margin,
        "scenes": len(requested),
        "edges": sums["edges"],
        "free": sums["free"],
        "configurations_a_free_edge": f"{sums['steps_free'] / max(sums['free'], 1):.3g}",
        "configurations_an_edge": f"{sums['steps'] / sums['edges']:.3g}",
        "us_an_edge": f"{1e6 * proof_s / sums['edges']:.3g}",
        "us_a_verdict_without_covers": f"{1e6 * verdict_s['off'] / sums['edges']:.3g}",
        "us_a_verdict": f"{1e6 * verdict_s['background'] / sums['edges']:.3g}",
        "us_a_sampled_edge": f"{1e6 * sampling_s / sums['edges']:.3g}",
        "time_over_sampling": f"{proof_s / sampling_s:.3g}",
        "undecided": sums["undecided"],
        "missed_by_samples": sums["missed"],
        "wrong": sums["wrong"],
        "changed": sums["changed"],
    }


def main():
    parser = problems.parser(__doc__, "panda ur5 fetch", seed=1)
    parser.add_argument("--problems", type=int, default=10, help="of each family: numbers 1 to this")
    parser.add_argument("--edges", type=int, default=100, help="of each problem")
    parser.add_argument("--margins", type=float, nargs="+", default=[0.0, 0.005])
    options = parser.parse_args()
    resources = problems.fetch()
    rows = shown(measure(robot, resources, margin, options) for robot in options.robots for margin in options.margins)
    write(rows, options.csv)
    return 1 if any(row["wrong"] or row["changed"] for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
