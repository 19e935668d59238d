"""Time that Python adds to the engine, in one process and through a daemon, for calls of one state or edge of a robot.

Each call is timed as a prepared query and as a one-off call, which parses its arguments, together with the engine's own
time in these calls (`engine_ns`: the checks of the query, its pairs, and its answer; through a daemon without these).
Engine and daemons are timed by turns. Prints and writes, as CSV, a row for each call: medians in microseconds, the time
beyond the engine's, and the ratio to it.
"""

import argparse
import contextlib
import time
from pathlib import Path
from typing import Any

import numpy as np

import clearance
from harness import ROOT, write
from processes import Stage
from service import BIN, start_daemon

TURNS = 5


def medians(evaluate, engine_ns, seconds):
    """Medians of a call and of the engine in it, in microseconds."""
    took, engine = [], []
    for _ in range(20):
        evaluate()
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        begin = time.perf_counter_ns()
        result = evaluate()
        took.append(time.perf_counter_ns() - begin)
        engine.append(engine_ns(result) if engine_ns else 0)
    return 1e-3 * float(np.median(took)), 1e-3 * float(np.median(engine))


def decided(check):
    """A check, and its decision, as a planner reads it."""
    bool(check)
    return check


def calls(front, joints, at):
    """(name, prepared call, the same call parsed each time, engine time of its result, or None)."""
    edge = at + 0.01
    path = np.concatenate((at, edge))
    check = front.prepare("check", joints=joints)
    motion = front.prepare("motions", joints=joints, reduce="any")
    whole = front.prepare("check_path", joints=joints)
    least = front.prepare(joints=joints, reduce="min", fields="lower")
    of_check, of_result = lambda r: r.result.engine_ns, lambda r: r.engine_ns
    yield "check", lambda: decided(check.run(at)), lambda: decided(front.check(at, joints=joints)), of_check
    yield (
        "one edge",
        lambda: motion.run(at, edge),
        lambda: front.motions(at, edge, joints=joints, reduce="any"),
        of_result,
    )
    yield "path of one edge", lambda: whole.run(path), lambda: front.check_path(path, joints=joints), None
    yield (
        "distances, min",
        lambda: least.run(at),
        lambda: front.distances(configurations=at, joints=joints, reduce="min", fields="lower"),
        of_result,
    )


def calls_of(front):
    joints = front.joints(np.arange(len(front.joint_states())))
    at = np.array([[joint.position for joint in front.joint_states()]])
    return [(len(front.pairs), len(joints), *call) for call in calls(front, joints, at)]


def measured(fronts, seconds):
    """Rows of all calls.

    fronts: an engine and clients, by name.
    """
    for same_call in zip(*map(calls_of, fronts.values())):
        turns = [[{} for _ in fronts] for _ in range(TURNS)]
        for turn in turns:
            for got, (_, _, _, prepared, parsed, engine_ns) in zip(turn, same_call):
                for kind, evaluate in (("prepared", prepared), ("one_off", parsed)):
                    got[kind] = medians(evaluate, engine_ns, seconds / TURNS)
        for i, (through, (pairs, joints, name, *_)) in enumerate(zip(fronts, same_call)):
            row = {"call": name, "through": through, "pairs": pairs, "joints": joints}
            for kind in ("prepared", "one_off"):
                took, own = np.median([turn[i][kind] for turn in turns], axis=0)
                row |= {f"{kind}_us": round(took, 2)}
                if own > 0:
                    row.setdefault("engine_us", round(own, 2))
                    row |= {f"{kind}_adds_us": round(took - own, 2), f"{kind}_ratio": round(took / own, 2)}
            print(*(f"{key} {value}" for key, value in row.items()), sep=", ", flush=True)
            yield row


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--scene", type=Path, default=ROOT / "scenes/cell/robot.yaml")
    parser.add_argument("--seconds", type=float, default=1.0, help="of each measurement")
    parser.add_argument("--csv", type=Path, help="file to write")
    parser.add_argument("--daemons", type=Path, nargs="*", default=[BIN / "clearanced"], help="programs to compare")
    options = parser.parse_args()
    with contextlib.ExitStack() as stack:
        engine = clearance.Engine(clearance.Scene.load(options.scene), backend="cpu", threads=1)
        fronts: dict[str, Any] = {"process": engine}
        for i, program in enumerate(options.daemons):
            _, urls, _ = start_daemon(stack.enter_context(Stage()), options.scene, program=program)
            fronts[f"shared memory{i + 1 if i else ''}"] = stack.enter_context(clearance.connect(urls["shm"]))
        write(list(measured(fronts, options.seconds)), options.csv)


if __name__ == "__main__":
    main()
