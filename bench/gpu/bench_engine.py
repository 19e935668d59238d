"""Time of large queries through Python to an engine in the same process: `bench_engine.py [BACKEND] [--csv FILE]`.

30 random hulls, 150 pairs, 4096 configurations: 614,400 rows per call. Each row of the table is a variant of the call.
With `--edges FOLDER`, a scene of write_motion_scenes.py, also 100,000 edges per call from its start and goal.
`engine` is the time in the engine's code; the rest is the cost of Python and fresh memory.
"""

import argparse
import time
from pathlib import Path

import numpy as np

import clearance

BODIES, PAIRS, CONFIGURATIONS = 30, 150, 4096
EDGES = 100_000


def scene_and_poses(rng):
    scene = clearance.Scene()
    for i in range(BODIES):
        points = rng.normal(size=(32 + i * 224 // (BODIES - 1), 3))
        scene.add_hull(f"h{i}", points / np.linalg.norm(points, axis=1, keepdims=True) * rng.uniform(0.1, 0.4, 3))
    q = rng.normal(size=(CONFIGURATIONS, BODIES, 4))
    poses = np.concatenate(
        [rng.uniform(-1, 1, (CONFIGURATIONS, BODIES, 3)), q / np.linalg.norm(q, axis=-1, keepdims=True)], axis=-1
    )
    return scene, poses


def hulls_of(scene):
    return [scene.pieces(body.name)[0][0] for body in scene.bodies]


def pairs_of(rng):
    first, second = np.triu_indices(BODIES, 1)
    return np.stack([first, second], axis=1)[rng.permutation(len(first))[:PAIRS]].astype(np.uint32)


def timed(evaluate, engine, seconds=1.0):
    """Medians in microseconds over consecutive calls: the whole call, in the engine, in kernels."""
    for _ in range(3):
        evaluate()
    took, inside, kernels = [], [], []
    end = time.perf_counter() + seconds
    while time.perf_counter() < end or len(took) < 5:
        before = engine.stats().get("cuda.kernel_ns", 0)
        begin = time.perf_counter_ns()
        result = evaluate()
        took.append(time.perf_counter_ns() - begin)
        inside.append(result.engine_ns)
        kernels.append(engine.stats().get("cuda.kernel_ns", 0) - before)
    return [1e-3 * float(np.median(x)) for x in (took, inside, kernels)]


def ways_of_edges(folder, backend):
    """An engine of the scene, and calls for edges 0.2 to 1.5 rad long, every second from the goal."""
    joints, *ends = (Path(folder) / "ends.txt").read_text().splitlines()
    start = np.array([end.split() for end in ends[:2]], float)[np.arange(EDGES) % 2]
    rng = np.random.default_rng(1)
    step = rng.normal(size=start.shape)
    step *= rng.uniform(0.2, 1.5, (EDGES, 1)) / np.linalg.norm(step, axis=1, keepdims=True)
    engine = clearance.Engine(clearance.Scene.load(str(Path(folder) / "scene.yaml")), backend=backend)
    edges = {"start": start, "end": start + step, "joints": joints.split()}
    return engine, {
        "edges, any": lambda: engine.motions(reduce="any", **edges),
        "edges, any, status": lambda: engine.motions(reduce="any", fields=["status"], **edges),
        "edges, min": lambda: engine.motions(**edges),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("backend", nargs="?", default="auto")
    parser.add_argument("--csv", help="file to add rows to")
    parser.add_argument("--edges", help="folder of a scene with a robot")
    arguments = parser.parse_args()
    rng = np.random.default_rng(5)
    scene, poses = scene_and_poses(rng)
    engine = clearance.Engine(scene, backend=arguments.backend)
    pairs = pairs_of(rng)
    query = {"pairs": pairs, "configurations": poses}
    prepared = engine.prepare("distances", pairs=pairs)
    bounds = engine.prepare("distances", pairs=pairs, fields="bounds")
    ways = {
        "default": lambda: engine.distances(**query),
        "default, prepared": lambda: prepared.run(poses),
        "bounds": lambda: engine.distances(fields="bounds", **query),
        "bounds, prepared": lambda: bounds.run(poses),
        "lower and upper": lambda: engine.distances(fields=["lower", "upper"], **query),
        "with points": lambda: engine.distances(fields=["default", "points"], **query),
        "min": lambda: engine.distances(reduce="min", **query),
    }
    rows = [(name, *timed(evaluate, engine)) for name, evaluate in ways.items()]
    if arguments.edges:
        engine, ways = ways_of_edges(arguments.edges, arguments.backend)
        rows += [(name, *timed(evaluate, engine)) for name, evaluate in ways.items()]
    print(
        f"backend {arguments.backend}, microseconds a call of {PAIRS * CONFIGURATIONS:,} pairs or {EDGES:,} edges\n"
        f"{'way':<20}{'Python':>10}{'engine':>10}{'kernels':>10}"
    )
    for name, *numbers in rows:
        print(f"{name:<20}" + "".join(f"{number:>10.0f}" for number in numbers))
    if arguments.csv:
        with open(arguments.csv, "a", encoding="utf-8") as out:
            for name, *numbers in rows:
                out.write(f'"{name}",' + ",".join(f"{number:.1f}" for number in numbers) + "\n")


if __name__ == "__main__":
    main()
