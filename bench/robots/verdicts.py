"""Times of verdicts alone, of states and edges, for bench_motions.py: without and with covers, by builds of
clearance-prepared."""

import subprocess
import tempfile
from pathlib import Path

import numpy as np

from clearance import Status
from contenders import engine_of, scene_of
from harness import ROOT

PROGRAM = ROOT / "build/bin/clearance-prepared"
ENDS = 2  # states of an edge


def ends_of(problem, joints):
    """(2, J) start and goal."""
    return np.array([[at[j] for j in joints] for at in (problem.start, problem.goal)])


def edges_from(start, rng):
    """Edges of 0.2 to 1.5 rad in random directions. start: (K, J). Returns their ends."""
    way = rng.normal(size=start.shape)
    way *= rng.uniform(0.2, 1.5, (len(start), 1)) / np.linalg.norm(way, axis=1, keepdims=True)
    return start + way


def is_free(verdict):
    return np.asarray(verdict) == Status.BEYOND


def inputs_of(problem, engine, joints, margin, count, rng):
    """(name, rows of joint positions) of random states, free and hit, and of edges, from start or goal (near) and from
    random free states (anywhere). Decided without covers."""
    names = engine.joints([f"{problem.robot}/{joint}" for joint in joints])
    request = {"joints": names, "margin": margin, "reduce": "any", "fields": "verdict"}
    low, high = np.maximum(names.lower, -np.pi), np.minimum(names.upper, np.pi)
    states = rng.uniform(low, high, (ENDS * count, len(joints)))
    free = is_free(engine.distances(configurations=states, **request).verdict)
    found = {"states free": states[free], "states hit": states[~free]}
    somewhere = states[free]
    for where, start in (("near", ends_of(problem, joints)), ("anywhere", somewhere)):
        if not len(start):
            continue
        start = start[np.arange(count) % len(start)]
        end = edges_from(start, rng)
        free = is_free(engine.motions(start, end, **request).verdict)
        for verdict, some in (("free", free), ("hit", ~free)):
            found[f"{where} {verdict}"] = np.stack([start[some], end[some]], axis=1).reshape(-1, len(joints))
    order = np.argsort(names.ids)
    return {name: rows[:, order] for name, rows in found.items() if len(rows)}


class Verdicts:
    """Sums of one robot's times over its problems, of each the least of some rounds."""

    def __init__(self, robot, margin, programs, rounds):
        self.robot, self.margin, self.programs, self.rounds = robot, margin, programs, rounds
        self.seconds, self.count = {}, {}

    def add(self, problem, resources, joints, count, seed):
        engine = engine_of(problem, resources, covers="off")
        inputs = inputs_of(problem, engine, joints, self.margin, count, np.random.default_rng([problem.number, seed]))
        with tempfile.TemporaryDirectory() as folder:
            scene_of(problem, resources).save(f"{folder}/scene")
            for name, rows in inputs.items():
                path = Path(folder, name.replace(" ", "_") + ("" if name.startswith("states") else "_edges"))
                np.ascontiguousarray(rows).tofile(path)
            files = sorted(path for path in Path(folder).iterdir() if path.is_file())
            for program in self.programs if problem.number % 2 else reversed(self.programs):
                command = [program, f"{folder}/scene/scene.yaml", self.robot, self.rounds, self.margin, *files]
                command = [str(word) for word in command]
                lines = subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()
                for line in lines:
                    self._take(program, *line.split())

    def _take(self, program, file, covers, way, count, *seconds):
        what = Path(file).name.removesuffix("_edges").replace("_", " ")
        key = str(program), what, way, covers
        self.seconds[key] = self.seconds.get(key, 0) + min(map(float, seconds))
        self.count[key] = self.count.get(key, 0) + int(count)

    def rows(self):
        """Microseconds, and ratios to the same without covers and to the first program."""
        for key, seconds in self.seconds.items():
            program, what, way, covers = key
            if covers == "off":
                continue
            yield {
                "robot": self.robot,
                "margin_m": self.margin,
                "of": what,
                "way": way,
                "count": self.count[key],
                **({"program": program} if len(self.programs) > 1 else {}),
                "us": f"{1e6 * seconds / self.count[key]:.3f}",
                "times_off": f"{self.seconds[program, what, way, 'off'] / seconds:.3g}",
                "of_first": f"{seconds / self.seconds[str(self.programs[0]), what, way, covers]:.3f}",
            }
