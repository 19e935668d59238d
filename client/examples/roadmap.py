#!/usr/bin/env python3
"""A probabilistic roadmap of an arm whose edges are *proved* free throughout, made by two sweeps, and paths from it.

    python3 client/examples/roadmap.py --nodes 200000 --nearest 18 --workers 2

A first sweep decides which points of a Halton sequence are free, a second one which motions between near ones are. Both
continue after an interruption, and may run on Ray (--ray). Then it answers --queries random ones: proved motions
connect each end to the roadmap, and A* with landmarks (Goldberg and Harrelson 2005) searches it. Each resulting path is
proved again as a whole. Needs pyarrow and scipy.
"""

import argparse
import csv
import heapq
import json
import pathlib
import sys
import time

import numpy as np
import pyarrow.parquet as pq
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree

ROOT = pathlib.Path(__file__).resolve().parents[2]
try:
    import clearance
except ImportError:  # not installed: the build of this checkout
    sys.path.append(str(ROOT / "build" / "python"))
    import clearance
from clearance.sweep import Job, run  # noqa: E402

JOINTS = [f"arm/{name}" for name in ("turn", "lift", "elbow", "wrist_lift", "wrist_turn", "tool")]

LANDMARKS = 16
LONGER = 1.6  # accepted length relative to the shortest path, which speeds up the search
ONTO = 4  # nodes tried together from each end of a query


class Roadmap:
    """Free configurations, and proved motions between them.

    nodes: (N, J) radians and metres. pairs: (E, 2) nodes connected by a proved motion.
    """

    def __init__(self, engine, joints, nodes, pairs, margin):
        self.engine, self.joints, self.nodes, self.margin = engine, joints, nodes, margin
        length = np.linalg.norm(nodes[pairs[:, 0]] - nodes[pairs[:, 1]], axis=1)
        both = np.concatenate([pairs, pairs[:, ::-1]])
        graph = csr_array((np.tile(length, 2), (both[:, 0], both[:, 1])), shape=(len(nodes), len(nodes)))
        self.parts, self.part = connected_components(graph, directed=False)
        self.tree = cKDTree(nodes)
        self._far = self._landmarks(graph)
        # Lists, because a Python loop traverses them faster than arrays.
        self._first, self._next, self._length = graph.indptr.tolist(), graph.indices.tolist(), graph.data.tolist()

    def _landmarks(self, graph):
        """(N, LANDMARKS) lengths of the shortest paths to some nodes that are far from each other."""
        largest = np.flatnonzero(self.part == np.bincount(self.part).argmax())
        chosen, far = int(largest[0]), []
        for _ in range(LANDMARKS):
            far.append(dijkstra(graph, directed=False, indices=chosen))
            nearest = np.min(far, axis=0)[largest]
            chosen = int(largest[nearest.argmax()])
        return np.stack(far, axis=1)

    def path(self, start, goal):
        """(W, J) waypoints whose motions are proved free, or None if the roadmap has no such path."""
        begin, end = self._onto(start), self._onto(goal)
        for a in begin:
            for b in end:
                if self.part[a] == self.part[b]:
                    inner = self.nodes[self._along(a, b)]
                    return np.concatenate([[start], inner, [goal]])
        return None

    def _onto(self, place):
        """Nodes near a configuration to which a motion is proved free, nearest first."""
        _, near = self.tree.query(place, k=8 * ONTO)
        for i in range(0, len(near), ONTO):
            ends = self.nodes[near[i : i + ONTO]]
            starts = np.tile(place, (len(ends), 1))
            requested = {"joints": self.joints, "margin": self.margin, "reduce": "any", "fields": ["verdict"]}
            free = self.engine.motions(starts, ends, **requested).verdict == clearance.Status.BEYOND
            if free.any():
                return near[i : i + ONTO][free].tolist()
        return []

    def _along(self, start, goal):
        """Nodes of a short path between two nodes of one component: weighted A*, with the landmarks' triangle
        inequality.
        """
        # A path is at least as long as the difference between its ends' paths to any landmark.
        far = self._far[:, np.isfinite(self._far[goal])]
        least = far[goal]
        rest = {}

        def left(node):
            if node not in rest:
                rest[node] = LONGER * float(np.abs(far[node] - least).max()) if len(least) else 0.0
            return rest[node]

        best, came, queue, done = {start: 0.0}, {}, [(left(start), start)], set()
        while queue:
            _, node = heapq.heappop(queue)
            if node == goal:
                break
            if node in done:
                continue
            done.add(node)
            for k in range(self._first[node], self._first[node + 1]):
                other, length = self._next[k], best[node] + self._length[k]
                if length < best.get(other, np.inf):
                    best[other], came[other] = length, node
                    heapq.heappush(queue, (length + left(other), other))
        nodes = [goal]
        while nodes[-1] != start:
            nodes.append(came[nodes[-1]])
        return nodes[::-1]


def rows_of(folder, columns):
    """Columns of a result, all parts in order."""
    manifest = json.loads((folder / "manifest.json").read_text())
    tables = [pq.read_table(folder / part["file"], columns=columns) for part in manifest["parts"]]
    return {name: np.concatenate([table[name].to_numpy() for table in tables]) for name in columns}


