#!/usr/bin/env python3
"""A cloud and a robot, compared with Coal's octree (OcTree) of the same voxels in the same states.

    bench/run.py clouds [--points 100000] [--states 100] [--csv FILE]

The arm of scenes/cell is surrounded by a cloud as from a depth camera: walls, a floor, boxes and noise, no point within
25 cm of its base. Each state is queried for the links' least distance to the cloud (`min`), and for whether all links
are free (`any`, Coal: collide() of each link until the first contact). One thread, processor time. Clearance gets one
batch of states; Coal one call per link, in the order of the links and, for `min`, with no bound but the octree's own.
Both have voxels of the same edge, Clearance also points. Also reported: the greatest excess of Coal's least distance
over our bounds, and the time to replace the cloud: set_points() for Clearance, makeOctree() for Coal.
"""

import numpy as np

import clearance
from bench_surfaces import outside, place_of, requests_of
from harness import ROOT, parser, shown, timed, write

EDGE = 0.02  # metres
SCENE = """
robots:
  - {name: arm, urdf: %s, base: [0, 0, 0.75, 1, 0, 0, 0], static: true, home: {elbow: 1.3}}
bodies:
  - {name: points, points: [], static: true}
  - {name: voxels, points: [], voxel: %g, static: true}
"""


def room(count, rng):
    """(N, 3) float32: a camera's view of a volume of about 3 m with an arm in its middle."""
    walls = []
    for axis, at in ((0, -1.4), (0, 1.6), (1, -1.5), (1, 1.5), (2, 0.0), (2, 2.2)):
        wall = rng.uniform([-1.4, -1.5, 0], [1.6, 1.5, 2.2], (count // 10, 3))
        wall[:, axis] = at
        walls.append(wall)
    for _ in range(40):  # boxes
        centre, half = rng.uniform([-1.2, -1.3, 0.1], [1.4, 1.3, 2.0]), rng.uniform(0.05, 0.2, 3)
        face = rng.uniform(-1, 1, (count // 100, 3))
        face[np.arange(len(face)), rng.integers(0, 3, len(face))] = rng.choice([-1, 1], len(face))
        walls.append(centre + face * half)
    cloud = np.concatenate(walls)
    return (cloud + rng.normal(size=cloud.shape) * 0.002).astype(np.float32)


def on_grid(cloud):
    """The centres of the voxels that contain points: those of an octree of this resolution."""
    keys = np.unique(np.floor(cloud / EDGE).astype(np.int64), axis=0)
    return ((keys + 0.5) * EDGE).astype(np.float32)


class Clearance:
    def __init__(self, folder):
        self.scene = clearance.Scene.load(folder / "scene.yaml", allow_outside=True)
        self.engine = clearance.Engine(self.scene, backend="cpu", threads=1)
        self.engine.wait_covers()

    def least(self, body, states):
        answer = self.engine.distances(pairs=[("arm", body)], joints="arm", configurations=states, reduce="min")
        return answer.lower, answer.upper

    def free(self, body, states):
        return self.engine.check(pairs=[("arm", body)], joints="arm", configurations=states).free


class Coal:
    """Links as hulls, balls and capsules, placed by the engine's own poses."""

    def __init__(self, us, states):
        import coal

        self.coal = coal
        links = [body for body in us.scene.bodies if body.name.startswith("arm/") and body.piece_count]
        self.links = []
        for body in links:
            self.links += [(body.id, *self._model(*piece)) for piece in us.scene.pieces(body.id)]
        self.places = []
        for state in states:
            us.engine.set_joints(state, joints="arm")
            at = us.engine.body_states()
            self.places.append([place_of(coal, at[body].pose) * own for body, _, own in self.links])
        self.still = place_of(coal, [0, 0, 0, 1, 0, 0, 0])

    def _model(self, vertices, radius):
        """A convex part of Clearance as a ball, a capsule or a hull, with its place in its link."""
        if len(vertices) == 1:
            return self.coal.Sphere(radius), self.coal.Transform3s(np.eye(3), vertices[0])
        if len(vertices) == 2:
            along = vertices[1] - vertices[0]
            turn = np.linalg.qr(np.column_stack([along, [1, 0.3, 0.2], [0.1, 1, 0.3]]))[0][:, [1, 2, 0]]
            turn[:, 2] = along / np.linalg.norm(along)
            turn[:, 0] *= np.sign(np.linalg.det(turn))
            place = self.coal.Transform3s(turn, (vertices[0] + vertices[1]) / 2)
            return self.coal.Capsule(radius, np.linalg.norm(along)), place
        points = self.coal.StdVec_Vec3s()
        points.extend(list(vertices))
        return self.coal.Convex.convexHull(points, True, "Qt"), self.coal.Transform3s.Identity()

    def take(self, cloud):
        self.tree = self.coal.makeOctree(np.ascontiguousarray(cloud, dtype=np.float64), EDGE)

    def least(self):
        request, result, _, _ = requests_of(self.coal)
        out = []
        for places in self.places:
            best = np.inf
            for (_, link, _), place in zip(self.links, places):
                result.clear()
                best = min(best, self.coal.distance(link, place, self.tree, self.still, request, result))
            out.append(best)
        return np.array(out)

    def free(self):
        _, _, request, result = requests_of(self.coal)
        out = []
        for places in self.places:
            touches = False
            for (_, link, _), place in zip(self.links, places):
                result.clear()
                if self.coal.collide(link, place, self.tree, self.still, request, result):
                    touches = True
                    break
            out.append(not touches)
        return np.array(out)


def swap(call, times=20):
    """Median time of replacing a cloud, in milliseconds."""
    return 1e3 * float(np.median([timed(call)[0] for _ in range(times)]))


def row(us, coal, body, elements, states, coal_least, coal_check, cloud):
    """Results of one body. coal_least, coal_check: seconds and results."""
    least, (lower, upper) = timed(us.least, body, states)
    check, free = timed(us.free, body, states)
    is_same = body == "voxels"  # of the same boxes
    off = outside(lower, upper, coal_least[1], (lower > 0) & (coal_least[1] > 0))
    least, coal_least_s, check, coal_check_s = (
        each / len(states) for each in (least, coal_least[0], check, coal_check[0])
    )
    return {"cloud": body, "elements": len(elements), "states": len(states), "free": int(free.sum()),
            "min_us": round(1e6 * least, 1), "coal_min_us": round(1e6 * coal_least_s, 1),
            "min_ratio": round(coal_least_s / least, 2), "any_us": round(1e6 * check, 1),
            "coal_any_us": round(1e6 * coal_check_s, 1), "any_ratio": round(coal_check_s / check, 2),
            "coal_off_m": f"{off:.1e}" if is_same else "",
            "verdicts_differ": int(np.sum(free != coal_check[1])) if is_same else "",
            "swap_ms": round(swap(lambda: us.engine.set_points(body, elements)), 2),
            "coal_swap_ms": round(swap(lambda: coal.take(cloud), 3), 2)}


def main():
    made = parser(__doc__)
    made.add_argument("--points", type=int, default=100000)
    made.add_argument("--states", type=int, default=100)
    options = made.parse_args()
    rng = np.random.default_rng(5)
    folder = ROOT / "build/bench_clouds"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "scene.yaml").write_text(SCENE % (ROOT / "scenes/cell/arm.urdf", EDGE))
    us = Clearance(folder)

    cloud = room(int(options.points * 1.05), rng)
    joints = us.engine.joints("arm")
    keep = np.linalg.norm(cloud - np.array([0, 0, 0.9]), axis=1) > 0.25
    cloud = cloud[keep][: options.points]
    us.engine.set_points("points", cloud)
    voxels = on_grid(cloud)
    us.engine.set_points("voxels", voxels)
    low, high = np.maximum(joints.lower, -2.5), np.minimum(joints.upper, 2.5)
    states = rng.uniform(low, high, (options.states, len(low)))
    coal = Coal(us, states)
    coal.take(cloud)

    both = timed(coal.least), timed(coal.free)
    rows = (row(us, coal, *body, states, *both, cloud) for body in (("points", cloud), ("voxels", voxels)))
    write(shown(rows), options.csv)


if __name__ == "__main__":
    main()
