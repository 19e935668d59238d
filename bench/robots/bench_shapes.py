#!/usr/bin/env python3
"""What a robot's meshes are taken for, and what each choice costs: MotionBenchMaker's states of robots, concave ones.

    bench/robots/bench_shapes.py [--robots ur5 panda] [--problems 2] [--states 100] [--csv FILE]

`hull`, `submeshes` and `auto` are what a scene may say (convexify); `exact` is `auto` with the links that are open as
surfaces, and is the truth here. Each is asked whether a state is valid and how near it is to contact: start, goal and
random states of each problem, one thread, a batch of configurations, processor time. A state that is proved free of the
truth and not proved free with a choice is a false refusal (`unconverged` counts), one that is called free and is proved
to collide a missed overlap: exit code 1. `short_mm` is by how much a choice's distance falls short of the truth's, the
median of the free states and the most; `width` is what slack and tolerance leave of the interval.

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

CHOICES = ("hull", "submeshes", "auto", "exact")


class Robot:
    """A robot's files, and which of its links are open."""

    def __init__(self, name, resources):
        import problems

        self.name = name
        urdf, srdf = problems.urdf_of(resources, name)
        self.files = {"urdf": str(urdf), "srdf": str(srdf), "packages": {name: str(resources / name)}, "static": True}
        scene = self.scene("auto")
        self.open = {
            body.name.removeprefix(name + "/"): "surface"
            for i, body in enumerate(scene.bodies)
            if body.hull_excess > 0 and scene.source(i).endswith("(hull)")
        }

    def scene(self, choice):
        import clearance

        scene = clearance.Scene()
        scene.add_robot(self.name, convexify=self.open if choice == "exact" else choice, **self.files)
        return scene

    def engine(self, choice, problem):
        from contenders import shape_of

        import clearance

        scene = self.scene(choice)
        for thing in problem.obstacles:
            scene.add_body(f"{thing.name}_obstacle", static=True, pose=thing.pose, **shape_of(thing))
        return clearance.Engine(scene, backend="cpu", threads=1)


def limits(engine, joints):
    """(J, 2): where random states come from."""
    group = engine.joints(joints)
    return np.clip(np.stack([group.lower, group.upper], 1), -np.pi, np.pi)


def timed(call, *args, **more):
    begin = time.process_time()
    result = call(*args, **more)
    return time.process_time() - begin, result


class Sums:
    """What one choice comes to over all problems."""

    def __init__(self):
        self.valid_s = self.least_s = 0.0
        self.states = self.free = self.refused = self.undecided = self.missed = 0
        self.short, self.widths = [], []

    def add(self, valid_s, valid, least_s, least, truth, nearest):
        from clearance import Status

        self.valid_s += valid_s
        self.least_s += least_s
        is_free, free = truth.free, valid.free
        self.states += len(free)
        self.free += int(is_free.sum())
        self.refused += int((is_free & ~free).sum())
        self.undecided += int((valid.status == Status.UNCONVERGED).sum())
        self.missed += int((free & ~is_free & (truth.status != Status.UNCONVERGED)).sum())
        self.short += list((nearest.lower - least.upper)[is_free].ravel())
        self.widths += list((least.upper - least.lower)[is_free].ravel())


def measure(name, resources, options):
    import problems

    robot = Robot(name, resources)
    sums = {choice: Sums() for choice in CHOICES}
    triangles = {choice: sum(body.triangle_count for body in robot.scene(choice).bodies) for choice in CHOICES}
    asked = [p for p in problems.load(resources, name) if p.number <= options.problems]
    for problem in asked:
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
            ask = {"joints": ids, "positions": Q}
            engine.check(Q[:2], joints=ids)  # what is made once
            valid = timed(engine.check, Q, joints=ids)
            least = timed(engine.distances, **ask, reduce="min", fields=("lower", "upper", "status"))
            answers[choice] = (*valid, *least)
        _, truth, _, nearest = answers["exact"]
        for choice, (valid_s, valid, least_s, least) in answers.items():
            sums[choice].add(valid_s, valid, least_s, least, truth, nearest)
    return [row_of(name, choice, triangles[choice], sums[choice]) for choice in CHOICES]


def row_of(name, choice, triangles, s):
    short = np.maximum(np.array(s.short), 0)
    return {
        "robot": name,
        "convexify": choice,
        "triangles": triangles,
        "states": s.states,
        "free": s.free,
        "valid_us": f"{1e6 * s.valid_s / s.states:.3g}",
        "least_us": f"{1e6 * s.least_s / s.states:.3g}",
        "short_mm": f"{1e3 * np.median(short):.3g}",
        "short_most_mm": f"{1e3 * short.max():.3g}",
        "width_nm": f"{1e9 * np.median(s.widths):.2g}",
        "false_refusals": s.refused,
        "undecided": s.undecided,
        "missed": s.missed,
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robots", nargs="+", default=["ur5", "panda"], metavar="NAME")
    parser.add_argument("--problems", type=int, default=2, help="of each family")
    parser.add_argument("--states", type=int, default=100, help="random ones of each problem")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--csv", type=Path)
    options = parser.parse_args()
    import problems

    warnings.simplefilter("ignore")
    resources = problems.fetch(BUILD)
    rows = []
    for name in options.robots:
        for row in measure(name, resources, options):
            rows.append(row)
            show(row)
    save(rows, options.csv)
    return int(any(row["missed"] for row in rows))


if __name__ == "__main__":
    sys.exit(main())
