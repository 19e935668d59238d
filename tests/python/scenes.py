"""Scenes and an independent oracle for the tests."""

from fractions import Fraction

import numpy as np

import clearance

IDENTITY = [0, 0, 0, 1, 0, 0, 0]


def at(x, y=0.0, z=0.0, q=(1, 0, 0, 0)):
    return [x, y, z, *q]


def box_vertices(x, y, z):
    return np.array([[i, j, k] for i in (-x, x) for j in (-y, y) for k in (-z, z)]) / 2


def arm():
    """base (static), link1, link2, cup on link2, table (static): every kind of relation of a pair."""
    scene = clearance.Scene()
    scene.add_box("base", [0.4, 0.4, 0.2], static=True, pose=IDENTITY)
    scene.add_hull("link1", box_vertices(0.1, 0.1, 0.5))
    scene.add_capsule("link2", 0.05, 0.4)
    scene.add_sphere("cup", 0.04, parent="link2", pose=at(0, 0, 0.3))
    scene.add_box("table", [2, 2, 0.1], static=True, pose=at(0, 0, -0.5))
    scene.add_group("arm", ["link1", "link2", "cup"])
    scene.ignore("base", "link1")
    return scene


ARM_POSES = {"link1": at(0, 0, 0.4), "link2": at(0.3, 0, 0.9, np.array([9, 1, 4, 1]) / 99**0.5)}
#: Enabled pairs: not base-table (static), link2-cup (parent and child), base-link1 (ignored).
ARM_PAIRS = [[0, 2], [0, 3], [1, 2], [1, 3], [1, 4], [2, 4], [3, 4]]


def random_hulls(count, seed, vertices=12, spread=3.0):
    """Random polytopes at random poses."""
    rng = np.random.default_rng(seed)
    scene = clearance.Scene()
    for i in range(count):
        scene.add_hull(f"body{i}", rng.normal(size=(vertices, 3)) * 0.3, radius=0.05 if i % 3 == 0 else 0.0)
    poses = random_poses(rng, count, spread)
    return scene, poses


def random_poses(rng, count, spread):
    q = rng.normal(size=(count, 4))
    return np.concatenate(
        [rng.uniform(-spread, spread, (count, 3)), q / np.linalg.norm(q, axis=1, keepdims=True)], axis=1
    )


def rotation(pose):
    w, x, y, z = np.asarray(pose[3:7]) / np.linalg.norm(pose[3:7])
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


def placed(vertices, pose):
    return vertices @ rotation(pose).T + np.asarray(pose[:3])


def least_norm(points):
    """Bounds (lo, hi) of the distance of the hull of (V, 3) points from the origin, by Wolfe's algorithm (1976).

    Independent of the engine: instead of simplices of a Minkowski difference found by support functions, it uses an
    active set of all its vertices with a least-squares step. hi is the norm of a point of the hull, lo the gap along
    its direction.
    """
    active = [int(np.argmin((points**2).sum(axis=1)))]
    weights = np.array([1.0])
    for _ in range(500):
        x = weights @ points[active]
        slack = points @ x
        j = int(slack.argmin())
        if x @ x - slack[j] <= 1e-13 * (x @ x) or j in active or x @ x < 1e-24:
            break
        active.append(j)
        weights = np.append(weights, 0.0)
        while True:
            chosen = points[active]
            system = np.block([[np.zeros((1, 1)), np.ones((1, len(active)))],
                               [np.ones((len(active), 1)), chosen @ chosen.T]])  # fmt: skip
            affine = np.linalg.lstsq(system, np.array([1.0] + [0.0] * len(active)), rcond=None)[0][1:]
            if (affine > 1e-14).all():
                weights = affine
                break
            shrinking = affine <= 1e-14
            t = min(1.0, (weights[shrinking] / (weights[shrinking] - affine[shrinking])).min())
            weights = weights + t * (affine - weights)
            keep = weights > 1e-14
            if keep.all():
                keep[weights.argmin()] = False
            active = [a for a, k in zip(active, keep) if k]
            weights = weights[keep] / weights[keep].sum()
    x = weights @ points[active]
    hi = float(np.linalg.norm(x))
    lo = float((points @ x).min() / hi) if hi > 0 else 0.0
    return lo, hi


def hull_distance(a, radius_a, b, radius_b):
    """Bounds of the distance of two placed hulls, from all differences of their vertices."""
    lo, hi = least_norm((b[None, :, :] - a[:, None, :]).reshape(-1, 3))
    return lo - radius_a - radius_b, hi - radius_a - radius_b


def sphere_gap_bounds_hold(lower, upper, centre_a, radius_a, centre_b, radius_b):
    """Returns whether lower <= |c_b - c_a| - r_a - r_b <= upper, in exact rational arithmetic."""
    squared = sum((Fraction(float(p)) - Fraction(float(q))) ** 2 for p, q in zip(centre_b, centre_a))
    radii = Fraction(float(radius_a)) + Fraction(float(radius_b))
    low, high = Fraction(float(lower)) + radii, Fraction(float(upper)) + radii
    return (low <= 0 or low**2 <= squared) and high >= 0 and high**2 >= squared


def same(a, b, fields=None):
    """Bit for bit, including NaN."""
    names = set(a.columns) & set(b.columns) if fields is None else fields
    assert names
    return all(a.columns[name].tobytes() == b.columns[name].tobytes() for name in names)


def same_bits(a, b):
    assert set(a.columns) == set(b.columns)
    assert a.scene_revision == b.scene_revision
    for name, column in a.columns.items():
        other = b.columns[name]
        assert column.dtype == other.dtype and column.shape == other.shape, name
        assert column.tobytes() == other.tobytes(), name
    assert np.array_equal(a.pairs, b.pairs)
    return True
