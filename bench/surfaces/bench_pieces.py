#!/usr/bin/env python3
"""Solids by their triangles alone, with convex parts as accelerators, and by the parts alone (`model="pieces"`).

    bench/run.py pieces [--poses 500] [--csv FILE]

A shelf of nine boards and a hull, and two bumpy rings of 1000 triangles each, cut into 24 sectors. Their convex parts
are the boards, and the hulls of the sectors. One thread, processor time, one batch of configurations, the best of three
rounds in which all alternate. `least` queries the distance, `near` the distance up to a cut-off, `check` whether a pose
is proved free. Also reported: how much wider the intervals of the parts are, and the poses that each proves free.
"""

import os
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

import harness
from harness import parser, shown, timed
from surface_shapes import block, poses, ring, shelf

os.environ.setdefault("CLEARANCE_CACHE", "off")
import clearance

CUT_OFF = 0.05  # metres
ROUNDS = 3


def obj_text(vertices, faces, before=0):
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    return lines + [f"f {a} {b} {c}" for a, b, c in (faces + 1 + before).tolist()]


def write(path, mesh, pieces):
    """Writes the mesh, and next to it the parts: any triangles that reference their vertices."""
    path.write_text("\n".join(obj_text(*mesh)) + "\n")
    lines, before = [], 0
    for i, vertices in enumerate(pieces):
        at = np.arange(len(vertices) - 2)
        lines += [f"o piece{i}", *obj_text(vertices, np.stack([0 * at, at + 1, at + 2], -1), before)]
        before += len(vertices)
    Path(f"{path}.pieces.obj").write_text("\n".join(lines) + "\n")


def boards():
    all_ = [((0, 0, 0), (0.02, 1, 2)), ((0, 0, 0), (0.4, 0.02, 2)), ((0, 0.98, 0), (0.4, 1, 2))]
    all_ += [((0, 0, z), (0.4, 1, z + 0.02)) for z in np.linspace(0, 1.98, 6)]
    return [block(*board)[0] for board in all_]


def sectors(mesh, count):
    """The vertices of the triangles of each sector."""
    vertices, faces = mesh
    middle = vertices[faces].mean(1)
    of = np.floor((np.arctan2(middle[:, 1], middle[:, 0]) / (2 * np.pi) % 1) * count)
    return [vertices[np.unique(faces[of == i])] for i in range(count)]


def engines(folder, a, b):
    """Triangles alone, and decomposed. b: a hull's vertices, or a mesh and its parts."""
    found = []
    for how in ("solid", "decompose"):
        scene = clearance.Scene()
        for name, body in (("a", a), ("b", b)):
            if isinstance(body, tuple):
                path = folder / f"{name}.obj"
                write(path, *body)
                scene.add_mesh(name, path, mesh_as=how, pose=[0, 0, 0, 1, 0, 0, 0])
            else:
                scene.add_hull(name, body, pose=[0, 0, 0, 1, 0, 0, 0])
        found.append(clearance.Engine(scene, backend="cpu", threads=1))
    return found


def row(case, question, both, X, **more):
    """All three alternate; the best of each counts."""
    solid, decomposed = both
    ways = {"triangles": (solid, "truth"), "pieces_first": (decomposed, "truth"), "pieces": (decomposed, "pieces")}
    best, answers = dict.fromkeys(ways, np.inf), {}
    for _ in range(ROUNDS):
        for way, (engine, model) in ways.items():
            query = engine.prepare("distances", pairs=[("a", "b")], bodies=["b"], model=model, **more)
            took, answers[way] = timed(query.run, X[:, None])
            best[way] = min(best[way], took / len(X) * 1e6)
    truth, pieces = answers["triangles"], answers["pieces"]
    beyond = int(clearance.Status.BEYOND)
    compared: dict[str, Any]
    if question == "check":
        compared = {"free": int((truth.status == beyond).sum()), "free_pieces": int((pieces.status == beyond).sum())}
    else:
        both_narrow = (pieces.status != beyond) & (truth.status != beyond)
        wider = (pieces.upper - pieces.lower)[both_narrow] - (truth.upper - truth.lower)[both_narrow]
        assert (pieces.lower <= truth.upper).all() and (truth.lower <= pieces.upper).all(), "they contradict each other"
        compared = {"wider_m": f"{np.median(wider):.1e}" if len(wider) else ""}
    times = {f"{way}_us": round(took, 2) for way, took in best.items()}
    return {"case": case, "question": question, "poses": len(X), **times,
            "ratio": round(best["triangles"] / best["pieces"], 2),
            "ratio_first": round(best["pieces_first"] / best["pieces"], 2), **compared}


def cases(count):
    rng = np.random.default_rng(1)
    points = rng.normal(size=(60, 3))
    hull = points / np.linalg.norm(points, axis=1, keepdims=True) * [0.05, 0.08, 0.15]
    yield "a hull before a shelf", (shelf(), boards()), hull, poses(count, [0.5, 0.7, 1.2], [0.3, 0.5, 1], rng)
    rings = [ring(1000, radius, tube, rng) for radius, tube in ((1, 0.3), (0.9, 0.25))]
    both = [(mesh, sectors(mesh, 24)) for mesh in rings]
    far = poses(count, 4, 0, rng)
    yield "two rings, apart", *both, far[np.linalg.norm(far[:, :3], axis=1) > 2.6]
    yield "two rings, within each other's balls", *both, poses(count, 1.2, 0, rng)


def main():
    made = parser(__doc__)
    made.add_argument("--poses", type=int, default=500)
    options = made.parse_args()
    harness.write(shown(measure(options.poses)), options.csv)


def measure(count):
    """A row for each case with this many poses."""
    for case, a, b, X in cases(count):
        with tempfile.TemporaryDirectory() as folder:
            both = engines(Path(folder), a, b)
        for question, more in (("least", {}), ("near", {"max_distance": CUT_OFF}), ("check", {"reduce": "any"})):
            yield row(case, question, both, X, **more)


if __name__ == "__main__":
    main()
