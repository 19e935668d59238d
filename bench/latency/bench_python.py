"""How long the Python client takes for a query: `bench_python.py URL PAIRS SECONDS` prints medians [us] as JSON."""

import json
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "build/python"))
import clearance


def timed(ask, seconds):
    """Latencies and engine times in nanoseconds of calls, one after the other for so long."""
    took, engine = [], []
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        begin = time.perf_counter_ns()
        result = ask()
        took.append(time.perf_counter_ns() - begin)
        engine.append(result.engine_ns)
    return took, engine


def main():
    url, pairs, seconds = sys.argv[1], int(sys.argv[2]), float(sys.argv[3])
    with clearance.connect(url) as client:
        drawn = None if pairs == 0 else client.pairs[np.random.default_rng(1).permutation(len(client.pairs))[:pairs]]
        query = {"pairs": drawn, "fields": "default", "copy": False}
        prepared = client.prepare(**query)
        kinds = {"prepared": prepared, "distances": lambda: client.distances(**query)}
        numbers, engine = {}, []
        for kind, ask in kinds.items():
            timed(ask, 0.1)
            took, of_engine = timed(ask, seconds / len(kinds))
            numbers[f"{kind}_p50_us"] = 1e-3 * float(np.percentile(took, 50))
            numbers[f"{kind}_p99.9_us"] = 1e-3 * float(np.percentile(took, 99.9))
            engine += of_engine
        numbers["engine_p50_us"] = 1e-3 * float(np.median(engine))
    print(json.dumps(numbers))


if __name__ == "__main__":
    main()
