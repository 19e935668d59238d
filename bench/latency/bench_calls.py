"""Time that the interfaces add to the engine: C++ and Python in one process, and Python through a daemon.

Calls of one state or edge of a robot, all pairs of a scene at its present poses, and an update of all poses. Each call
is timed as a prepared query and as a one-off call, which parses its arguments.

The engine's own time is that of the bare engine in the same run. `clearance-prepared` measures it: a call of one state
(bare_us), and a state of a batch (batch_us), together with the C++ interface. Results in Python have `engine_ns` of the
same calls, which a daemon measures without the checks of the query. A bare echo over shared memory is measured, too
(echo_us), and a loop that does nothing (idle_p99.9_us, for comparison with p99.9 of prepared calls). All are timed by
turns.

Prints and writes, as CSV, a row for each call: medians in microseconds (of C++ the fastest rounds), the time beyond the
engine's and the echo's, and the ratio to the engine's.
"""

import argparse
import contextlib
import csv
import os
import subprocess
import time
from pathlib import Path
from typing import Any

import numpy as np
from bench import Machine, bench_row

import clearance
from harness import ROOT, write
from processes import Stage
from service import BIN, start_daemon

TURNS = 5
BARE = "C++"
SCENES = [ROOT / "scenes/cell/robot.yaml", ROOT / "scenes/nineteen/scene.yaml"]


def times_of(evaluate, engine_ns, seconds):
    """Of a call the median, that of the engine in it, and p99.9, in microseconds."""
    took, engine = [], []
    for _ in range(20):
        evaluate()
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        begin = time.perf_counter_ns()
        result = evaluate()
        took.append(time.perf_counter_ns() - begin)
        engine.append(engine_ns(result) if engine_ns else 0)
    return 1e-3 * float(np.median(took)), 1e-3 * float(np.median(engine)), 1e-3 * float(np.quantile(took, 0.999))


def decided(check):
    """A check, and its decision, as a planner reads it."""
    bool(check)
    return check


def calls(front):
    """(name, prepared call, the same call parsed each time, engine time of its result, or None), of one state."""
    joints = front.joints(np.arange(len(front.joint_states())))
    at = np.array([[joint.position for joint in front.joint_states()]])
    edge = at + 0.01
    path = np.concatenate((at, edge))
    check = front.prepare("check", joints=joints)
    motion = front.prepare("motions", joints=joints, reduce="any", fields="verdict")
    whole = front.prepare("check_path", joints=joints)
    least = front.prepare(joints=joints, reduce="min", fields="lower")
    of_check, of_result = lambda r: r.result.engine_ns, lambda r: r.engine_ns
    yield "check", lambda: decided(check.run(at)), lambda: decided(front.check(at, joints=joints)), of_check
    yield (
        "one edge",
        lambda: motion.run(at, edge),
        lambda: front.motions(at, edge, joints=joints, reduce="any", fields="verdict"),
        of_result,
    )
    yield "path of one edge", lambda: whole.run(path), lambda: front.check_path(path, joints=joints), None
    yield (
        "distances, min",
        lambda: least.run(at),
        lambda: front.distances(configurations=at, joints=joints, reduce="min", fields="lower"),
        of_result,
    )
    columns = ["lower", "normal", "gradient_joints", "rate"]
    yield "20 rows of a QP", *rows_of_qp(front, joints, at, [*columns, "rate_bounds"]), of_result
    yield "20 rows of first order", *rows_of_qp(front, joints, at, columns), of_result


def rows_of_qp(front, joints, at, columns):
    """The 20 nearest pairs of a moving arm, as a prepared call and as one that is parsed each time."""
    options = {"joints": joints, "reduce": "nearest", "k": 20, "fields": columns}
    inputs = (at, np.full_like(at, 0.1)) if {"rate", "rate_bounds", "curvature"} & set(columns) else (at,)
    rows = front.prepare(**options)
    return lambda: rows.run(*inputs), lambda: front.prepare(**options).run(*inputs)


def calls_of_pairs(front):
    """The same for all pairs at the present poses."""
    pairs = front.prepare(fields="lower")
    yield "all pairs", lambda: pairs.run(), lambda: front.distances(fields="lower"), lambda r: r.engine_ns


def calls_of_poses(front):
    """The same for updates of all poses; the prepared form is an array, the other a dict of names."""
    moved = [i for i, body in enumerate(front.bodies) if not body.is_static and body.parent is None]
    poses = np.array([front.body_states()[i].pose for i in moved])
    by_name = {front.bodies[i].name: pose for i, pose in zip(moved, poses)}
    yield "set poses", lambda: front.set_poses(poses, moved), lambda: front.set_poses(by_name), None


def calls_of(front, is_robot):
    kinds = (calls, calls_of_pairs) if is_robot else (calls_of_pairs, calls_of_poses)
    return [call for kind in kinds for call in kind(front)]


