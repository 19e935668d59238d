"""A cup that the hand has grasped: it moves with the arm, may touch the hand, and counts against the rest."""

import clearance

from ._arm import Shown, arm_scene


def main() -> Shown:
    scene = arm_scene()
    scene.add_cylinder("cup", radius=0.04, length=0.12)
    engine = clearance.Engine(scene)
    before, after = [0.0, 0.35, 0.2], [0.45, 0.35, 0.2]
    engine.set_joints(before, joints="arm")
    engine.attach("cup", "arm/hand", pose=[0.42, 0, 0, 1, 0, 0, 0], allow=["arm/hand"])
    for q in (before, after):
        check = engine.check([q], joints="arm", margin=0.01)
        why = "" if check.free[0] else " and ".join(engine.bodies[i].name for i in check.pair[0])
        print(f"turn {q[0]:.2f}: free {check.free[0]} {why}")
    engine.set_joints(after, joints="arm")
    r = engine.distances(pairs=("cup", "*"), reduce="min", fields=["lower", "pair", "points"])
    print(f"the cup: {r.lower[0]:.4f} m to", *(engine.bodies[i].name for i in r.pairs[0]))
    return scene, engine, [[r.point_a[0], r.point_b[0]]]
