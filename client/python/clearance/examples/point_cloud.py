"""A cloud of points, as from a depth camera: each point is a ball of 1 cm, and the whole cloud one body."""

import numpy as np

import clearance

from ._arm import Shown, arm_scene


def main() -> Shown:
    scene = arm_scene()
    scene.add_points("cloud", radius=0.01, pose=[0, 0, 0, 1, 0, 0, 0])
    engine = clearance.Engine(scene)
    engine.set_joints([-0.5, 0.1, 0.4], joints="arm")
    points = np.random.default_rng(1).normal([0.9, -0.1, 0.6], 0.04, (10000, 3))
    engine.set_points("cloud", points.astype(np.float32))
    r = engine.distances(pairs=("arm", "cloud"), reduce="min", fields=["lower", "pair", "points"])
    print(f"{r.lower[0]:.4f} m to", *(engine.bodies[i].name for i in r.pairs[0]))
    near = points[((points - r.point_a[0]) ** 2).sum(axis=1).argsort()[:300]]  # drawn, as crosses of no length
    return scene, engine, np.concatenate([[[r.point_a[0], r.point_b[0]]], np.stack([near, near], axis=1)])
