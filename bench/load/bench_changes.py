#!/usr/bin/env python3
"""Time of a change of the scene, compared with a new engine of the same scene.

    bench/run.py changes [--bodies 10 200 2000] [--runs 20]

Scenes of boxes of different sizes, on one thread of the CPU. `first_engine` is the first Engine of a process, which
also checks the instruction sets (the self-test); `engine` a later one, of a scene with one more body. The others are
the same change by `add_body`, `replace` and `remove_body`. Medians, in milliseconds.
"""

import statistics
import subprocess
import sys
import time

from harness import parser, shown, write

FIRST = """
import time, clearance
scene = clearance.Scene()
begin = time.perf_counter()
clearance.Engine(scene, threads=1)
print(time.perf_counter() - begin)
"""
POSE = [0, 5, 0, 1, 0, 0, 0]


def seconds_of(call):
    begin = time.perf_counter()
    call()
    return time.perf_counter() - begin


def scene_of(clearance, bodies):
    scene = clearance.Scene()
    for i in range(bodies):
        scene.add_box(f"body{i}", [0.1, 0.1, 0.1 + 1e-5 * i], pose=[0.2 * i, 0, 0, 1, 0, 0, 0])
    return scene


def measure(clearance, bodies, runs):
    """Lists of seconds of each change."""
    scene = scene_of(clearance, bodies)
    engine = clearance.Engine(scene, threads=1)
    times = {"engine": [], "add_body": [], "replace": [], "remove_body": []}
    for i in range(runs):
        scene.add_box(f"more{i}", [0.1, 0.1, 0.1], pose=POSE)
        times["engine"].append(seconds_of(lambda: clearance.Engine(scene, threads=1)))
        times["add_body"].append(seconds_of(lambda: engine.add_body("part", box=[0.1, 0.1, 0.1], pose=POSE)))
        times["replace"].append(seconds_of(lambda: engine.replace("part", sphere=0.1)))
        times["remove_body"].append(seconds_of(lambda: engine.remove_body("part")))
    return times


def rows_of(options):
    import clearance

    first = statistics.median(
        float(subprocess.run([sys.executable, "-c", FIRST], capture_output=True, text=True, check=True).stdout)
        for _ in range(5)
    )
    for bodies in options.bodies:
        times = {"first_engine": [first], **measure(clearance, bodies, options.runs)}
        added = statistics.median(times["add_body"])
        for what, seconds in times.items():
            median = statistics.median(seconds)
            yield {"bodies": bodies, "what": what, "ms": f"{1e3 * median:.3f}", "of_add_body": f"{median / added:.1f}"}


def main() -> None:
    made = parser(__doc__)
    made.add_argument("--bodies", type=int, nargs="+", default=[10, 200, 2000])
    made.add_argument("--runs", type=int, default=20, help="of each; the median counts")
    options = made.parse_args()
    write(shown(rows_of(options)), options.csv)


if __name__ == "__main__":
    main()
