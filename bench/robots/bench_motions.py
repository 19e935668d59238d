#!/usr/bin/env python3
"""Edges of MotionBenchMaker's problems: proved free or not, compared with sampling by the same engine.

    bench/run.py motions [--robots panda ur5 fetch] [--problems 10] [--edges 100] [--verdicts 400] [--margins 0 0.005]

From each problem's start and goal, edges of 0.2 to 1.5 rad go in random directions; pairs of the robot with itself are
included. One batch for each problem, one thread, processor time, with covers: verdicts alone, the default columns of
motions(), those with `steps` (the exact search), and a check every 0.02 rad of the joint that moves most. `missed`
counts edges that are free by samples but not by proof, `wrong` edges that are free by proof but not by samples,
`changed` verdicts that covers change. The last two must be 0 (exit code 1 otherwise). --edges 0 leaves this out.

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
COLUMNS = {"verdict": "verdict", "pair": None, "steps": ("status", "pair", "steps")}  # null for the default columns


def edges_of(problem, joints, count, rng):
    """(count, J) starts and ends."""
    start = verdicts.ends_of(problem, joints)[np.arange(count) % 2]
    return start, verdicts.edges_from(start, rng)


def measure(robot, resources, margin, options):
    requested = problems.load(resources, robot, options.problems)
    sums = dict.fromkeys(("edges", "free", "steps", "steps_free", "undecided", "missed", "wrong", "changed"), 0)
    seconds = dict.fromkeys(("verdict", "pair", "steps", "sampling"), 0.0)
    for problem in requested:
        joints = list(problem.goal)
        engine = engine_of(problem, resources)
        engine.wait_covers()
        names = [f"{robot}/{joint}" for joint in joints]
        start, end = edges_of(problem, joints, options.edges, np.random.default_rng([problem.number, options.seed]))
        query = {"joints": names, "margin": margin, "reduce": "any"}
        found, spent = {}, {}
        for way, fields in COLUMNS.items():
            engine.motions(start[:2], end[:2], fields=fields, **query)  # fills the caches
            spent[way], found[way] = timed(engine.motions, start, end, fields=fields, **query)
        spent["sampling"], (free_at_samples, _) = timed(within_samples, engine, names, start, end, margin, STEP)
        for way in seconds:
            seconds[way] += spent[way]
        r = found["steps"]
        decided, free = r.status != Status.UNCONVERGED, r.status == Status.BEYOND
        for way in ("verdict", "pair"):
            sums["changed"] += int((decided & (free != (np.asarray(found[way].verdict) == Status.BEYOND))).sum())
        sums["edges"] += len(start)
        sums["free"] += int(free.sum())
        sums["steps"] += int(r.steps.sum())
        sums["steps_free"] += int(r.steps[free].sum())
        sums["undecided"] += int((~decided).sum())
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
        "us_a_verdict": f"{1e6 * seconds['verdict'] / sums['edges']:.3g}",
        "us_with_pair": f"{1e6 * seconds['pair'] / sums['edges']:.3g}",
        "us_with_steps": f"{1e6 * seconds['steps'] / sums['edges']:.3g}",
        "us_a_sampled_edge": f"{1e6 * seconds['sampling'] / sums['edges']:.3g}",
        "verdict_over_sampling": f"{seconds['verdict'] / seconds['sampling']:.3g}",
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
