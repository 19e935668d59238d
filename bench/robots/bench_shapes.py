#!/usr/bin/env python3
"""Geometry of a robot's links, and the cost of each choice: MotionBenchMaker's states of robots, concave ones included.

    bench/run.py shapes [--robots ur5 panda] [--problems 2] [--states 100] [--csv FILE]

`hull`, `parts` and `auto` are values of a scene's `mesh_as`; `exact` is `auto` with open links as surfaces, and
is the reference. Each is queried for validity and distance: start, goal and random states of each problem, one thread,
a batch of configurations, processor time. A state that is proved free by the reference but not by a choice is a false
rejection (`unconverged` counts); one that is free by a choice but proved to collide is a missed overlap: exit code 1.
`short_mm` is the amount by which a choice's distance falls short of the reference, the median of the free states and
the maximum; `width` is the part of the interval due to slack and tolerance.
"""

import sys

import numpy as np

import clearance
import problems
from clearance import Status
from contenders import engine_of
from harness import shown, timed, write

CHOICES = ("hull", "parts", "auto", "exact")


class Robot:
    """A robot's files, and which of its links are open."""

    def __init__(self, name, resources):
        self.name, self.resources = name, resources
        self.files = {**problems.files_of(resources, name), "static": True}
        scene = self.scene("auto")
        self.open = {
            body.name.removeprefix(name + "/"): "surface"
            for i, body in enumerate(scene.bodies)
            if body.hull_excess > 0 and scene.source(i).endswith("(hull)")
        }

    def mesh_as(self, choice):
        return self.open if choice == "exact" else choice

    def scene(self, choice):
        scene = clearance.Scene()
        scene.add_robot(self.name, mesh_as=self.mesh_as(choice), **self.files)
        return scene

    def engine(self, choice, problem):
        return engine_of(problem, self.resources, self.mesh_as(choice))


def limits(engine, joints):
    """(J, 2): range of random states."""
    group = engine.joints(joints)
    return np.clip(np.stack([group.lower, group.upper], 1), -np.pi, np.pi)


class Sums:
    """Results of one choice over all problems."""

    def __init__(self):
        self.valid_s = self.least_s = 0.0
        self.states = self.free = self.rejected = self.undecided = self.missed = 0
        self.short, self.widths = [], []

    def add(self, valid_s, valid, least_s, least, truth, nearest):
        self.valid_s += valid_s
        self.least_s += least_s
        is_free, free = truth.free, valid.free
        self.states += len(free)
        self.free += int(is_free.sum())
        self.rejected += int((is_free & ~free).sum())
        self.undecided += int((valid.verdict == Status.UNCONVERGED).sum())
        self.missed += int((free & ~is_free & (truth.verdict != Status.UNCONVERGED)).sum())
        self.short += list((nearest.lower - least.upper)[is_free].ravel())
        self.widths += list((least.upper - least.lower)[is_free].ravel())


def measure(name, resources, options):
    robot = Robot(name, resources)
    sums = {choice: Sums() for choice in CHOICES}
    triangles = {choice: sum(body.triangle_count for body in robot.scene(choice).bodies) for choice in CHOICES}
    for problem in problems.load(resources, name, options.problems):
        joints = list(problem.goal)
        ids = [f"{name}/{joint}" for joint in joints]
        rng = np.random.default_rng([problem.number, options.seed])
        answers = {}
        for choice in CHOICES:
            engine = robot.engine(choice, problem)
            if not answers:
                low, high = limits(engine, ids).T
                ends = [[at[j] for j in joints] for at in (problem.start, problem.goal)]
                Q = np.concatenate([ends, rng.uniform(low, high, (options.states, len(joints)))])
            options = {"joints": ids, "configurations": Q}
            engine.check(Q[:2], joints=ids)  # fills the caches
            valid = timed(engine.check, Q, joints=ids)
            least = timed(engine.distances, **options, reduce="min", fields=("lower", "upper", "status"))
            answers[choice] = (*valid, *least)
        _, truth, _, nearest = answers["exact"]
        for choice, (valid_s, valid, least_s, least) in answers.items():
            sums[choice].add(valid_s, valid, least_s, least, truth, nearest)
    return [row_of(name, choice, triangles[choice], sums[choice]) for choice in CHOICES]


def row_of(name, choice, triangles, s):
    short = np.maximum(np.array(s.short), 0)
    return {
        "robot": name,
        "mesh_as": choice,
        "triangles": triangles,
        "states": s.states,
        "free": s.free,
        "valid_us": f"{1e6 * s.valid_s / s.states:.3g}",
        "least_us": f"{1e6 * s.least_s / s.states:.3g}",
        "short_mm": f"{1e3 * np.median(short):.3g}",
        "short_most_mm": f"{1e3 * short.max():.3g}",
        "width_nm": f"{1e9 * np.median(s.widths):.2g}",
        "false_refusals": s.rejected,
        "undecided": s.undecided,
        "missed": s.missed,
    }


def main():
    parser = problems.parser(__doc__, "ur5 panda", seed=1)
    parser.add_argument("--problems", type=int, default=2, help="of each family")
    parser.add_argument("--states", type=int, default=100, help="random ones of each problem")
    options = parser.parse_args()
    resources = problems.fetch()
    rows = shown(row for name in options.robots for row in measure(name, resources, options))
    write(rows, options.csv)
    return int(any(row["missed"] for row in rows))


if __name__ == "__main__":
    sys.exit(main())
