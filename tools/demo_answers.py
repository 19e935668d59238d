"""The demo's query: every body's nearest neighbour, over each transport."""
import csv
import io
import subprocess
import time
from pathlib import Path

import numpy as np

import clearance
from processes import DemoError

ROOT = Path(__file__).resolve().parents[1]
FIELDS = ("default", "points", "pair")


def ask_everywhere(client, urls, mover):
    """Queries every body's nearest neighbour through each transport, until all answers belong to one pose revision.

    Returns {transport: Answer}, their poses (as body states), and the number of attempts.
    """
    lcm = clearance.connect(urls["lcm"]) if "lcm" in urls else None
    mover.pause()
    try:
        for attempt in range(1, 101):
            answers = {"shm": ask_python(client), "zmq": ask_cpp(client, urls["zmq"])}
            if lcm:
                answers["lcm"] = ask_python(lcm)
            states = client.body_states()
            revisions = {answer.revision for answer in answers.values()} | {mover.revision()}
            if len(revisions) == 1:
                return answers, states, attempt
            time.sleep(0.01)
        raise DemoError("poses kept changing although their publisher was stopped")
    finally:
        mover.resume()
        if lcm:
            lcm.close()


class Answer:
    """Every body's nearest neighbour: ids (N,) and columns (N,) or (N, 3), row i for body i."""

    def __init__(self, revision, neighbour, status, distance, lower, upper, point, other_point):
        self.revision = revision
        self.neighbour = np.asarray(neighbour, dtype=np.uint32)
        self.status = np.asarray(status, dtype=np.uint8)
        self.distance, self.lower, self.upper, self.point, self.other_point = (
            np.ascontiguousarray(column, dtype=np.float64) for column in (distance, lower, upper, point, other_point))

    COLUMNS = ("neighbour", "status", "distance", "lower", "upper", "point", "other_point")

    def differences(self, other):
        """Names of the columns whose bits differ."""
        return [name for name in self.COLUMNS if getattr(self, name).tobytes() != getattr(other, name).tobytes()]


def ask_python(client):
    r = client.distances(reduce="nearest", fields=FIELDS)
    pairs = r.pairs[0]
    bodies = np.arange(len(pairs))
    first = pairs[:, 0] == bodies  # otherwise the body is the second of its pair
    return Answer(
        r.snapshot_revision,
        np.where(first, pairs[:, 1], pairs[:, 0]),
        r.status[0],
        r.distance[0],
        r.lower[0],
        r.upper[0],
        np.where(first[:, None], r.point_a[0], r.point_b[0]),
        np.where(first[:, None], r.point_b[0], r.point_a[0]),
    )


def ask_cpp(client, url):
    """The same through client/examples/nearest.cpp, whose 17 digits reproduce the bits."""
    done = subprocess.run([ROOT / "build/examples/nearest", url], capture_output=True, text=True, timeout=60)
    if done.returncode:
        raise DemoError(done.stderr.strip())
    first, text = done.stdout.split("\n", 1)
    rows = list(csv.DictReader(io.StringIO(text)))
    ids = {body.name: body.id for body in client.bodies}

    def numbers(*names):
        return np.array([[float(row[name]) for name in names] for row in rows])

    distance, lower, upper = numbers("distance", "lower", "upper").T
    return Answer(int(first.split()[-1]), [ids.get(row["neighbour"], clearance.NONE) for row in rows],
                  [int(row["status"]) for row in rows], distance, lower, upper,
                  numbers("x", "y", "z"), numbers("other_x", "other_y", "other_z"))
