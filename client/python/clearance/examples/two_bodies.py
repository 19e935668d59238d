"""The distance of a box and a capsule: an interval that contains the exact one, and the nearest points."""

import clearance

from ._arm import Shown


def main() -> Shown:
    scene = clearance.Scene()
    scene.add_box("box", [0.2, 0.3, 0.4], static=True, pose=[0, 0, 0, 1, 0, 0, 0])  # x, y, z, qw, qx, qy, qz
    scene.add_capsule("capsule", radius=0.05, length=0.3)
    engine = clearance.Engine(scene)
    engine.set_poses({"capsule": [0.5, 0.1, 0.1, 0.9239, 0, 0.3827, 0]})
    r = engine.distances(pairs=("box", "capsule"))
    print(f"{r.lower[0, 0]:.9f} to {r.upper[0, 0]:.9f} m, {clearance.Status(r.status[0, 0]).name}")
    print("nearest points", r.point_a[0, 0].round(4), "and", r.point_b[0, 0].round(4))
    return scene, engine, [[r.point_a[0, 0], r.point_b[0, 0]]]
