#!/usr/bin/env python3
"""Edges of MotionBenchMaker's problems: proved free or not, compared with sampling by the same engine.

    bench/run.py motions [--robots panda ur5 fetch] [--problems 10] [--edges 100] [--verdicts 400] [--margins 0 0.005]

From each problem's start and goal, edges of 0.2 to 1.5 rad go in random directions; pairs of the robot with itself are
included. One batch for each problem, one thread, processor time. Sampling checks every 0.02 rad of the joint that moves
most. `missed` counts edges that are free by samples but not by proof, `wrong` edges that are free by proof but not by
samples, `changed` verdicts that covers change. Both must be 0 (exit code 1 otherwise). --edges 0 leaves this out.

Verdicts alone are timed in C++ (clearance-prepared), without covers (`times_off`) and with them, in batches and one a
call: of random states, of such edges (near), and of edges from random free states (anywhere), free and hit apart.
--programs times several builds by turns, each also relative to the first (`of_first`).
"""

import sys
from pathlib import Path

import numpy as np

import problems
import verdicts
from clearance import Status
from contenders import engine_of
from harness import shown, timed, write
from sampled import within_samples

STEP = 0.02  # radians between samples
COVERS = ("off", "background")


def edges_of(problem, joints, count, rng):
    """(count, J) starts and ends."""
    start = verdicts.ends_of(problem, joints)[np.arange(count) % 2]
    return start, verdicts.edges_from(start, rng)


def measure(robot, resources, margin, options):
    requested = problems.load(resources, robot, options.problems)
    sums = dict.fromkeys(("edges", "free", "steps", "steps_free", "undecided", "missed", "wrong", "changed"), 0)
    proof_s = sampling_s = 0.0
    for problem in requested:
        joints = list(problem.goal)
        engine = engine_of(problem, resources)
        names = [f"{robot}/{joint}" for joint in joints]
        start, end = edges_of(problem, joints, options.edges, np.random.default_rng([problem.number, options.seed]))
        proof = {"joints": names, "margin": margin, "reduce": "any", "fields": ("status", "pair", "steps")}
        engine.motions(start[:2], end[:2], **proof)  # fills the caches
        seconds, r = timed(engine.motions, start, end, **proof)
        proof_s += seconds
        found = {}
        for covers in COVERS:
            each = engine_of(problem, resources, covers=covers)
            each.wait_covers()
            found[covers] = np.asarray(each.motions(start, end, **{**proof, "fields": "verdict"}).verdict)
        decided = found["off"] != Status.UNCONVERGED
        sums["changed"] += int((decided & (found["off"] != found["background"])).sum())
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
        "us_a_sampled_edge": f"{1e6 * sampling_s / sums['edges']:.3g}",
        "time_over_sampling": f"{proof_s / sampling_s:.3g}",
        "undecided": sums["undecided"],
        "missed_by_samples": sums["missed"],
        "wrong": sums["wrong"],
        "changed": sums["changed"],
    }


def time_verdicts(robot, resources, margin, options):
    times = verdicts.Verdicts(robot, margin, options.programs, options.rounds)
    for problem in problems.load(resources, robot, options.problems):
        times.add(problem, resources, list(problem.goal), options.verdicts, options.seed)
    return times.rows()


def main():
    parser = problems.parser(__doc__, "panda ur5 fetch", seed=1)
    parser.add_argument("--problems", type=int, default=3, help="of each family: numbers 1 to this")
    parser.add_argument("--edges", type=int, default=200, help="of each problem, compared with samples")
    parser.add_argument("--verdicts", type=int, default=400, help="edges of each problem and kind that are timed")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--programs", type=Path, nargs="+", default=[verdicts.PROGRAM], help="of other builds, too")
    parser.add_argument("--margins", type=float, nargs="+", default=[0.0, 0.005])
    options = parser.parse_args()
    resources = problems.fetch()
    rows = []
    for robot in options.robots:
        for margin in options.margins:
            if options.edges:
                rows += shown([measure(robot, resources, margin, options)])
            if options.verdicts:
                rows += shown(time_verdicts(robot, resources, margin, options))
    write(rows, options.csv)
    return 1 if any(row.get("wrong") or row.get("changed") for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
