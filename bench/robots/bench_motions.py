#!/usr/bin/env python3
"""Edges of MotionBenchMaker's problems: proved free or not all along, beside sampling them with the same engine.

    bench/robots/bench_motions.py [--robots panda ur5 fetch] [--problems 10] [--edges 100] [--margins 0 0.005]

From each problem's start and goal edges of 0.2 to 1.5 rad go in random directions, pairs of the robot with itself
included. One batch for each problem, one thread, processor time. Sampling asks about every 0.02 rad of the joint that
moves most; what it calls free and the proof does not is counted (`missed`), and so is what the proof calls free and a
sample does not (`wrong`, which must be 0: exit code 1 otherwise).

Downloads the problems into build/robots.
"""

import argparse
import sys
import time
import warnings
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "build/python"), str(Path(__file__).parent)]
from environment import BUILD, in_own_environment  # noqa: E402
from rows import save, show  # noqa: E402

if __name__ == "__main__":
    in_own_environment()
import numpy as np  # noqa: E402

STEP = 0.02  # radians between samples


def scene_of(problem, files):
    from contenders import shape_of

    import clearance

    scene = clearance.Scene()
    scene.add_robot(problem.robot, convexify="hull", **files)
    for thing in problem.obstacles:
        scene.add_body(f"{thing.name}_obstacle", static=True, pose=thing.pose, **shape_of(thing))
    return clearance.Engine(scene, backend="cpu", threads=1)


def edges_of(problem, joints, count, rng):
    """(count, J) starts and ends."""
    ends = np.array([[at[j] for j in joints] for at in (problem.start, problem.goal)])
    start = ends[np.arange(count) % 2]
    way = rng.normal(size=start.shape)
    way *= rng.uniform(0.2, 1.5, (count, 1)) / np.linalg.norm(way, axis=1, keepdims=True)
    return start, start + way


def timed(call, *args, **more):
    begin = time.process_time()
    result = call(*args, **more)
    return time.process_time() - begin, result


def within_samples(engine, joints, start, end, margin):
    """Whether each edge is free at all of its samples. As a planner would: one check for all samples of a batch."""
    counts = np.maximum(np.ceil(np.abs(end - start).max(axis=1) / STEP).astype(int), 1) + 1
    rows = np.concatenate([s + np.linspace(0, 1, n)[:, None] * (e - s) for s, e, n in zip(start, end, counts)])
    free = engine.check(rows, joints=joints, margin=margin).free
    return np.logical_and.reduceat(free, np.concatenate([[0], np.cumsum(counts)[:-1]]))


def measure(robot, resources, margin, options):
    import problems

    from clearance import Status

    urdf, srdf = problems.urdf_of(resources, robot)
    files = {"urdf": str(urdf), "srdf": str(srdf), "packages": {robot: str(resources / robot)}, "static": True}
    asked = [p for p in problems.load(resources, robot) if p.number <= options.problems]
    sums = dict.fromkeys(("edges", "free", "steps", "steps_free", "undecided", "missed", "wrong"), 0)
    proof_s = sampling_s = 0.0
    for problem in asked:
        joints = list(problem.goal)
        engine = scene_of(problem, files)
        names = [f"{robot}/{joint}" for joint in joints]
        start, end = edges_of(problem, joints, options.edges, np.random.default_rng([problem.number, options.seed]))
        ask = {"joints": names, "start": start, "end": end, "margin": margin, "reduce": "any"}
        engine.motions(**{**ask, "start": start[:2], "end": end[:2]})  # what is made once
        seconds, r = timed(engine.motions, **ask, rel_tol=1e-6, abs_tol=0.0, fields=("status", "pair", "steps"))
        proof_s += seconds
        seconds, free_at_samples = timed(within_samples, engine, names, start, end, margin)
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
        "scenes": len(asked),
        "edges": sums["edges"],
        "free": sums["free"],
        "configurations_a_free_edge": f"{sums['steps_free'] / max(sums['free'], 1):.3g}",
        "configurations_an_edge": f"{sums['steps'] / sums['edges']:.3g}",
        "us_an_edge": f"{1e6 * proof_s / sums['edges']:.3g}",
        "time_over_sampling": f"{proof_s / sampling_s:.3g}",
        "undecided": sums["undecided"],
        "missed_by_samples": sums["missed"],
        "wrong": sums["wrong"],
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--robots", nargs="+", default=["panda", "ur5", "fetch"])
    parser.add_argument("--problems", type=int, default=10, help="of each family: numbers 1 to this")
    parser.add_argument("--edges", type=int, default=100, help="of each problem")
    parser.add_argument("--margins", type=float, nargs="+", default=[0.0, 0.005])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--csv", type=Path)
    options = parser.parse_args()
    import problems

    resources = problems.fetch(BUILD)
    warnings.simplefilter("ignore")  # what robots and meshes have in them is known
    rows = []
    for robot in options.robots:
        for margin in options.margins:
            rows.append(measure(robot, resources, margin, options))
            show(rows[-1])
    save(rows, options.csv)
    return 1 if any(row["wrong"] for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
