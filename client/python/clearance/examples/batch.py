"""A thousand states in one call: the least distance of each."""

import time

import numpy as np

import clearance

from ._arm import Shown, arm_scene


def main() -> Shown:
    scene = arm_scene()
    engine = clearance.Engine(scene)
    arm = engine.joints("arm")
    states = np.random.default_rng(1).uniform(arm.lower, arm.upper, (1000, len(arm)))
    begin = time.perf_counter()
    r = engine.distances(configurations=states, joints=arm, reduce="min", abs_tol=1e-3)
    took = time.perf_counter() - begin
    best = int(r.lower.argmax())
    print(f"{1e6 * took / len(states):.1f} us a state; {(r.lower > 0).sum()} of {len(states)} proved free")
    print(f"the farthest from everything: {states[best].round(2)}, {r.lower[best]:.3f} m")
    engine.set_joints(states[best], joints=arm)
    return scene, engine, []
