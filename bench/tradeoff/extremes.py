"""Numerical extremes: needles, coordinates of maps, gaps of 1e-12 m. An independent checker checks each interval."""

import itertools
import statistics

import numpy as np

import check_certificate
import clearance
from clearance import Status
from harness import timed
from surface_shapes import block

PAIRS = 20  # of each kind
SETTINGS = {"exact": {"rel_tol": 1e-12, "abs_tol": 0.0}, "1e-06": {"rel_tol": 0.0, "abs_tol": 1e-6},
            "0.001": {"rel_tol": 0.0, "abs_tol": 1e-3}}  # fmt: skip
MAP = 4e6  # metres: about the greatest northing of a map's zone that is not near the equator or a pole

# By name: size of the two bodies along x, y and z; the gap along z; their distance from the origin; mesh or hull.
KINDS = {
    "boxes 1 m wide, 1 mm apart": ((1, 1, 1), 1e-3, 0.0, "hull"),
    "the same, as solids": ((1, 1, 1), 1e-3, 0.0, "solid"),
    "the same, 4,000 km from the origin": ((1, 1, 1), 1e-3, MAP, "hull"),
    "solids 4,000 km from the origin": ((1, 1, 1), 1e-3, MAP, "solid"),
    "needles 1 m long, 1 um thick, crossing 1 mm apart": ((1, 1e-6, 1e-6), 1e-3, 0.0, "hull"),
    "needles as solids": ((1, 1e-6, 1e-6), 1e-3, 0.0, "solid"),
    "plates 1 nm thick, 1 mm apart": ((1, 1, 1e-9), 1e-3, 0.0, "hull"),
    "boxes 1e-12 m apart": ((1, 1, 1), 1e-12, 0.0, "hull"),
    "solids 1e-12 m apart": ((1, 1, 1), 1e-12, 0.0, "solid"),
    "boxes that touch": ((1, 1, 1), 0.0, 0.0, "hull"),
    "boxes 1 um wide, 1 nm apart": ((1e-6, 1e-6, 1e-6), 1e-9, 0.0, "hull"),
}


def unit(v):
    return v / np.linalg.norm(v)


def engine_of(size, gap, away, mesh_as, rng):
    """Pairs of boxes, one above the other: parallel faces are `gap` apart, up to rounding. Rotations are random."""
    scene = clearance.Scene()
    half = 0.5 * np.array(size)
    vertices, triangles = block(-half, half)
    for i in range(PAIRS):
        w, x, y, z = q = unit(rng.normal(size=4))
        normal = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
        c, s = unit(rng.normal(size=2))
        turned = [w * c - z * s, x * c + y * s, y * c - x * s, z * c + w * s]  # about the normal
        at = away * unit(rng.normal(size=3))
        for name, pose in ((f"a{i}", [*at, *q]), (f"b{i}", [*(at + (size[2] + gap) * normal), *turned])):
            scene.add_body(name, mesh=(vertices, triangles), mesh_as=mesh_as, pose=pose)
    return clearance.Engine(scene, backend="cpu", threads=1)


def rows(options):
    """A row for each kind and setting."""
    for (name, kind), (setting, tolerance) in itertools.product(KINDS.items(), SETTINGS.items()):
        engine = engine_of(*kind, np.random.default_rng([len(name), options.seed]))
        pairs = [(f"a{i}", f"b{i}") for i in range(PAIRS)]
        query = engine.prepare(pairs=pairs, fields=("lower", "upper", "status"), **tolerance)
        answer = query.run()
        seconds = [timed(query.run)[0] for _ in range(4 * options.rounds)]
        document = engine.certificate(pairs=pairs, **tolerance).document
        proved = sum(is_proved for is_proved, _ in check_certificate.verdicts(document))
        width, upper, status = (column.ravel() for column in (answer.upper - answer.lower, answer.upper, answer.status))
        requested = np.maximum(tolerance["abs_tol"], tolerance["rel_tol"] * upper)
        is_open = (status == Status.UNCONVERGED) | (status == Status.CONTACT)
        yield {
            "case": name,
            "setting": setting,
            "pairs": PAIRS,
            "us": f"{1e6 * statistics.median(seconds) / PAIRS:.3g}",
            "distance_m": f"{np.median(upper):.3g}",
            "width_m": f"{np.median(width):.2g}",
            "width_most_m": f"{width.max():.2g}",
            "overlap": int((status == Status.OVERLAP).sum()),
            "unresolved": int(is_open.sum()),
            "wrong": PAIRS - proved,
            "wider": int((~is_open & (width > requested * (1 + 1e-9) + 1e-12)).sum()),
        }
