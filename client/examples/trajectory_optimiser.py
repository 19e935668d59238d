#!/usr/bin/env python3
"""A trajectory that evades obstacles by gradients, and is then proved free throughout.

    python3 client/examples/trajectory_optimiser.py --margin 0.02

Waypoints between a start and a goal are moved by L-BFGS: short steps are cheap, and every pair below its required
distance costs the square of the deficit. One query returns all those pairs of all waypoints, with the slope of each
distance by each joint (`gradient_joints`). Nothing is assumed between the waypoints: `check_path` proves the whole path
and, if it finds a pair too near, the optimiser has to keep a greater distance. Needs numpy and scipy.
"""

from __future__ import annotations

import argparse
import sys
import time

import numpy as np
import own_daemon
from scipy.optimize import minimize

import clearance

SCENE = own_daemon.ROOT / "scenes/cell/robot.yaml"
WAYPOINTS = 16  # without the start and the goal
WEIGHT = 400.0  # of the square of the deficit, relative to the squares of the steps
SPARE = 0.02  # metres beyond the margin at first: a path is nearer between its waypoints than at them
ROUNDS = 6  # maximum number of increases of the distance


class Cost:
    """Cost of a trajectory, and its gradient."""

    def __init__(self, engine, joints, start, goal, keep: float):
        self.engine, self.joints, self.start, self.goal, self.keep = engine, joints, start, goal, keep
        self.calls = 0

    def path(self, inner: np.ndarray) -> np.ndarray:
        """(N, J) with both ends."""
        return np.vstack([self.start, inner.reshape(-1, len(self.start)), self.goal])

    def __call__(self, inner: np.ndarray) -> tuple[float, np.ndarray]:
        path, self.calls = self.path(inner), self.calls + 1
        steps = np.diff(path, axis=0)
        slope = np.zeros_like(path)
        slope[1:] += 2 * steps
        slope[:-1] -= 2 * steps
        r = self.engine.distances(
            joints=self.joints, configurations=path[1:-1], reduce="within", max_distance=self.keep,
            fields=["distance", "gradient_joints", "configuration"], signed_distance=True, rel_tol=1e-3, abs_tol=1e-4,
        )  # fmt: skip
        missing = self.keep - r.distance
        np.add.at(slope, r.configuration + 1, -2 * WEIGHT * missing[:, None] * r.gradient_joints)
        return float((steps**2).sum() + WEIGHT * (missing**2).sum()), slope[1:-1].ravel()


def optimise(engine, joints, start, goal, margin: float):
    """(path, PathCheck, rounds): the first trajectory that is proved free, or the last one that is not."""
    inner = np.linspace(start, goal, WAYPOINTS + 2)[1:-1]
    limits = list(zip(joints.lower, joints.upper)) * WAYPOINTS
    for turn in range(1, ROUNDS + 1):
        cost = Cost(engine, joints, start, goal, margin + turn * SPARE)
        found = minimize(cost, inner.ravel(), jac=True, method="L-BFGS-B", bounds=limits, options={"maxiter": 200})
        inner = found.x
        path = cost.path(inner)
        check = engine.check_path(path, joints=joints, margin=margin)
        length = np.abs(np.diff(path, axis=0)).sum()
        print(f"round {turn}: {cost.calls} questions, length {length:.2f} rad, free: {check.free}")
        if check.free:
            break
    return path, check, turn


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--margin", type=float, default=0.02, help="metres that every pair is to be apart, all along")
    parser.add_argument("--goal", type=float, default=1.5, help="where the arm is to turn, radians")
    options = parser.parse_args()
    engine = clearance.Engine(clearance.Scene.load(SCENE), threads=1)
    engine.allow("arm/wrist_1", "arm/flange")  # by construction never farther apart than 18 mm
    joints = engine.joints([name for name in engine.joints("arm").names if name != "arm/grip"])
    start = np.array([state.position for state in engine.joint_states() if state.name in joints.names])
    goal = np.r_[options.goal, start[1:]]

    straight = engine.check_path([start, goal], joints=joints, margin=options.margin)
    between = " and ".join(engine.bodies[i].name for i in straight.pair or ()) or "nothing"
    print(f"straight there: free: {straight.free}; in the way: {between}")
    begin = time.monotonic()
    path, check, turns = optimise(engine, joints, start, goal, options.margin)
    if not check.free:
        print(f"no way was proved free in {turns} rounds: {check}")
        return 1
    # Independent result for each motion: its certified least distance.
    least = engine.motions(path[:-1], path[1:], joints=joints, reduce="min")
    took, nearest = time.monotonic() - begin, 1e3 * least.lower.min()
    print(f"proved in {took:.1f} s: never nearer than {nearest:.1f} mm on its whole way")
    assert not straight.free, "the straight way was free: nothing was shown"
    assert (least.lower >= options.margin - 1e-3).all(), least.lower
    return 0


if __name__ == "__main__":
    sys.exit(main())
