# mypy: ignore-errors
# Annotations contain Warp's types and calls.
"""MuJoCo Warp's GJK and Clearance on the same pairs and GPU, in one run: `bench_mujoco_warp.py [--csv FILE]`.

30 random hulls, 150 pairs, 4096 configurations: 614,400 distances. Poses and answers are in GPU memory, and each system
is captured in a CUDA graph. MuJoCo Warp uses its own model of the hulls (built by MuJoCo's compiler, with the vertex
graph that its support function climbs), its own kinematics, and its `gjk_phase` with the model's settings: the first
half of its collision detection of convex geoms, without contacts. It uses float32 throughout. Its distances are
compared with Clearance's certified bounds for its float32 vertices at its poses, to within 1e-7 of their size.

Needs `pip install mujoco-warp` (Apache-2.0), which installs warp-lang and mujoco.
"""

import argparse
import sys
import time
from importlib.metadata import version

import mujoco
import mujoco_warp as mjw
import numpy as np
import warp as wp
from bench_engine import CONFIGURATIONS, PAIRS, hulls_of, pairs_of, scene_and_poses
from mujoco_warp._src.collision_core import Geom
from mujoco_warp._src.collision_gjk import gjk_phase
from mujoco_warp._src.types import GeomType

import clearance

FAR = 1e9
WRONG = (1e-6, 1e-5, 1e-4)  # metres


@wp.func
def geom_of(
    place: int,
    position: wp.vec3,
    rotation: wp.mat33,
    geom_mesh: wp.array(dtype=int),
    mesh_vertadr: wp.array(dtype=int),
    mesh_vertnum: wp.array(dtype=int),
    mesh_vert: wp.array(dtype=wp.vec3),
    mesh_graphadr: wp.array(dtype=int),
    mesh_graph: wp.array(dtype=int),
):
    geom, mesh = Geom(), geom_mesh[place]
    geom.pos = position
    geom.rot = rotation
    geom.margin = 0.0
    geom.index = -1
    geom.vertadr = mesh_vertadr[mesh]
    geom.vertnum = mesh_vertnum[mesh]
    geom.vert = mesh_vert
    geom.graphadr = mesh_graphadr[mesh]
    geom.graph = mesh_graph
    return geom


@wp.kernel
def distances(
    pairs: wp.array2d(dtype=int),
    tolerance: float,
    iterations: int,
    geom_xpos: wp.array2d(dtype=wp.vec3),
    geom_xmat: wp.array2d(dtype=wp.mat33),
    geom_mesh: wp.array(dtype=int),
    mesh_vertadr: wp.array(dtype=int),
    mesh_vertnum: wp.array(dtype=int),
    mesh_vert: wp.array(dtype=wp.vec3),
    mesh_graphadr: wp.array(dtype=int),
    mesh_graph: wp.array(dtype=int),
    out: wp.array2d(dtype=float),
):
    p, world = wp.tid()  # configurations vary fastest: the threads of a warp climb the same graphs
    i, j = pairs[p, 0], pairs[p, 1]
    a = geom_of(i, geom_xpos[world, i], geom_xmat[world, i], geom_mesh, mesh_vertadr, mesh_vertnum, mesh_vert,
                mesh_graphadr, mesh_graph)  # fmt: skip
    b = geom_of(j, geom_xpos[world, j], geom_xmat[world, j], geom_mesh, mesh_vertadr, mesh_vertnum, mesh_vert,
                mesh_graphadr, mesh_graph)  # fmt: skip
    mesh = int(GeomType.MESH)
    _epa, dist, _count, _x1, _x2, _result, _a, _b = gjk_phase(
        tolerance, FAR, iterations, a, b, mesh, mesh, a.pos, b.pos
    )
    out[world, p] = dist


def model_of(hulls):
    """MuJoCo's model of free bodies, one hull each, with contacts disabled."""
    spec = mujoco.MjSpec()
    for i, vertices in enumerate(hulls):
        spec.add_mesh(name=f"m{i}", uservert=vertices.astype(np.float32).flatten())
        body = spec.worldbody.add_body(name=f"b{i}")
        body.add_freejoint()
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"m{i}", contype=0, conaffinity=0)
    return spec.compile()


