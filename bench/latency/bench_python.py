"""Query times of the Python client: `bench_python.py URL PAIRS SECONDS` prints medians [us] as JSON.

`bench_python.py --batches BUSY SECONDS` times batches on engines in this process, alternately with all cores
(threads=0) and with one, alone and with BUSY processes that keep the cores busy. It prints a row for each batch size:
configurations, microseconds per configuration with one thread and with all (median, 99th percentile of the whole batch
in ms), and the ratio of the medians.
"""

import contextlib
import json
import os
import subprocess
import sys
import time

import numpy as np

import clearance


def timed(evaluate, seconds):
    """Latencies and engine times of successive calls for the given time, in nanoseconds."""
    took, engine = [], []
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        begin = time.perf_counter_ns()
        result = evaluate()
        took.append(time.perf_counter_ns() - begin)
        engine.append(result.engine_ns)
    return took, engine


@contextlib.contextmanager
def busy_processes(count):
    """Keeps that many processes busy."""
    running = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for process in running:
            process.kill()
            process.wait()


def batches_of_hulls(bodies=40, vertices=60, spread=2.5):
    """A scene of random hulls, and poses of all of them in batches of several sizes."""
    rng = np.random.default_rng(9)
    scene = clearance.Scene()
    for i in range(bodies):
        scene.add_hull(f"b{i}", rng.normal(size=(vertices, 3)) * 0.3)
    batches = {}
    for count in (2, 8, 32, 128, 512):
        turns = rng.normal(size=(count, bodies, 4))
        turns /= np.linalg.norm(turns, axis=-1, keepdims=True)
        batches[count] = np.concatenate([rng.uniform(-spread, spread, (count, bodies, 3)), turns], -1)
    return scene, batches


def time_batches(load, seconds):
    scene, batches = batches_of_hulls()
    engines = {threads: clearance.Engine(scene, backend="cpu", threads=threads) for threads in (1, 0)}
    questions = {
        "check": lambda engine, poses: engine.check(poses),
        "min": lambda engine, poses: engine.distances(configurations=poses, reduce="min", fields="lower"),
        "none": lambda engine, poses: engine.distances(configurations=poses, fields="lower"),
    }
    for question, evaluate in questions.items():
        for count, poses in batches.items():
            took = {threads: [] for threads in engines}
            end = time.perf_counter() + seconds
            while time.perf_counter() < end or len(took[0]) < 5:
                for threads, engine in engines.items():  # alternating, so that other load affects both
                    begin = time.perf_counter()
                    evaluate(engine, poses)
                    took[threads].append(time.perf_counter() - begin)
            row = []
            for threads in (1, 0):
                row += [
                    f"{1e6 * np.median(took[threads]) / count:9.1f}",
                    f"{1e3 * np.percentile(took[threads], 99):9.2f}",
                ]
            print(
                f"{load:8} {question:6} {count:5}", *row, f"{np.median(took[0]) / np.median(took[1]):8.2f}", flush=True
            )


def batches(busy, seconds):
    os.environ["CLEARANCE_CACHE"] = "off"
    print("load     reduce count   1: us   p99 ms   0: us   p99 ms   ratio")
    time_batches("alone", seconds)
    with busy_processes(busy):
        time_batches(f"{busy} busy", seconds)


def main():
    if sys.argv[1] == "--batches":
        return batches(int(sys.argv[2]), float(sys.argv[3]))
    url, pairs, seconds = sys.argv[1], int(sys.argv[2]), float(sys.argv[3])
    with clearance.connect(url) as client:
        drawn = None if pairs == 0 else client.pairs[np.random.default_rng(1).permutation(len(client.pairs))[:pairs]]
        prepared = client.prepare("distances", pairs=drawn, fields="default", copy=False)
        kinds = {"prepared": prepared.run, "distances": lambda: client.distances(drawn, fields="default")}
        numbers, engine = {}, []
        for kind, evaluate in kinds.items():
            timed(evaluate, 0.1)
            took, of_engine = timed(evaluate, seconds / len(kinds))
            numbers[f"{kind}_p50_us"] = 1e-3 * float(np.percentile(took, 50))
            numbers[f"{kind}_p99.9_us"] = 1e-3 * float(np.percentile(took, 99.9))
            engine += of_engine
        numbers["engine_p50_us"] = 1e-3 * float(np.median(engine))
    print(json.dumps(numbers))


if __name__ == "__main__":
    main()
