"""Latency and throughput of every transport, measured by `clearance bench` on a daemon that this script starts.

Writes one row for each measurement to out/latency.csv; docs/results/latency.csv is such a file.
"""
import argparse
import csv
import os
import subprocess
import sys
from pathlib import Path

from processes import DemoError, Stage
from service import BIN, ROUTE, start_daemon

ROOT = Path(__file__).resolve().parents[1]
# What is asked: pairs (0: all enabled), configurations (0: the current poses), and how often.
QUESTIONS = [
    {"pairs": 1, "configs": 0, "rate": "closed"},
    {"pairs": 0, "configs": 0, "rate": "closed"},
    {"pairs": 0, "configs": 0, "rate": "500"},
    {"pairs": 0, "configs": 100, "rate": "closed"},
]
NAMES = {"shm": "shared memory", "zmq": "ZeroMQ", "lcm": "LCM"}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--scene", default="scenes/nineteen/scene.yaml", type=Path, help="from the repository's folder")
    parser.add_argument("--seconds", default=5.0, type=float, help="of each measurement")
    parser.add_argument("--csv", default="out/latency.csv", type=Path, help="written anew")
    options = parser.parse_args()
    os.chdir(ROOT)
    options.csv.parent.mkdir(parents=True, exist_ok=True)
    options.csv.unlink(missing_ok=True)
    try:
        with Stage() as stage:
            run(stage, options)
    except KeyboardInterrupt:
        return 130
    except DemoError as error:
        print(f"bench: {error}", file=sys.stderr)
        return 1
    print(f"Written to {options.csv}")
    return 0


def run(stage, options):
    _, urls, _ = start_daemon(stage, options.scene)
    if "lcm" not in urls:
        print(f"LCM is left out: this machine has no multicast route. As root, this adds one: {ROUTE}")
    print(f"{options.scene}, {options.seconds:g} s each\n")
    print(f"{'transport':14} {'pairs':>6} {'configs':>7} {'rate':>7} {'p50 us':>9} {'p99 us':>9} {'p99.9 us':>9} "
          f"{'floor p50':>9} {'queries/s':>10}", flush=True)
    for question in QUESTIONS:
        for transport, url in urls.items():
            command = [BIN / "clearance", "bench", "--connect", url, "--seconds", options.seconds, "--csv", options.csv]
            command += [part for key, value in question.items() for part in (f"--{key}", value)]
            done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
            stage.check()
            if done.returncode:
                raise DemoError(f"clearance bench over {NAMES[transport]}: {done.stderr.strip()}")
            row = list(csv.DictReader(options.csv.open()))[-1]
            print(f"{NAMES[transport]:14} {row['pairs']:>6} {row['configs']:>7} {row['mode']:>7} {float(row['p50_us']):9.1f} "
                  f"{float(row['p99_us']):9.1f} {float(row['p99.9_us']):9.1f} {float(row['floor_p50_us']):9.1f} "
                  f"{float(row['throughput_hz']):10.0f}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