def sweep(job, folder, options):
    """Runs a job, or the rest of it. Returns the number of new rows, and seconds."""
    begin = time.perf_counter()
    more = {"workers": options.workers, "progress": sys.stderr}
    job = Job.from_dict(job, ROOT, folder.name)
    if options.ray:
        from clearance import ray

        done = ray.run(job, folder, address=None if options.ray == "local" else options.ray, **more)
    else:
        done = run(job, folder, **more)
    seconds = time.perf_counter() - begin
    size = sum(path.stat().st_size for path in (folder / "parts").iterdir())
    print(f"{folder.name}: {done.rows:,} rows, {done.made} of {done.parts} parts made now, in {seconds:.1f} s; "
          f"{size / done.rows:.2f} bytes a row; {done.checked:,} rows recomputed, all equal", flush=True)  # fmt: skip
    return done, seconds, size


def make(options, engine, joints):
    """The roadmap, by two sweeps."""
    out, said = options.output, {"scene": str(options.scene), "joints": list(joints.names), "check": 0.01}
    said["margin"] = options.margin
    points = {**said, "rows": {"halton": {"count": options.nodes}}, "columns": ["free"], "positions": True}
    nodes_done = sweep(points, out / "nodes", options)
    found = rows_of(out / "nodes", ["free", *(f"position_{i}" for i in range(len(joints)))])
    free = found.pop("free")
    nodes = np.stack(list(found.values()), axis=1)[free]
    print(f"nodes: {len(nodes):,} of {len(free):,} are free")
    np.save(out / "nodes.npy", nodes)
    rows = {"edges": {"of": {"file": {"path": str(out / "nodes.npy")}}, "nearest": options.nearest}}
    edges_done = sweep({**said, "rows": rows, "columns": ["free"]}, out / "edges", options)
    (file,) = (out / "edges").glob("edges-*.npy")
    proved = rows_of(out / "edges", ["free"])["free"]
    pairs = np.load(file)[proved]
    print(f"edges: {len(pairs):,} of {len(proved):,} are proved free all along")
    begin = time.perf_counter()
    roadmap = Roadmap(engine, joints, nodes, pairs.astype(np.int64), options.margin)
    whole = np.bincount(roadmap.part).max()
    print(f"roadmap: ready in {time.perf_counter() - begin:.1f} s; {whole:,} nodes of {len(nodes):,} hang together")
    return roadmap, [("nodes", len(free), len(nodes), *nodes_done), ("edges", len(proved), len(pairs), *edges_done)]


def ask(roadmap, count, seed):
    """Random queries between free configurations: processor time of each in ms, and the number answered."""
    rng = np.random.default_rng(seed)
    places = rng.uniform(roadmap.joints.lower, roadmap.joints.upper, (20 * count, len(roadmap.joints)))
    free = places[roadmap.engine.check(places, joints=roadmap.joints, margin=roadmap.margin).free][: 2 * count]
    times, answered = [], 0
    for start, goal in free.reshape(-1, 2, len(roadmap.joints)):
        begin = time.process_time()
        path = roadmap.path(start, goal)
        times.append(1e3 * (time.process_time() - begin))
        if path is not None:
            answered += 1
            check = roadmap.engine.check_path(path, joints=roadmap.joints, margin=roadmap.margin)
            assert check.free, f"a path of proved edges is not free: {check}"
    return np.array(times), answered


def write_csv(options, sweeps, queries):
    """Measurements of both sweeps and of the queries."""
    with open(options.csv, "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["what", "rows", "free", "workers", "seconds", "rows_per_s", "bytes_per_row", "ms_50", "ms_99"])
        for what, rows, free, done, seconds, size in sweeps:
            whole = done.made == done.parts  # otherwise some existed before, so that there is no rate
            rate = [f"{seconds:.0f}", f"{rows / seconds:.0f}"] if whole else ["", ""]
            writer.writerow([what, rows, free, options.workers or "", *rate, f"{size / rows:.2f}", "", ""])
        count, answered, middle, most = queries
        writer.writerow(["queries", count, answered, 1, "", "", "", f"{middle:.1f}", f"{most:.1f}"])


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--scene", type=pathlib.Path, default=ROOT / "scenes/cell/robot.yaml")
    parser.add_argument("--joints", nargs="+", default=JOINTS, help="a robot's, by name")
    parser.add_argument("--nodes", type=int, default=5000, help="points to draw, free or not")
    parser.add_argument("--nearest", type=int, default=10, help="nodes that each node is joined with")
    parser.add_argument("--margin", type=float, default=0.005, help="metres that everything is farther apart than")
    parser.add_argument("--workers", type=int, default=0, help="0: one a core")
    parser.add_argument("--ray", nargs="?", const="local", metavar="ADDRESS", help="on Ray, as clearance sweep has it")
    parser.add_argument("--queries", type=int, default=200)
    parser.add_argument("--output", type=pathlib.Path, default=ROOT / "out/roadmap")
    parser.add_argument("--csv", type=pathlib.Path, help="file for the figures")
    options = parser.parse_args()
    options.output = options.output.absolute()
    engine = clearance.Engine(clearance.Scene.load(options.scene), backend="cpu", threads=1)
    roadmap, sweeps = make(options, engine, engine.joints(options.joints))
    times, answered = ask(roadmap, options.queries, seed=1)
    middle, most = np.percentile(times, [50, 99])
    print(f"queries: {answered} of {len(times)} answered, each path proved again; "
          f"processor time: median {middle:.1f} ms, 99 % within {most:.1f} ms")  # fmt: skip
    if options.csv:
        write_csv(options, sweeps, (len(times), answered, middle, most))
    return 0


if __name__ == "__main__":
    sys.exit(main())
