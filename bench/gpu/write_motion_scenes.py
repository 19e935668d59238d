#!/usr/bin/env python3
"""Writes MotionBenchMaker's problems as scene folders, for clearance-gpu-motions.

    bench/environment.py bench/robots bench/gpu/write_motion_scenes.py FOLDER [--robot panda] [--numbers 1] [--sides 32]

FOLDER/FAMILY_NUMBER/scene.yaml has a problem's robot and obstacles. ends.txt has the joint names, the start and the
goal. A device supports hulls only, so a cylinder becomes the prism around it with `--sides` sides, whose excess is
0.5 % of the radius. With 0 sides, cylinders are kept and the CPU answers.
"""

import argparse
import functools
from pathlib import Path

import numpy as np

import problems
from contenders import scene_of, shape_of


def prism_of(sides, thing):
    """The obstacle's shape, with a cylinder replaced by a prism of this many sides."""
    if thing.shape != "cylinder" or sides == 0:
        return shape_of(thing)
    length, radius = thing.sizes
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = radius / np.cos(np.pi / sides) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    ends = [np.column_stack([ring, np.full(sides, z)]) for z in (-length / 2, length / 2)]
    return {"vertices": np.concatenate(ends)}


def write(problem, resources, folder, sides):
    robot = problem.robot
    scene_of(problem, resources, shape=functools.partial(prism_of, sides)).save(str(folder))
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
    resources = problems.fetch()
    for problem in problems.load(resources, options.robot):
        if problem.number not in options.numbers:
            continue
        folder = options.folder / f"{problem.family}_{problem.number}"
        write(problem, resources, folder, options.sides)
        print(folder)


if __name__ == "__main__":
    main()
