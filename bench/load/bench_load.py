#!/usr/bin/env python3
"""Load time of a scene of many meshes, with an empty cache and with a full one.

    bench/run.py load [--meshes 1000] [--runs 3]

Each mesh is a different sphere of 9,942 vertices in its own file. Every load runs in its own process, with the Python
package and the file system's cache warm. `off` is without a cache, `cold` with an empty one, `warm` with the one that
`cold` filled.
"""
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from harness import parser, shown, write

RESOLUTION = 71  # of make_uv_sphere: 2 r (r - 1) + 2 vertices
LOAD = """
import os, resource, sys, time
import clearance
begin = time.perf_counter()
scene = clearance.Scene.load(sys.argv[1])
wall = time.perf_counter() - begin
used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
print(wall, sum(u.ru_utime + u.ru_stime for u in used), len(os.sched_getaffinity(0)))
"""


def sphere():
    """Vertices and triangles of a unit sphere, poles first."""
    r, n = RESOLUTION, 2 * RESOLUTION
    phi = np.pi * np.arange(1, r) / r
    theta = np.pi * np.arange(n) / r
    rings = np.stack([np.outer(np.sin(phi), np.cos(theta)), np.outer(np.sin(phi), np.sin(theta)),
                      np.outer(np.cos(phi), np.ones(n))], axis=-1).reshape(-1, 3)
    j, k = np.arange(n), (np.arange(n) + 1) % n
    faces = [
        np.stack([np.zeros(n, int), 2 + j, 2 + k], 1),
        np.stack([np.ones(n, int), len(rings) + 2 - n + k, len(rings) + 2 - n + j], 1),
    ]
    for ring in range(r - 2):
        a, b = 2 + n * ring, 2 + n * (ring + 1)
        faces += [np.stack([b + j, a + k, a + j], 1), np.stack([b + j, b + k, a + k], 1)]
    return np.vstack([[[0, 0, 1], [0, 0, -1]], rings]), np.vstack(faces)


def write_scene(folder: Path, meshes: int) -> Path:
    """A scene of this many binary STL files."""
    vertices, triangles = sphere()
    record = np.zeros(len(triangles), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])
    bodies = []
    for i in range(meshes):
        record["corners"] = (vertices * [1 + 1e-3 * i, 1, 1 + 1e-4 * i])[triangles]
        (folder / f"m{i}.stl").write_bytes(bytes(80) + np.uint32(len(triangles)).tobytes() + record.tobytes())
        bodies.append(f"  - {{name: m{i}, mesh: m{i}.stl}}\n")
    scene = folder / "scene.yaml"
    scene.write_text("bodies:\n" + "".join(bodies))
    return scene


def load(scene: Path, cache: str):
    """(seconds, seconds of processor time, cores) of one load."""
    environment = {**os.environ, "CLEARANCE_CACHE": cache, "CLEARANCE_CACHE_MIB": "8192"}
    answer = subprocess.run([sys.executable, "-c", LOAD, str(scene)], env=environment, capture_output=True, text=True)
    if answer.returncode:
        sys.exit(answer.stderr)
    return tuple(map(float, answer.stdout.split()))


def main() -> None:
    made = parser(__doc__)
    made.add_argument("--meshes", type=int, default=1000)
    made.add_argument("--runs", type=int, default=3, help="of each; the best counts")
    options = made.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        scene = write_scene(Path(folder), options.meshes)
        runs = {"off": [], "cold": [], "warm": []}
        for run in range(options.runs):
            cache = f"{folder}/cache{run}"
            for kind, where in (("off", "off"), ("cold", cache), ("warm", cache)):
                runs[kind].append(load(scene, where))
                print(f"{kind}: {runs[kind][-1][0]:.2f} s, {runs[kind][-1][1]:.2f} s of processor time", flush=True)
    best = {kind: min(times) for kind, times in runs.items()}
    print(
        f"{options.meshes} meshes of {2 * RESOLUTION * (RESOLUTION - 1) + 2} vertices, {best['cold'][2]:.0f} cores: "
        f"{best['cold'][0]:.2f} s with an empty cache, {best['warm'][0]:.2f} s with a full one, "
        f"{best['cold'][0] / best['warm'][0]:.1f} times as fast"
    )
    rows = (
        {"cache": kind, "meshes": options.meshes, "cores": int(cores), "seconds": f"{seconds:.3f}",
         "processor_seconds": f"{processor:.3f}"}
        for kind, (seconds, processor, cores) in best.items()
    )  # fmt: skip
    write(shown(rows), options.csv)


if __name__ == "__main__":
    main()
