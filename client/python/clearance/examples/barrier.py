"""A control barrier: joint speeds are reduced where a pair would come nearer than 5 cm too fast."""

import numpy as np

import clearance

from ._arm import Shown, arm_scene


def main() -> Shown:
    scene = arm_scene()
    engine = clearance.Engine(scene)
    near = engine.prepare(joints="arm", reduce="within", max_distance=0.4, fields=["lower", "gradient_joints", "pair"])
    q, wanted, step, least = np.array([0.0, 0.0, 0.3]), np.array([0.8, 0.0, 0.0]), 0.01, 0.4
    for _ in range(300):
        r, speed = near.run([q]), wanted.copy()
        for lower, slope in zip(r.lower, r.gradient_joints):
            excess = -slope @ speed - 5.0 * (lower - 0.05)  # d' >= -5 (d - 0.05) along the slope of the distance
            if excess > 0 and slope @ slope > 0:
                speed += slope * excess / (slope @ slope)
        q, least = q + step * speed, min([least, *r.lower])
    print(f"wanted to turn by {0.8 * 3:.1f} rad, turned by {q[0]:.3f}; never nearer than {1e3 * least:.1f} mm")
    engine.set_joints(q, joints="arm")
    return scene, engine, []