def bare_rows(scene, is_robot, rounds):
    """Rows of clearance-prepared by call: microseconds of a state in a batch, of the engine, prepared, and one-off."""
    command = [BIN / "clearance-prepared", scene, "*" if is_robot else "-", rounds]
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=True)
    rows = csv.DictReader(done.stdout.splitlines())
    return {row["call"]: {key: float(value or "nan") for key, value in row.items() if key != "call"} for row in rows}


def compared(row, kind, took, own, echo=0.0):
    """Adds a time, its part beyond the engine's, and the ratio."""
    row |= {f"{kind}_us": round(took, 2), f"{kind}_adds_us": round(took - own - echo, 2)}
    row[f"{kind}_ratio"] = round(took / own, 2)


def rows_of(scene, is_robot, fronts, urls, seconds):
    """Rows of all calls of a scene.

    fronts: an engine and clients, by name. urls: of the clients, by name.
    """
    named = list(zip(*(calls_of(front, is_robot) for front in fronts.values())))
    took: dict[tuple[str, str, str], list[tuple[float, float, float]]] = {}
    idle: list[float] = []
    echoes: dict[str, list[float]] = {through: [] for through in urls}
    bare: list[dict[str, dict[str, float]]] = []
    for _ in range(TURNS):
        bare.append(bare_rows(scene, is_robot, max(20, round(100 * seconds / TURNS))))
        for through, (stage, url) in urls.items():
            row = bench_row(stage, (), url, pairs=1, configs=0, seconds=seconds / TURNS, warmup=0.05)
            echoes[through].append(row["floor_p50_us"])
        idle.append(times_of(lambda: None, None, seconds / TURNS)[2])
        for same in named:
            for through, (name, prepared, parsed, engine_ns) in zip(fronts, same):
                for kind, evaluate in (("prepared", prepared), ("one_off", parsed)):
                    took.setdefault((name, through, kind), []).append(times_of(evaluate, engine_ns, seconds / TURNS))
    for (name, *_), *_ in named:
        of_call = [turn[name] for turn in bare]
        best = {key: min(row[key] for row in of_call) for key in of_call[0]}
        row = {"call": name, "scene": scene.parent.name, "through": BARE, "count": int(best["pairs"])}
        row["bare_us"], own = round(best["engine_us"], 2), best["engine_us"]
        if best["batch_us"] > 0:
            row["batch_us"], own = round(best["batch_us"], 2), best["batch_us"]
        for kind in ("prepared", "one_off"):
            compared(row, kind, best[f"{kind}_us"], own)
        yield row
        for through in fronts:
            row = {"call": name, "scene": scene.parent.name, "through": through, "count": int(best["pairs"])}
            row["bare_us"] = round(best["engine_us"], 2)
            echo = float(np.median(echoes[through])) if through in urls else 0.0
            if echo:
                row["echo_us"] = round(echo, 2)
            for kind in ("prepared", "one_off"):
                us, own, worst = np.median(took[name, through, kind], axis=0)
                if own > 0:
                    row.setdefault("engine_us", round(float(own), 2))
                compared(row, kind, float(us), float(own) or best["engine_us"], echo)
                if kind == "prepared":
                    row["prepared_p99.9_us"] = round(float(worst), 2)
            row["idle_p99.9_us"] = round(float(np.median(idle)), 2)
            yield row


@contextlib.contextmanager
def on_own_cpu(machine):
    """Moves this process, and those that it starts, to another CPU than the daemons, at the machine's priority."""
    if len(machine.cores) > 1:
        os.sched_setaffinity(0, machine.cores[1:2])
    if machine.priority:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    try:
        yield
    finally:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        os.sched_setaffinity(0, machine.cores)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--scenes", type=Path, nargs="+", default=SCENES)
    parser.add_argument("--seconds", type=float, default=1.0, help="of each measurement")
    parser.add_argument("--csv", type=Path, help="file to write")
    parser.add_argument("--daemons", type=Path, nargs="*", default=[BIN / "clearanced"], help="programs to compare")
    parser.add_argument("--real-time", action="store_true", help="at real-time priority, on a machine that is shared")
    options = parser.parse_args()
    machine, rows = Machine(options.real_time), []
    for scene in options.scenes:
        with contextlib.ExitStack() as stack:
            engine = clearance.Engine(clearance.Scene.load(scene), backend="cpu", threads=1)
            engine.wait_covers()
            fronts: dict[str, Any] = {"process": engine}
            urls = {}
            for i, program in enumerate(options.daemons):
                stage, through = stack.enter_context(Stage()), f"shared memory{i + 1 if i else ''}"
                _, listens, _ = start_daemon(stage, scene, machine.on(0), program=program)
                fronts[through] = stack.enter_context(clearance.connect(listens["shm"]))
                fronts[through].wait_covers()
                urls[through] = (stage, listens["shm"])
            is_robot = bool(engine.joint_states())
            stack.enter_context(on_own_cpu(machine))
            for row in rows_of(scene, is_robot, fronts, urls, options.seconds):
                print(*(f"{key} {value}" for key, value in row.items()), sep=", ", flush=True)
                rows.append(row)
    write(rows, options.csv)


if __name__ == "__main__":
    main()
