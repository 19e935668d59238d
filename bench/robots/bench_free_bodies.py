#!/usr/bin/env python3
"""Free bodies: is a box that moves straight and rotates free throughout? Clearance and FCL's continuous collision.

    bench/run.py free_bodies [--motions 1000] [--csv FILE]

A box passes, or penetrates, a block or a plate of 0.1 mm. FCL is called through its package python-fcl, one motion per
call, with the motion type of the same motion (linear): by conservative advancement, of its shapes and of the same boxes
as meshes, and by 100 samples (`naive`). Clearance gets all motions in one batch. One thread, processor time.

A result is wrong if it is free although the bodies overlap at the time that Clearance reports, according to FCL's own
distance of static bodies; or if it is a hit although Clearance proves more than 0.1 mm throughout, which FCL's distance
at 400 times does not contradict. Clearance's result is wrong if FCL's static distances contradict it at one of these
times. Exit code 1 if one is.
"""

import importlib
import sys
from typing import Any

import numpy as np

import clearance
from clearance import Status
from harness import parser, shown, timed, write

fcl: Any = importlib.import_module("fcl")  # bench/peers has a folder of that name, which type checkers find

LINEAR, NAIVE, ADVANCEMENT = 1, 0, 1  # of FCL: motion type, solvers
TIMES = 400
NEAR = 1e-4  # metres: accepted error of FCL's hits
CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
FACES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4]]
    + [[1, 5, 7], [1, 7, 3]]
)


def random_poses(rng, count):
    """(K, 7) starts and ends on opposite sides of the origin, less than half a turn apart."""
    start, end = rng.normal(size=(count, 7)), rng.normal(size=(count, 7))
    side = rng.normal(size=(count, 3))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    beside = rng.uniform(-0.35, 0.35, (count, 3))
    start[:, :3], end[:, :3] = side * 0.8 + beside, -side * 0.8 + beside + rng.uniform(-0.2, 0.2, (count, 3))
    for poses in (start, end):
        poses[:, 3:] /= np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
    flip = (start[:, 3:] * end[:, 3:]).sum(axis=1) < 0
    end[flip, 3:] *= -1
    return start, end


def at(start, end, t):
    """(K, 7) poses of the motion at time t: slerp."""
    cosine = np.clip((start[:, 3:] * end[:, 3:]).sum(axis=1, keepdims=True), -1, 1)
    angle = np.arccos(cosine)
    sine = np.where(angle < 1e-9, 1, np.sin(angle))
    first, last = np.where(angle < 1e-9, 1 - t, np.sin((1 - t) * angle) / sine), np.sin(t * angle) / sine
    return np.hstack([start[:, :3] + t * (end[:, :3] - start[:, :3]), first * start[:, 3:] + last * end[:, 3:]])


def transform(pose):
    return fcl.Transform(pose[3:], pose[:3])


def box(sizes, as_mesh):
    if not as_mesh:
        return fcl.Box(*sizes)
    model = fcl.BVHModel()
    model.beginModel(8, 12)
    model.addSubModel(CORNERS * sizes, FACES)
    model.endModel()
    return model


def fcl_hits(sizes, other, start, end, solver, as_mesh):
    """Seconds, and (K,) whether each motion hits."""
    body, still = (fcl.CollisionObject(box(s, as_mesh), fcl.Transform()) for s in (sizes, other))
    request = fcl.ContinuousCollisionRequest(
        num_max_iterations=100, toc_err=1e-4, ccd_motion_type=LINEAR, ccd_solver_type=solver
    )
    ends, stands, hits = [transform(pose) for pose in end], fcl.Transform(), []
    starts = [transform(pose) for pose in start]

    def collide():
        for first, last in zip(starts, ends):
            body.setTransform(first)
            result = fcl.ContinuousCollisionResult()
            fcl.continuousCollide(body, last, still, stands, request, result)
            hits.append(result.is_collide)

    return timed(collide)[0], np.array(hits)


def standing(sizes, other, poses):
    """(K,) FCL's distances of static bodies."""
    body, still = (fcl.CollisionObject(fcl.Box(*s), fcl.Transform()) for s in (sizes, other))
    found = []
    for pose in poses:
        body.setTransform(transform(pose))
        found.append(fcl.distance(body, still, fcl.DistanceRequest(), fcl.DistanceResult()))
    return np.array(found)


def measure(name, other, count, rng):
    sizes = np.array([0.2, 0.15, 0.1])
    start, end = random_poses(rng, count)
    scene = clearance.Scene()
    scene.add_box("body", list(sizes), pose=[0, 0, 0, 1, 0, 0, 0])
    scene.add_box("still", list(other), static=True, pose=[0, 0, 0, 1, 0, 0, 0])
    engine = clearance.Engine(scene, backend="cpu", threads=1)
    ends = start[:, None], end[:, None]
    engine.motions(start[:2, None], end[:2, None], bodies=["body"], reduce="any")
    proof = {"reduce": "any", "rel_tol": 1e-6, "abs_tol": 0.0, "fields": ("status", "time")}
    seconds, any_ = timed(engine.motions, *ends, bodies=["body"], **proof)
    least = engine.motions(*ends, bodies=["body"], abs_tol=1e-5, max_evaluations=4096, fields=("lower", "status"))
    free = any_.status == Status.BEYOND
    hit = any_.status <= Status.CONTACT
    clear = free & (least.lower > NEAR)
    seen = np.min([standing(sizes, other, at(start, end, t)) for t in np.linspace(0, 1, TIMES)], axis=0)
    there = at(start, end, np.nan_to_num(any_.time)[:, None])
    touches = standing(sizes, other, there) <= 1e-9
    rows = [
        {
            "still": name, "system": "Clearance", "motions": count, "free": int(free.sum()), "hits": int(hit.sum()),
            "undecided": int((~free & ~hit).sum()), "us_a_motion": f"{1e6 * seconds / count:.3g}",
            "wrong_free": int((free & (seen <= 0)).sum()), "wrong_hit": int((hit & ~touches).sum()),
        }
    ]  # fmt: skip
    ways = (("conservative advancement", ADVANCEMENT, False), ("the same, meshes", ADVANCEMENT, True))
    for way, solver, as_mesh in (*ways, ("naive", NAIVE, False)):
        seconds, hits = fcl_hits(sizes, other, start, end, solver, as_mesh)
        rows.append(
            {
                "still": name, "system": f"FCL, {way}", "motions": count, "free": int((~hits).sum()),
                "hits": int(hits.sum()), "undecided": 0, "us_a_motion": f"{1e6 * seconds / count:.3g}",
                "wrong_free": int((~hits & hit & touches).sum()),
                "wrong_hit": int((hits & clear & (seen > NEAR)).sum()),
            }
        )  # fmt: skip
    return rows


def main():
    made = parser(__doc__, seed=1)
    made.add_argument("--motions", type=int, default=1000)
    options = made.parse_args()
    rng = np.random.default_rng(options.seed)
    rows = measure("block", np.array([0.3, 0.2, 0.25]), options.motions, rng)
    rows += measure("plate", np.array([0.6, 0.6, 1e-4]), options.motions, rng)
    write(shown(rows), options.csv)
    return 1 if any(row["wrong_free"] + row["wrong_hit"] for row in rows if row["system"] == "Clearance") else 0


if __name__ == "__main__":
    sys.exit(main())
