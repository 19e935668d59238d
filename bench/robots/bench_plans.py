#!/usr/bin/env python3
"""MotionBenchMaker's problems planned by clearance::plan(), every motion proved.

    bench/run.py plans [--robots panda ur5] [--problems 50] [--margins 0 0.005] [--rounds 3] [--seeds 5]

One engine of one thread for each robot, links as hulls; obstacles are added and removed from problem to problem. Times
are processor time of the whole call in C++: preparation, check of start and goal, search. "first" is the first call
after the obstacles have changed, the others find a query that is prepared. Each problem is planned with several seeds;
of each plan the least of the rounds counts. "free" counts the plans whose ends are free; the others are not solvable.
"""

import csv
import io
import subprocess
import sys

import numpy as np

import problems
from bench_robots import scene_file_of
from harness import ROOT, shown, stamped, write

PROGRAM = ROOT / "build/bin/clearance-plans"


def write_problems(path, robot, requested):
    joints = list(requested[0].goal)
    with path.open("w") as file:
        print("robot", *(f"{robot}/{joint}" for joint in joints), file=file)
        for problem in requested:
            print("problem", problem.name, file=file)
            for what in ("start", "goal"):
                print(what, *(repr(getattr(problem, what)[joint]) for joint in joints), file=file)
            for thing in problem.obstacles:
                sizes = thing.sizes if thing.shape != "cylinder" else thing.sizes[::-1]  # radius, length
                print(thing.shape, thing.name, *map(repr, sizes), *map(repr, thing.pose.tolist()), file=file)


def row_of(robot, margin, plans):
    """A row of the table for one robot."""
    free = [plan for plan in plans if plan["outcome"] not in ("start", "goal", "limits")]
    found = [plan for plan in free if plan["outcome"] == "found"]
    first, search, shortened = (
        np.array([float(plan[f"{call}_us"]) for plan in found]) for call in ("first", "search", "shortened")
    )
    return {
        "robot": robot,
        "margin_mm": f"{1e3 * margin:g}",
        "plans": len(plans),
        "free": len(free),
        "solved": len(found),
        "proved": sum(plan["proved"] == "1" for plan in found),
        "first_median_us": f"{np.median(first):.0f}",
        "first_mean_us": f"{first.mean():.0f}",
        "median_us": f"{np.median(search):.0f}",
        "mean_us": f"{search.mean():.0f}",
        "p95_us": f"{np.percentile(search, 95):.0f}",
        "iterations": f"{np.mean([int(plan['iterations']) for plan in found]):.0f}",
        "motions": f"{np.mean([int(plan['motions']) for plan in found]):.0f}",
        "shortened_median_us": f"{np.median(shortened):.0f}",
        "shortened_mean_us": f"{shortened.mean():.0f}",
        "length": f"{np.mean([float(plan['length']) for plan in found]):.2f}",
        "shortened_length": f"{np.mean([float(plan['shortened_length']) for plan in found]):.2f}",
    }


def measure(options):
    resources = problems.fetch()
    for robot in options.robots:
        requested = problems.load(resources, robot, options.problems)
        scene, listed = scene_file_of(robot, resources), resources / f"{robot}_plans.txt"
        write_problems(listed, robot, requested)
        for margin in options.margins:
            numbers = (str(number) for number in (margin, options.rounds, options.seeds))
            command = [str(PROGRAM), str(scene), str(listed), *numbers]
            printed = subprocess.run(command, check=True, text=True, stdout=subprocess.PIPE).stdout
            yield row_of(robot, margin, list(csv.DictReader(io.StringIO(printed))))


def main():
    parser = problems.parser(__doc__, "panda ur5")
    parser.add_argument("--problems", type=int, default=50, help="of each family")
    parser.add_argument("--margins", type=float, nargs="+", default=[0.0, 0.005], help="metres")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--seeds", type=int, default=5)
    options = parser.parse_args()
    write(
        shown(measure(options)),
        options.csv,
        stamped(f"{options.problems} problems of each family, {options.seeds} seeds"),
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
