#!/usr/bin/env python3
"""MotionBenchMaker's problems planned by OMPL's RRTConnect: edges sampled every 0.02 rad, and edges that are proved.

    bench/run.py ompl [--robots panda ur5 fetch] [--problems 3] [--seconds 20] [--csv FILE]

Both use the same engine with one thread; the samples of an edge are one batch, and so is a proof. Every path that is
found, and every path that is shortened afterwards, is then checked as a whole: proved free, or rejected with the pair
and the time of the violation. Times are processor time, medians over solved problems; a problem that takes longer than
--seconds of wall time counts as unsolved. Exit code 1 if a path of proved edges is rejected.
"""

import statistics
import sys
from typing import Any

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from ompl import util

import clearance.ompl
import problems
from bench_motions import STEP
from clearance import Status
from contenders import engine_of
from harness import shown, timed, write
from sampled import within_samples


class SampledMotions(ob.MotionValidator):
    """The usual method of planners: a motion is valid if all of its samples are."""

    def __init__(self, si, problem):
        super().__init__(si)
        self.problem = problem

    def checkMotion(self, start, end):
        a, b = self.problem.row(start), self.problem.row(end)
        return bool(self.free(a[None], b[None])[0])

    def free(self, start, end):
        problem = self.problem
        return within_samples(problem.engine, problem.joints, start, problem.unwrapped(start, end), 0.0, STEP)[0]


def shortened(path, free):
    """Connects every waypoint straight to the farthest one for which `free` holds."""
    kept, at = [0], 0
    while at < len(path) - 1:
        ends = path[at + 1 :]
        through = np.flatnonzero(free(np.tile(path[at], (len(ends), 1)), ends))
        at += 1 + int(through[-1] if len(through) else 0)
        kept.append(at)
    return path[kept]


def plan(problem, start, goal, sampled, seconds):
    """(rows of the path or None, of the shortened path, seconds of both)."""
    si = problem.space_information()
    samples = SampledMotions(si, problem)
    if sampled:
        si.setMotionValidator(samples)
        si.setup()
    definition = ob.ProblemDefinition(si)
    definition.setStartAndGoalStates(problem.state(start), problem.state(goal))
    planner = og.RRTConnect(si)
    planner.setProblemDefinition(definition)
    planner.setup()
    planning, solved = timed(planner.solve, seconds)
    if not solved or not definition.hasExactSolution():
        return None, None, planning, 0.0
    path = definition.getSolutionPath()
    rows = np.array([problem.row(path.getState(i)) for i in range(path.getStateCount())])
    free = samples.free if sampled else lambda a, b: problem.motions(a, b).status == Status.BEYOND
    shortening, shorter = timed(shortened, rows, free)
    return rows, shorter, planning, shortening


def judged(problem, rows):
    """'' for a path that is proved free; otherwise the violation."""
    way = [rows[0]]
    for row in rows[1:]:
        way.append(problem.unwrapped(way[-1], row))
    done = problem.engine.check_path(np.array(way), joints=problem.joints, max_evaluations=4096)
    if done.free:
        return ""
    names = [problem.engine.bodies[i] for i in done.pair]
    return f"{names[0]} and {names[1]} at {done.time:.6f} of motion {done.motion}: {done.status.name.lower()}"


def measure(robot, resources, options):
    found: dict[str, dict[str, Any]] = {
        way: {"seconds": [], "shortening": [], "refused": [], "asked": 0} for way in ("sampled", "proved")
    }
    for requested in problems.load(resources, robot, options.problems):
        joints = list(requested.goal)
        start, goal = (np.array([at[j] for j in joints]) for at in (requested.start, requested.goal))
        engine = engine_of(requested, resources)
        for way, of in found.items():
            problem = clearance.ompl.JointProblem(engine, [f"{robot}/{j}" for j in joints])
            if not problem.free(np.array([start, goal])).all():
                continue  # a start or goal that is not free makes the problem unsolvable
            of["asked"] += 1
            rows, shorter, planning, shortening = plan(problem, start, goal, way == "sampled", options.seconds)
            if rows is None:
                continue
            of["seconds"].append(planning)
            of["shortening"].append(shortening)
            for name, path in (("path", rows), ("shortened path", shorter)):
                if why := judged(problem, path):
                    of["refused"].append(why)
                    print(f"{requested.name}, {way} edges, {name}: refused: {why}", flush=True)
    return [
        {
            "robot": robot,
            "edges": way,
            "problems": of["asked"],
            "solved": len(of["seconds"]),
            "planning_s": f"{statistics.median(of['seconds'] or [0]):.3g}",
            "shortening_s": f"{statistics.median(of['shortening'] or [0]):.3g}",
            "paths": 2 * len(of["seconds"]),
            "proved_free": 2 * len(of["seconds"]) - len(of["refused"]),
            "refused": len(of["refused"]),
        }
        for way, of in found.items()
    ]


def main():
    parser = problems.parser(__doc__, "panda ur5 fetch", seed=1)
    parser.add_argument("--problems", type=int, default=1, help="of each family: numbers 1 to this")
    parser.add_argument("--seconds", type=float, default=20.0, help="on the wall, for each plan")
    options = parser.parse_args()
    resources = problems.fetch()
    util.setLogLevel(util.LOG_ERROR)
    util.RNG.setSeed(options.seed)
    rows = shown(row for robot in options.robots for row in measure(robot, resources, options))
    write(rows, options.csv)
    return 1 if any(row["refused"] for row in rows if row["edges"] == "proved") else 0


if __name__ == "__main__":
    sys.exit(main())
