# mypy: ignore-errors
"""States a second of csdecomp's CUDA check and Clearance's, in one run: `bench_csdecomp.py RESOURCES [--csv FILE]`.

RESOURCES is the folder of MotionBenchMaker's robots (bench/robots/problems.py fetches it). A Panda in random states
among twelve boxes; pairs of the robot with itself are left out. csdecomp checks the 59 spheres of the spherized robot
in float32. Clearance proves the same spheres, and the hulls of the links. All arrays are in host memory; each row is a
median. The last two columns count states of the spheres that csdecomp calls free although they are in contact, and
that it calls a hit although all are proved farther apart than 10 um.

Needs `pip install csdecomp` (MIT).
"""

import argparse
import functools
import re
import time
from importlib.metadata import version
from pathlib import Path

import csdecomp
import numpy as np

import clearance

BOXES = 12
LINKS = [*(f"link{i}" for i in range(1, 8)), "hand", "leftfinger", "rightfinger"]
COUNTS = (4_096, 65_536, 1_048_576)
ROUNDING = 1e-5  # metres


def boxes_of(rng):
    """(full lengths (3,), centre (3,)) of each box, in metres, clear of the robot's base."""
    found = []
    while len(found) < BOXES:
        sizes, centre = rng.uniform(0.05, 0.4, 3), rng.uniform([-0.9, -0.9, 0.1], [0.9, 0.9, 1.1])
        if np.hypot(*centre[:2]) - np.hypot(*sizes[:2]) / 2 > 0.2:
            found.append((sizes, centre))
    return found


def plant_of(spheres, boxes):
    """csdecomp's model of the robot and the boxes, and the positions' limits (7,) in radians."""
    text = re.sub(r"<(visual|inertial)>.*?</\1>", "", spheres.read_text(), flags=re.DOTALL)
    parts = ['<joint name="base" type="fixed"><parent link="world"/><child link="panda_link0"/></joint>']
    for k, (sizes, centre) in enumerate(boxes):
        size, at = (" ".join(repr(float(x)) for x in values) for values in (sizes, centre))
        parts.append(f'<link name="box{k}"><collision><geometry><box size="{size}"/></geometry></collision></link>')
        parts.append(
            f'<joint name="box{k}_base" type="fixed"><parent link="world"/><child link="box{k}"/>'
            f'<origin xyz="{at}" rpy="0 0 0"/></joint>'
        )
    parser = csdecomp.URDFParser()
    if not parser.parse_urdf_string(text.replace("</robot>", "".join(parts) + "</robot>")):
        raise ValueError(f"csdecomp cannot read {spheres}")
    plant = parser.build_plant()
    names = plant.getSceneCollisionGeometryNames()
    boxed = [name.startswith("box") for name in names]
    moving = [not (box or name.startswith("panda_link0::")) for box, name in zip(boxed, names)]
    pairs = np.array([(i, j) for i in np.flatnonzero(moving) for j in np.flatnonzero(boxed)], np.int32)
    minimal = plant.getMinimalPlant()
    minimal.set_collision_pairs_from_matrix(np.asfortranarray(pairs.T))
    return minimal, plant.getPositionLowerLimits().ravel(), plant.getPositionUpperLimits().ravel()


def clearance_of(urdf, boxes, backend):
    """A call with .verdict (K,) of positions (K, 7), and its engine, pairs (of links and boxes) and joints."""
    scene, folder = clearance.Scene(), urdf.parent
    scene.add_robot("panda", urdf=urdf, packages={"panda": folder, "meshes": folder / "meshes"}, static=True)
    for k, (sizes, centre) in enumerate(boxes):
        scene.add_box(f"box{k}", sizes, pose=[*centre, 1, 0, 0, 0], static=True)
    links = [body.name for body in scene.bodies if body.name in {f"panda/panda_{link}" for link in LINKS}]
    pairs = [(link, f"box{k}") for link in links for k in range(BOXES)]
    engine = clearance.Engine(scene, backend=backend)
    engine.wait_covers()
    joints = [f"panda/panda_joint{i}" for i in range(1, 8)]
    return functools.partial(engine.distances, pairs=pairs, joints=joints, reduce="any", fields="verdict"), (
        engine,
        pairs,
        joints,
    )


def timed(evaluate, seconds=1.0):
    """The median in seconds of consecutive calls, and the last call's result."""
    result = evaluate()
    took, end = [], time.perf_counter() + seconds
    while time.perf_counter() < end or len(took) < 3:
        begin = time.perf_counter()
        result = evaluate()
        took.append(time.perf_counter() - begin)
    return float(np.median(took)), result


def differences(engine, pairs, joints, q, free):
    """States that csdecomp calls free and are in contact, and that it calls a hit and are farther than ROUNDING."""
    r = engine.distances(pairs=pairs, configurations=q, joints=joints, reduce="min", fields=("lower", "upper"))
    return int((free & (r.upper <= 0)).sum()), int((~free & (r.lower > ROUNDING)).sum())


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("resources", type=Path)
    parser.add_argument("--backend", default="cuda")
    parser.add_argument("--csv", type=Path)
    options = parser.parse_args()
    rng, folder = np.random.default_rng(48), options.resources / "panda"
    boxes = boxes_of(rng)
    plant, lowest, highest = plant_of(folder / "panda_spherized.urdf", boxes)
    spheres, exact = clearance_of(folder / "panda_spherized.urdf", boxes, options.backend)
    hulls, _ = clearance_of(folder / "panda_meshes.urdf", boxes, options.backend)
    rows = []
    for count in COUNTS:
        q = rng.uniform(lowest, highest, (count, 7)).astype(np.float32)
        columns, positions = np.asfortranarray(q.T), q.astype(np.float64)
        check = functools.partial(csdecomp.CheckCollisionFreeCuda, columns, plant)
        before, found = timed(check)
        free = np.array(found, bool)
        wrong = differences(*exact, positions[:65_536], free[:65_536])
        ours, r = timed(functools.partial(spheres, configurations=positions))
        true, t = timed(functools.partial(hulls, configurations=positions))
        after, _ = timed(check)
        for what, took, share, differ in (
            (f"csdecomp {version('csdecomp')}, 59 spheres", before, free.mean(), wrong),
            ("Clearance, the same spheres", ours, np.mean(r.verdict == clearance.Status.BEYOND), ("", "")),
            ("Clearance, hulls of the links", true, np.mean(t.verdict == clearance.Status.BEYOND), ("", "")),
            (f"csdecomp {version('csdecomp')}, 59 spheres, again", after, free.mean(), wrong),
        ):
            rows.append([f'"{what}"', count, f"{1e6 * took:.4g}", f"{count / took / 1e6:.3g}", f"{share:.4f}", *differ])
            print(*rows[-1], sep="  ")
    if options.csv:
        with open(options.csv, "a") as f:
            f.writelines(",".join(map(str, row)) + "\n" for row in rows)


if __name__ == "__main__":
    main()
