"""Time that Python adds to the engine in one process, for calls of one state or one edge of a robot.

Each call is timed as a prepared query and as a one-off call, which parses its arguments, together with the engine's own
time in these calls (`engine_ns`: the checks of the query, its pairs, and its answer). Prints and writes, as CSV, a row
for each call: medians in microseconds, what Python adds, and the ratio to the engine.
"""

import argparse
import time
from pathlib import Path

import numpy as np

import clearance
from harness import ROOT, write


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
        engine.append(engine_ns(result))
    return 1e-3 * float(np.median(took)), 1e-3 * float(np.median(engine))


def decided(check):
    """A check, and its decision, as a planner reads it."""
    bool(check)
    return check


def calls(engine, joints, at):
    """(name, prepared call, the same call parsed each time, engine time of its result)."""
    edge = at + 0.01
    check = engine.prepare("check", joints=joints)
    motion = engine.prepare("motions", joints=joints, reduce="any")
    least = engine.prepare(joints=joints, reduce="min", fields="lower")
    of_check, of_result = lambda r: r.result.engine_ns, lambda r: r.engine_ns
    yield "check", lambda: decided(check.run(at)), lambda: decided(engine.check(at, joints=joints)), of_check
    yield (
        "one edge",
        lambda: motion.run(at, edge),
        lambda: engine.motions(at, edge, joints=joints, reduce="any"),
        of_result,
    )
    yield (
        "distances, min",
        lambda: least.run(at),
        lambda: engine.distances(configurations=at, joints=joints, reduce="min", fields="lower"),
        of_result,
    )


def measured(scene, seconds):
    """Rows of all calls."""
    engine = clearance.Engine(clearance.Scene.load(scene), backend="cpu", threads=1)
    joints = engine.joints(np.arange(len(engine.joint_states())))
    at = np.array([[joint.position for joint in engine.joint_states()]])
    for name, prepared, parsed, engine_ns in calls(engine, joints, at):
        row = {"call": name, "pairs": len(engine.pairs), "joints": len(joints)}
        for kind, evaluate in (("prepared", prepared), ("one_off", parsed)):
            took, own = medians(evaluate, engine_ns, seconds)
            row.setdefault("engine_us", round(own, 2))
            row |= {f"{kind}_us": round(took, 2), f"{kind}_adds_us": round(took - own, 2)}
            row[f"{kind}_ratio"] = round(took / own, 2)
        print(*(f"{key} {value}" for key, value in row.items()), sep=", ", flush=True)
        yield row


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--scene", type=Path, default=ROOT / "scenes/cell/robot.yaml")
    parser.add_argument("--seconds", type=float, default=1.0, help="of each measurement")
    parser.add_argument("--csv", type=Path, help="file to write")
    options = parser.parse_args()
    write(list(measured(options.scene, options.seconds)), options.csv)


if __name__ == "__main__":
    main()
