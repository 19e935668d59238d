#!/usr/bin/env python3
"""Distances of non-convex meshes, compared with Coal's trees of triangles (BVHModelOBBRSS) on the same poses.

    bench/run.py surfaces [--poses 200] [--sizes 1000 10000 100000] [--csv FILE]

Two bumpy rings with this many triangles each, in poses that are apart (by about their size), near (their surfaces at
most 1 mm apart) and crossing; and a shelf of five compartments with 2000 convex hulls. One thread, processor time, the
least of five rounds. Clearance gets one batch of configurations, Coal one call per pose, with poses prepared in
advance. `least` queries the distance, `valid` whether they touch, which stops at the first contact. Also reported: the
greatest excess of Coal's distance over our bounds, and poses in which it reports bodies apart that are proved to
overlap.
"""

import numpy as np

from contenders import tree_of_triangles
from harness import parser, shown, timed, write
from surface_shapes import poses, ring, shelf


def place_of(coal, pose):
    """Coal's transform of a pose (7,): x y z, qw qx qy qz."""
    w, x, y, z = pose[3:]
    turn = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
    return coal.Transform3s(turn, np.array(pose[:3]))


def requests_of(coal):
    """Coal's (distance request, its result, collision request, its result), without depths and further contacts."""
    distance, collision = coal.DistanceRequest(), coal.CollisionRequest()
    distance.enable_signed_distance = False
    collision.num_max_contacts = 1
    collision.enable_contact = False
    return distance, coal.DistanceResult(), collision, coal.CollisionResult()


def outside(lower, upper, distances, counted):
    """Maximum excess of the counted distances over our bounds, in metres."""
    return np.maximum(lower - distances, distances - upper)[counted].max(initial=0)


class Coal:
    def __init__(self, a, b):
        import coal

        self.coal = coal
        self.a, self.b = (self._model(*body) for body in (a, b))

    def _model(self, vertices, faces):
        if faces is None:
            points = self.coal.StdVec_Vec3s()
            points.extend(list(vertices))
            return self.coal.Convex.convexHull(points, True, "Qt")
        return tree_of_triangles(self.coal, vertices, faces)

    def places(self, X):
        """Poses in Coal's format, prepared before timing."""
        return [place_of(self.coal, x) for x in X]

    def _each(self, places, call):
        still = self.coal.Transform3s()
        return np.array([call(still, place) for place in places])

    def least(self, places):
        request, result, _, _ = requests_of(self.coal)

        def distance(A, B):
            result.clear()
            return self.coal.distance(self.a, A, self.b, B, request, result)

        return self._each(places, distance)

    def valid(self, places):
        _, _, request, result = requests_of(self.coal)

        def collide(A, B):
            result.clear()
            return self.coal.collide(self.a, A, self.b, B, request, result) == 0

        return self._each(places, collide)


class Clearance:
    def __init__(self, a, b):
        import clearance

        scene = clearance.Scene()
        for name, (vertices, faces) in (("a", a), ("b", b)):
            if faces is None:
                scene.add_body(name, vertices, pose=[0, 0, 0, 1, 0, 0, 0])
            else:
                scene.add_body(name, mesh=(vertices, faces), mesh_as="solid", pose=[0, 0, 0, 1, 0, 0, 0])
        self.engine = clearance.Engine(scene, backend="cpu", threads=1)

    def evaluate(self, X, **more):
        return self.engine.distances(pairs=[("a", "b")], bodies=["b"], configurations=X[:, None], **more)

    def least(self, X):
        answer = self.evaluate(X)
        return answer.lower[:, 0], answer.upper[:, 0]

    def valid(self, X):
        return self.engine.check(bodies=["b"], configurations=X[:, None]).free


def least_of(call, X, rounds=5):
    """Microseconds per pose, the least of several rounds, and the results."""
    each = [timed(call, X) for _ in range(rounds)]
    return min(seconds for seconds, _ in each) / len(X) * 1e6, each[-1][1]


def near(us, X, gap):
    """The poses moved along the line to the origin until the bodies are about `gap` metres apart."""
    X = X.copy()
    for _ in range(30):
        lower, _ = us.least(X)
        X[:, :3] -= ((lower - gap) * 0.9)[:, None] * X[:, :3] / np.linalg.norm(X[:, :3], axis=1, keepdims=True)
    lower, upper = us.least(X)
    return X[(lower > 0) & (upper < 2 * gap)]


def row(name, us, coal, X):
    ours, (lower, upper) = least_of(us.least, X)
    places = coal.places(X)
    theirs, distance = least_of(coal.least, places)
    our_check, free = least_of(us.valid, X)
    their_check, their_free = least_of(coal.valid, places)
    off = outside(lower, upper, distance, lower > 0)
    return {"case": name, "poses": len(X), "us": round(ours, 1), "coal_us": round(theirs, 1),
            "ratio": round(theirs / ours, 2), "check_us": round(our_check, 1), "coal_check_us": round(their_check, 1),
            "check_ratio": round(their_check / our_check, 2), "wide": int(np.sum(upper - lower > 1e-5)),
            "coal_off_m": f"{off:.1e}", "coal_missed": int(np.sum(their_free & (upper <= 0))),
            "verdicts_differ": int(np.sum(their_free != free))}


def main():
    made = parser(__doc__)
    made.add_argument("--poses", type=int, default=200)
    made.add_argument("--sizes", type=int, nargs="+", default=[1000, 10000, 100000])
    options = made.parse_args()
    write(shown(measure(options.poses, options.sizes)), options.csv)


def measure(count, sizes):
    """A row for each case with this many poses."""
    for size in sizes:
        rng = np.random.default_rng(size)
        a, b = ring(size, 1, 0.3, rng), ring(size, 0.9, 0.25, rng)
        us, coal = Clearance(a, b), Coal(a, b)
        far = poses(count, 4, 0, rng)
        far = far[np.linalg.norm(far[:, :3], axis=1) > 2.6]
        yield row(f"rings of {size} triangles, apart", us, coal, far)
        yield row(f"rings of {size} triangles, 1 mm", us, coal, near(us, far[: count // 4], 5e-4))
        inside = poses(count, 0.6, 0, rng)
        inside = inside[us.least(inside)[1] <= 0]
        yield row(f"rings of {size} triangles, crossing", us, coal, inside)
    rng = np.random.default_rng(1)
    points = rng.normal(size=(60, 3))
    hull = (points / np.linalg.norm(points, axis=1, keepdims=True) * [0.05, 0.08, 0.15], None)
    board = shelf()
    us, coal = Clearance(board, hull), Coal(board, hull)
    yield row("a hull before a shelf", us, coal, poses(10 * count, [0.5, 0.7, 1.2], [0.3, 0.5, 1], rng))


if __name__ == "__main__":
    main()
