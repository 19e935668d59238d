#!/usr/bin/env python3
"""OMPL plans for the arm of a cell, and every edge of its tree is proved, not sampled.

    python3 client/examples/ompl_planner.py --planner RRTConnect --margin 0.02

clearance.ompl.JointProblem provides OMPL's state space, and its validity of states and motions, for an engine (or a
client of a daemon) and a group of joints; all else is ordinary OMPL. A path that is found is proved free as a whole,
and shortened to as few motions as can be proved. Needs numpy and ompl.
"""

from __future__ import annotations

import argparse
import sys
import time

import numpy as np
import own_daemon
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

import clearance
import clearance.ompl

SCENE = own_daemon.ROOT / "scenes/cell/robot.yaml"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--planner", default="RRTConnect", help="a planner of ompl.geometric")
    parser.add_argument("--margin", type=float, default=0.02, help="metres that every pair is to be apart, all along")
    parser.add_argument("--goal", type=float, default=1.5, help="where the arm is to turn, radians")
    parser.add_argument("--seconds", type=float, default=60.0, help="how long the planner may look")
    options = parser.parse_args()
    ou.setLogLevel(ou.LogLevel.LOG_WARN)

    engine = clearance.Engine(clearance.Scene.load(SCENE), threads=1)
    engine.allow("arm/wrist_1", "arm/flange")  # by construction never farther apart than 18 mm
    names = [name for name in engine.joints("arm").names if name != "arm/grip"]
    problem = clearance.ompl.JointProblem(engine, names, margin=options.margin)
    start = np.array([state.position for state in engine.joint_states() if state.name in names])
    goal = np.r_[options.goal, start[1:]]

    si = problem.space_information()
    definition = ob.ProblemDefinition(si)
    definition.setStartAndGoalStates(problem.state(start), problem.state(goal))
    planner = getattr(og, options.planner)(si)
    planner.setProblemDefinition(definition)
    planner.setup()
    begin = time.monotonic()
    if not planner.solve(options.seconds):
        print(f"{options.planner} found nothing in {options.seconds:g} s")
        return 1
    found = definition.getSolutionPath()
    path = np.array([problem.row(found.getState(i)) for i in range(found.getStateCount())])
    print(f"{options.planner}: {len(path)} waypoints in {1e3 * (time.monotonic() - begin):.0f} ms")
    short = problem.shortened(path)

    straight = engine.check_path([start, goal], joints=problem.joints, margin=options.margin)
    check = engine.check_path(short, joints=problem.joints, margin=options.margin)
    least = engine.motions(short[:-1], short[1:], joints=problem.joints)
    print(f"shortened to {len(short)}; proved free: {check.free}, never nearer than {1e3 * least.lower.min():.1f} mm")
    assert not straight.free, "the straight way was free: nothing was shown"
    assert check.free and np.array_equal(short[[0, -1]], [start, goal]), check
    return 0


if __name__ == "__main__":
    sys.exit(main())
