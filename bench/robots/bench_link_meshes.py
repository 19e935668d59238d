#!/usr/bin/env python3
"""A robot's links and a concave mesh, compared with Pinocchio and Coal (BVHModelOBBRSS) in the same states.

    bench/run.py link_meshes [--robots panda ur5] [--states 2000] [--rounds 3] [--csv FILE]

The mesh is one body of 2,828 triangles: a bumpy floor, a shelf of five compartments, two rings. Links are hulls (panda,
ur5), and meshes as in their files (`meshes`). All pairs of a link and the mesh are queried in random states: a distance
for each pair (`rows`), the least of each state (`least`), and whether each state is free (`valid`, which stops at the
first contact). One thread, processor time, alternating rounds, the least of them. Clearance gets a batch of states, the
peer one call in C++ for each state, in the faster of its two orders (pairs in order, a tree of boxes). It has no call
for the least distance alone. Also reported: the greatest excess of its distances over our bounds if links are apart,
and the number of differing decisions.
"""

from dataclasses import dataclass

import numpy as np

import problems
from bench_robots import limits_of, seconds_of
from bench_surfaces import outside
from contenders import Clearance, PinocchioCoal
from harness import shown, stamped, write
from surface_shapes import ring, shelf


@dataclass
class Mesh:
    """An obstacle as in contenders.py."""

    name: str
    sizes: tuple  # vertices (N, 3) in metres, triangles (M, 3)
    pose: np.ndarray  # (7,) X_w
    shape: str = "mesh"


@dataclass
class Room:
    obstacles: list


def floor(side, cells, rng):
    """A centred height field about z = 0."""
    x, y = np.meshgrid(*[np.linspace(-side / 2, side / 2, cells + 1)] * 2, indexing="ij")
    z = 0.03 * np.sin(7 * x + 1) * np.cos(5 * y) + 0.01 * rng.normal(size=x.shape)
    at = np.stack([x, y, z], -1).reshape(-1, 3)
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    right, up = corner + cells + 1, corner + 1
    return at, np.concatenate([np.stack([corner, right, right + 1], 1), np.stack([corner, right + 1, up], 1)])


def concave_room():
    """The surroundings of a robot's base, as one mesh that is not closed."""
    rng = np.random.default_rng(7)
    parts = [(floor(2.4, 24, rng), (0, 0, -0.3)), (shelf(), (0.45, -0.5, -0.2))]
    parts += [(ring(800, 0.12, 0.03, rng), at) for at in ((-0.4, 0.5, 0.1), (-0.3, -0.55, 0.4))]
    vertices, triangles, count = [], [], 0
    for (at, faces), place in parts:
        vertices.append(at + np.array(place))
        triangles.append(faces + count)
        count += len(at)
    mesh = np.concatenate(vertices), np.concatenate(triangles).astype(np.uint32)
    return Room([Mesh("room", mesh, np.array([0, 0, 0, 1, 0, 0, 0.0]))])


def measure(name, links, resources, options):
    joints = list(problems.load(resources, name)[0].goal)
    peer = PinocchioCoal(resources, joints, name, as_hulls=links == "hulls")
    peer.robot.removeAllCollisionPairs()
    us = Clearance(resources, joints, name, mesh_as="hull" if links == "hulls" else "surface")
    room = concave_room()
    for contender in (us, peer):
        contender.begin(room)
    moving = {peer.model.frames[item.parentFrame].name for item in peer.robot.geometryObjects if item.parentJoint != 0}
    requested = {"pairs": [(f"{name}/{link}", "room") for link in sorted(moving)], "joints": us.joints}
    limits = limits_of(peer.model, joints)
    Q = np.random.default_rng(options.seed).uniform(limits[:, 0], limits[:, 1], (options.states, len(joints)))

    def ours(**more):
        return lambda Q: us.requested.distances(configurations=Q, fields=("lower", "upper"), **requested, **more)

    def ours_valid(Q):
        return us.requested.check(configurations=Q, **requested).free

    theirs = peer.ways()
    questions = {"rows": (ours(), theirs["least"]), "least": (ours(reduce="min"), theirs["least"]),
                 "valid": (ours_valid, theirs["verdict"])}
    least, free = ours(reduce="min")(Q), ours_valid(Q)
    distance, _ = theirs["least"]["Coal"](peer.states(Q))
    their_free = next(iter(theirs["verdict"].values()))(peer.states(Q))
    lower, upper = least.lower.ravel(), least.upper.ravel()
    off = outside(lower, upper, distance, lower > 0)
    for question, (way, peers) in questions.items():
        seconds = {"ours": [], "theirs": []}
        for _ in range(options.rounds):
            seconds["ours"].append(seconds_of(us, way, Q))
            seconds["theirs"].append(min(seconds_of(peer, each, peer.states(Q)) for each in peers.values()))
        mine, best = (1e6 * min(each) / len(Q) for each in seconds.values())
        yield {"robot": name, "links": links, "question": question, "pairs": len(moving), "states": len(Q),
               "free": int(free.sum()), "us": f"{mine:.3g}", "coal_us": f"{best:.3g}", "ratio": f"{best / mine:.3g}",
               "coal_off_m": f"{off:.1e}", "verdicts_differ": int((free != their_free).sum())}


def main():
    parser = problems.parser(__doc__, "panda ur5", seed=1)
    parser.add_argument("--states", type=int, default=200)
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    resources = problems.fetch()
    cases = [(name, links) for name in options.robots for links in ("hulls", "meshes")]
    rows = shown(row for case in cases for row in measure(*case, resources, options))
    write(rows, options.csv, stamped(f"{options.states} states, the least of {options.rounds} rounds"))


if __name__ == "__main__":
    main()
