#!/usr/bin/env python3
"""MotionBenchMaker's problems as scene folders, for clearance-gpu-motions.

    bench/gpu/write_motion_scenes.py FOLDER [--robot panda] [--numbers 1] [--sides 32]

FOLDER/FAMILY_NUMBER/scene.yaml is a problem's robot among its obstacles, and ends.txt names its joints, then has the
start and the goal. A device knows hulls alone: a cylinder becomes a prism around it with so many sides, which stands
out by 0.5 % of the radius (0: cylinders stay, and the CPU answers).

Downloads the problems into build/robots.
"""

import argparse
import sys
import warnings
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "build/python"), str(ROOT / "bench/robots")]
from environment import BUILD, in_own_environment  # noqa: E402

if __name__ == "__main__":
    in_own_environment()
import numpy as np  # noqa: E402


def shape_of(thing, sides):
    if thing.shape != "cylinder" or sides == 0:
        from contenders import shape_of as exact

        return exact(thing)
    length, radius = thing.sizes
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = radius / np.cos(np.pi / sides) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    ends = [np.column_stack([ring, np.full(sides, z)]) for z in (-length / 2, length / 2)]
    return {"vertices": np.concatenate(ends)}


def write(problem, resources, folder, sides):
    import problems

    import clearance

    robot = problem.robot
    urdf, srdf = problems.urdf_of(resources, robot)
    scene = clearance.Scene()
    packages = {robot: str(resources / robot)}
    scene.add_robot(robot, convexify="hull", urdf=str(urdf), srdf=str(srdf), packages=packages, static=True)
    for thing in problem.obstacles:
        scene.add_body(f"{thing.name}_obstacle", static=True, pose=thing.pose, **shape_of(thing, sides))
    scene.save(str(folder))
    joints = list(problem.goal)
    lines = [" ".join(f"{robot}/{joint}" for joint in joints)]
    lines += [" ".join(repr(float(at[joint])) for joint in joints) for at in (problem.start, problem.goal)]
    (folder / "ends.txt").write_text("\n".join(lines) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--robot", default="panda")
    parser.add_argument("--numbers", type=int, nargs="+", default=[1], help="of each family")
    parser.add_argument("--sides", type=int, default=32)
    options = parser.parse_args()
    import problems

    resources = problems.fetch(BUILD)
    warnings.simplefilter("ignore")  # what robots and meshes have in them is known
    for problem in problems.load(resources, options.robot):
        if problem.number not in options.numbers:
            continue
        folder = options.folder / f"{problem.family}_{problem.number}"
        write(problem, resources, folder, options.sides)
        print(folder)


if __name__ == "__main__":
    main()
