"""Whether a state of an arm is free, and which pairs of bodies are nearest."""

import clearance

from ._arm import Shown, arm_scene


def main() -> Shown:
    scene = arm_scene()
    engine = clearance.Engine(scene)
    q = [0.25, -0.3, 0.9]  # turn, lift, bend: radians
    check = engine.check([q], joints="arm", margin=0.02)
    print("free, with 2 cm to spare:", check.free[0])
    engine.set_joints(q, joints="arm")
    r = engine.distances(reduce="within", max_distance=0.4, fields=["lower", "pair", "points"])
    for row in r.lower.argsort():
        a, b = (engine.bodies[i].name for i in r.pairs[row])
        print(f"{r.lower[row]:.4f} m  {a} - {b}")
    nearest = int(r.lower.argmin())
    return scene, engine, [[r.point_a[nearest], r.point_b[nearest]]]
