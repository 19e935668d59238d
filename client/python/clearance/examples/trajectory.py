"""A cubic trajectory, checked as it is executed: its waypoints are free, and its swing between them is not."""

import numpy as np

import clearance

from ._arm import Shown, arm_scene


def main() -> Shown:
    scene = arm_scene()
    engine = clearance.Engine(scene)
    times, positions = [0, 1, 2], np.array([[-0.5, 0.2, 0.3], [0.28, 0.2, 0.3], [-0.5, 0.2, 0.3]])
    velocities = np.array([[0, 0, 0], [1.8, 0, 0], [0, 0, 0]])
    print("waypoints free:", engine.check(positions, joints="arm").free)
    curve = clearance.Trajectory.cubic(times, positions, velocities)
    report = engine.explain_path(curve, joints="arm", margin=0.01)
    at = report.contact or report.nearest
    print(f"trajectory free: {bool(report)}; {' and '.join(at.pair_names)} at {curve.time(at.index, at.t):.3f} s")
    engine.set_joints(at.positions, joints="arm")
    return scene, engine, [at.segment]
