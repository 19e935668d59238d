"""A motion past a thin sheet: samples are free, and the motion between them is not."""

import numpy as np

import clearance

from ._arm import Shown, arm_scene


def main() -> Shown:
    scene = arm_scene()
    scene.add_box("sheet", [0.1, 0.002, 0.3], static=True, pose=[1.14, 0.095, 0.5, 1, 0, 0, 0])
    engine = clearance.Engine(scene)
    start, end = np.array([-0.4, 0, 0]), np.array([0.4, 0, 0])
    samples = start + np.linspace(0, 1, 5)[:, None] * (end - start)
    print("free at 5 samples:", engine.check(samples, joints="arm").free)
    path = engine.check_path([start, end], joints="arm")
    print("free on the way:  ", path.free, "-", *(path.pair_names or ()), f"at {path.t} of it")
    engine.set_joints(start + (path.t or 0.0) * (end - start), joints="arm")
    return scene, engine, []
