"""Time that Python adds to the engine in one process: `bench_calls.py [SCENE] [SECONDS]`.

Each call is timed as a prepared query and as a one-off call, which parses its arguments, together with the engine's own
time in these calls (`engine_ns`: the checks of the query, its pairs, and its answer). It prints a row for each call:
medians in microseconds, what Python adds, and the ratio to the engine.
"""

import sys
import time

import numpy as np

import clearance


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


def main():
    scene = sys.argv[1] if len(sys.argv) > 1 else "scenes/cell/robot.yaml"
    seconds = float(sys.argv[2]) if len(sys.argv) > 2 else 0.5
    engine = clearance.Engine(clearance.Scene.load(scene), backend="cpu", threads=1)
    joints = engine.joints(np.arange(len(engine.joint_states())))
    at = np.array([[joint.position for joint in engine.joint_states()]])
    print(f"{scene}: {len(engine.pairs)} pairs, {len(joints)} joints")
    print(
        f"{'call':16} {'engine us':>9} {'prepared':>9} {'adds':>6} {'ratio':>6} {'parsed':>9} {'adds':>6} {'ratio':>6}"
    )
    for name, prepared, parsed, engine_ns in calls(engine, joints, at):
        row = []
        for evaluate in (prepared, parsed):
            took, own = medians(evaluate, engine_ns, seconds)
            row += [took, took - own, took / own]
            if evaluate is prepared:
                print(f"{name:16} {own:9.2f}", end="")
        print(" {:9.2f} {:6.2f} {:6.2f} {:9.2f} {:6.2f} {:6.2f}".format(*row))


if __name__ == "__main__":
    main()