class MujocoWarp:
    """The same pairs in MuJoCo Warp."""

    def __init__(self, hulls, pairs, poses):
        model = model_of(hulls)
        data = mujoco.MjData(model)
        self.model = mjw.put_model(model)
        self.data = mjw.put_data(model, data, nworld=len(poses))
        self.data.qpos.assign(poses.reshape(len(poses), -1).astype(np.float32))
        mjw.kinematics(self.model, self.data)
        self.pairs = wp.array(pairs.astype(np.int32), dtype=int)
        self.mesh = wp.array(model.geom_dataid.astype(np.int32), dtype=int)
        self.out = wp.zeros((len(poses), len(pairs)), dtype=float)
        self.settings = float(model.opt.ccd_tolerance), int(model.opt.ccd_iterations)

    def __call__(self):
        m, d = self.model, self.data
        wp.launch(distances, dim=(self.pairs.shape[0], d.nworld),
                  inputs=[self.pairs, *self.settings, d.geom_xpos, d.geom_xmat, self.mesh, m.mesh_vertadr,
                          m.mesh_vertnum, m.mesh_vert, m.mesh_graphadr, m.mesh_graph],
                  outputs=[self.out])  # fmt: skip

    def poses_as_they_are(self):
        """(K, N, 7) float64: the poses given by its float32 rotations and positions.

        Its matrices are not exact rotations; the nearest quaternions move a vertex by less than 1e-7 of its size.
        """
        positions, rotations = self.data.geom_xpos.numpy(), self.data.geom_xmat.numpy().astype(np.float64)
        quaternion, flat = np.empty(4), rotations.reshape(-1, 9)
        quaternions = np.empty((len(flat), 4))
        for k, rotation in enumerate(flat):
            mujoco.mju_mat2Quat(quaternion, rotation)
            quaternions[k] = quaternion
        return np.concatenate([positions.astype(np.float64), quaternions.reshape(*positions.shape[:2], 4)], axis=-1)

    def hulls_as_they_are(self):
        vertices = self.model.mesh_vert.numpy()
        begin, count = self.model.mesh_vertadr.numpy(), self.model.mesh_vertnum.numpy()
        return [vertices[begin[k] : begin[k] + count[k]].astype(np.float64) for k in self.mesh.numpy()]


def in_a_graph(work, repeats=50):
    """Microseconds per run in a CUDA graph: minimum and median of 7 rounds."""
    work()
    with wp.ScopedCapture() as capture:
        work()
    rounds = []
    for _ in range(7):
        wp.synchronize()
        begin = time.perf_counter()
        for _ in range(repeats):
            wp.capture_launch(capture.graph)
        wp.synchronize()
        rounds.append((time.perf_counter() - begin) / repeats * 1e6)
    return min(rounds), float(np.median(rounds))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--csv", help="file to write")
    parser.add_argument("--configurations", type=int, default=CONFIGURATIONS)
    arguments = parser.parse_args()
    rng = np.random.default_rng(5)
    scene, poses = scene_and_poses(rng)
    poses = poses[: arguments.configurations]
    pairs = pairs_of(rng)
    theirs = MujocoWarp(hulls_of(scene), pairs, poses)
    theirs()
    got = theirs.out.numpy().astype(np.float64)

    same = clearance.Scene()
    for i, vertices in enumerate(theirs.hulls_as_they_are()):
        same.add_hull(f"h{i}", vertices)
    on_gpu = "cuda" in clearance.Engine.backends()
    engine = clearance.Engine(same, backend="cuda" if on_gpu else "cpu")
    poses = theirs.poses_as_they_are()
    exact = engine.distances(pairs=pairs, configurations=poses, fields=["lower", "upper", "status"])
    apart = exact.lower > 1e-6
    off = np.maximum(exact.lower - got, got - exact.upper)[apart]
    print(
        f"{apart.sum():,} of {apart.size:,} pairs are apart; MuJoCo Warp {version('mujoco-warp')}"
        f" (tolerance {theirs.settings[0]:g}, {theirs.settings[1]} iterations) is outside the bounds"
    )
    wrong = [(np.abs(off) * (off > 0) > by).mean() for by in WRONG]
    for by, share in zip(WRONG, wrong):
        print(f"  by more than {by:g} m: {100 * share:.3f} %")
    print(f"  at most by {off.max():.3g} m")
    if not on_gpu:
        print("No CUDA device: times are not taken.")
        return 0

    bodies = [body.name for body in engine.bodies]
    plan = engine.prepare("distances", pairs=pairs, bodies=bodies, fields=["lower", "upper"]).on_device(len(poses))
    given = wp.array(poses, dtype=wp.float64)
    lower, upper = (wp.zeros(plan.shape, dtype=wp.float64) for _ in range(2))

    def ours():
        plan(given, out={"lower": lower, "upper": upper}, stream=wp.get_stream().cuda_stream)

    rows = [("MuJoCo Warp, GJK", *in_a_graph(theirs)), ("Clearance, lower and upper", *in_a_graph(ours))]
    rows.append(("MuJoCo Warp, GJK, again", *in_a_graph(theirs)))
    np.testing.assert_array_equal(lower.numpy()[apart], exact.lower[apart])
    print(f"microseconds for {PAIRS * len(poses):,} pairs in a graph: least, median")
    for name, least, median in rows:
        print(f"  {name:<28}{least:>9.0f}{median:>9.0f}")
    print(f"  ratio of the least: {min(rows[0][1], rows[2][1]) / rows[1][1]:.2f}")
    if arguments.csv:
        with open(arguments.csv, "a", encoding="utf-8") as out:
            for name, least, median in rows:
                shares = ",".join(f"{share:.6f}" for share in wrong) if name.startswith("MuJoCo") else "0,0,0"
                out.write(f'"{name}",{PAIRS * len(poses)},{least:.1f},{median:.1f},{shares}\n')
    return 0


if __name__ == "__main__":
    sys.exit(main())
