"""Cost of each optional column of the rows of a QP: the 20 nearest pairs of a moving arm, as a prepared call.

Sets of columns: the distance alone, its first order, each further column with these, and all. Python calls an engine in
its process, and a daemon over shared memory; `engine_us` is the engine's own time of the former. A loop that does
nothing is timed by turns with them, since p99.9 is the machine's as much as the call's.

Prints and writes, as CSV, a row for each set: the median and p99.9 of each way in microseconds.
"""

import argparse
import contextlib
from pathlib import Path
from typing import Any

import numpy as np
from bench import Machine
from bench_calls import SCENES, TURNS, on_own_cpu, rows_of_qp, times_of

import clearance
from harness import write
from processes import Stage
from service import start_daemon

FIRST_ORDER = ("lower", "normal", "gradient_joints", "rate")
SETS = [
    FIRST_ORDER[:1],
    FIRST_ORDER[:3],
    FIRST_ORDER,
    *((*FIRST_ORDER, name) for name in ("curvature", "hessian_joints", "rate_bounds", "smooth_radius")),
    (*FIRST_ORDER, "curvature", "hessian_joints", "rate_bounds", "smooth_radius"),
]


def runs_of(front):
    """A prepared call for each set of columns."""
    joints = front.joints(np.arange(len(front.joint_states())))
    at = np.array([[joint.position for joint in front.joint_states()]])
    return [rows_of_qp(front, joints, at, list(columns))[0] for columns in SETS]


def rows_of(fronts, seconds):
    """A row for each set of columns.

    fronts: an engine and a client, by the names of their columns.
    """
    runs = {through: runs_of(front) for through, front in fronts.items()}
    took: dict[tuple[str, int], list[tuple[float, float, float]]] = {}
    idle = []
    for _ in range(TURNS):
        idle.append(times_of(lambda: None, None, seconds / TURNS))
        for i in range(len(SETS)):
            for through, of_sets in runs.items():
                took.setdefault((through, i), []).append(times_of(of_sets[i], lambda r: r.engine_ns, seconds / TURNS))
    for i, columns in enumerate(SETS):
        row: dict[str, Any] = {"columns": " ".join(columns)}
        for through in runs:
            p50, engine, worst = np.median(took[through, i], axis=0)
            row.setdefault("engine_us", round(float(engine), 2))
            row |= {f"{through}_p50_us": round(float(p50), 2), f"{through}_p99.9_us": round(float(worst), 2)}
        row["idle_p99.9_us"] = round(float(np.median(idle, axis=0)[2]), 2)
        yield row


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seconds", type=float, default=2.0, help="of each measurement")
    parser.add_argument("--csv", type=Path, help="file to write")
    parser.add_argument("--real-time", action="store_true", help="at real-time priority, on a machine that is shared")
    options = parser.parse_args()
    machine, scene = Machine(options.real_time), SCENES[0]
    with contextlib.ExitStack() as stack:
        engine = clearance.Engine(clearance.Scene.load(scene), backend="cpu", threads=1)
        engine.wait_covers()
        stage = stack.enter_context(Stage())
        _, listens, _ = start_daemon(stage, scene, machine.on(0))
        client = stack.enter_context(clearance.connect(listens["shm"]))
        client.wait_covers()
        stack.enter_context(on_own_cpu(machine))
        rows = []
        for row in rows_of({"process": engine, "shm": client}, options.seconds):
            print(*(f"{key} {value}" for key, value in row.items()), sep=", ", flush=True)
            rows.append(row)
    write(rows, options.csv)


if __name__ == "__main__":
    main()
