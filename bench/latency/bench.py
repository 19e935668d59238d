"""Latency and throughput of every transport, measured by `clearance bench` on daemons that this script starts.

Parts: latency (every transport and its baseline), python (the client's prepared query), doorbell (spinning and sleeping
with cores separate, shared and busy), throughput (one client, eight and 64; replies of 16 MB). Each writes
out/NAME.csv.
"""
import argparse
import json
import os
import statistics
import subprocess
import sys
from pathlib import Path

from harness import ROOT, read, write
from processes import DemoError, Stage
from service import BIN, ROUTE, start_daemon

# The queries: pairs (0 for all enabled), configurations (0 for the current poses), and rate.
QUESTIONS = [
    {"pairs": 1, "configs": 0, "rate": "closed"},
    {"pairs": 0, "configs": 0, "rate": "closed"},
    {"pairs": 0, "configs": 0, "rate": "500"},
    {"pairs": 0, "configs": 100, "rate": "closed"},
]
NAMES = {"shm": "shared memory", "zmq": "ZeroMQ", "lcm": "LCM"}
LONG_SPIN_US = 2000  # of a client with a core to spare
BUSY = "while True: pass"


class Machine:
    """Placement of daemon and clients: on separate cores if there are two, at the requested priority."""

    def __init__(self, real_time):
        self.cores = sorted(os.sched_getaffinity(0))
        self.priority = ["chrt", "-f", "1"] if real_time else []

    def on(self, core):
        """A command's prefix. `core` is an index into the cores of this process, limited to the last one."""
        return ["taskset", "-c", str(self.cores[min(core, len(self.cores) - 1)]), *self.priority]


def bench_row(stage, prefix, url, **options):
    """A row of `clearance bench`."""
    words = [word for name, value in options.items() for word in (f"--{name.replace('_', '-')}", value)]
    return json.loads(clearance(stage, prefix, "bench", "--connect", url, *words, "--json"))[0]


def clearance(stage, prefix, *words):
    """Runs the command line client and returns its output. Raises DemoError with its error message."""
    done = subprocess.run([*prefix, str(BIN / "clearance"), *map(str, words)], capture_output=True, text=True)
    stage.check()
    if done.returncode:
        raise DemoError(f"clearance {words[0]}: {done.stderr.strip()}")
    return done.stdout


def latency(machine, options, path):
    """Each transport with its baseline, and the targets: baseline, the engine's own time, and the overhead."""
    path.unlink(missing_ok=True)
    with Stage() as stage:
        _, urls, _ = start_daemon(stage, options.scene, machine.on(0))
        if "lcm" not in urls:
            print(f"LCM is left out: this machine has no multicast route. As root, this adds one: {ROUTE}")
        print(
            f"{'transport':14} {'pairs':>5} {'configs':>7} {'rate':>6} {'floor p50':>9} {'engine':>8} {'p50 us':>9} "
            f"{'added':>8} "
            f"{'bar: at most':>18} {'met':>4} {'p99.9':>9} {'over floor':>10} {'met':>4} {'queries/s':>9}",
            flush=True,
        )
        for question in QUESTIONS:
            for transport, url in urls.items():
                words = [part for key, value in question.items() for part in (f"--{key}", value)]
                if transport == "shm":
                    words += ["--spin-us", LONG_SPIN_US]
                clearance(
                    stage, machine.on(1), "bench", "--connect", url, "--seconds", options.seconds, "--csv", path, *words
                )
                row = read(path)[1][-1]
                number = {
                    key: float(value) for key, value in row.items() if key.endswith(("_us", "_hz", "bar", "limit"))
                }
                bar = f"{number['p50_bar']:.2f} {'us' if transport == 'shm' else 'x'}: {number['p50_bar_limit']:g}"
                print(
                    f"{NAMES[transport]:14} {row['pairs']:>5} {row['configs']:>7} {row['mode']:>6} "
                    f"{number['floor_p50_us']:9.2f} "
                    f"{number['engine_p50_us']:8.2f} {number['p50_us']:9.2f} {number['added_p50_us']:8.2f} {bar:>18} "
                    f"{row['p50_bar_met']:>4} {number['p99.9_us']:9.1f} {number['p99.9_bar']:10.2f} "
                    f"{row['p99.9_bar_met']:>4} "
                    f"{number['throughput_hz']:9.0f}",
                    flush=True,
                )


def python(machine, options, path):
    """The Python client's prepared query over shared memory, alternating with `clearance bench` of the same query."""
    with Stage() as stage:
        _, urls, _ = start_daemon(stage, options.scene, machine.on(0))
        rows = []
        for pairs in (1, 0):
            url = f"{urls['shm']}?spin_us={LONG_SPIN_US}"
            rounds = []
            for _ in range(5):
                seconds = options.seconds / 5
                bench = bench_row(stage, machine.on(1), url, pairs=pairs, seconds=seconds, warmup=0.2)
                program = [sys.executable, str(ROOT / "bench/latency/bench_python.py")]
                command = [*machine.on(1), *program, url, str(pairs), str(seconds)]
                done = subprocess.run(command, capture_output=True, text=True)
                if done.returncode:
                    raise DemoError(f"bench_python: {done.stderr.strip()}")
                rounds.append((bench, json.loads(done.stdout)))
            floor, cpp = (
                statistics.median_high(bench[key] for bench, _ in rounds) for key in ("floor_p50_us", "p50_us")
            )
            row = {"machine": rounds[0][0]["machine"], "date": rounds[0][0]["date"], "pairs": rounds[0][0]["pairs"],
                   "floor_p50_us": floor, "cpp_p50_us": cpp}
            row.update({key: statistics.median_high(mine[key] for _, mine in rounds) for key in rounds[0][1]})
            for kind in ("prepared", "distances"):
                row[f"{kind}_added_us"] = round(row[f"{kind}_p50_us"] - floor - row["engine_p50_us"], 3)
            row.update(
                bar_us=3,
                met="yes" if row["prepared_added_us"] <= 3 else "no",
                command="bench/run.py latency --parts python",
            )
            rows.append(row)
            print(
                f"Python, {row['pairs']} pairs: floor {floor:.2f} + engine {row['engine_p50_us']:.2f}; prepared "
                f"{row['prepared_p50_us']:.2f}: "
                f"added {row['prepared_added_us']:.2f} us, at most 3: {row['met']}; distances() added "
                f"{row['distances_added_us']:.2f} us",
                flush=True,
            )
        write(rows, path)


def doorbell(machine, options, path):
    """Spinning and sleeping: separate cores, one core for both, and other programs on every core."""
    rows = []
    for cores in ("apart", "together", "busy"):
        with Stage() as stage:
            if cores == "busy":
                for i in range(len(machine.cores)):
                    stage.start(f"busy{i}", [sys.executable, "-c", BUSY])
            # If all cores are busy, the scheduler is measured: no separate cores or priorities.
            server, client = {
                "apart": (machine.on(0), machine.on(1)),
                "together": (machine.on(0), machine.on(0)),
                "busy": ([], []),
            }[cores]
            _, urls, _ = start_daemon(stage, options.scene, server)
            for pairs in (1, 0):
                for spin_us in (0, 20, LONG_SPIN_US):
                    seconds = options.seconds / 2
                    row = bench_row(
                        stage, client, urls["shm"], spin_us=spin_us, pairs=pairs, seconds=seconds, warmup=0.3
                    )
                    rows.append({"cores": cores, "client_spin_us": spin_us, **row})
                    print(
                        f"cores {cores:9} {row['pairs']:>4} pairs, client spins {spin_us:>4} us: p50 "
                        f"{row['p50_us']:8.2f}, p99 {row['p99_us']:9.2f}, "
                        f"transport {row['transport_p50_us']:8.2f}; floor {row['floor_p50_us']:6.2f}; "
                        f"{row['throughput_hz']:.0f} queries/s",
                        flush=True,
                    )
    write(rows, path)


def throughput(machine, options, path):
    """Small queries of one client, of eight and of 64, and replies of 16 MB compared with a memcpy of the same size."""
    path.unlink(missing_ok=True)
    with Stage() as stage:
        _, urls, _ = start_daemon(stage, options.scene, machine.on(0))
        for transport, url in urls.items():
            for words in (
                ["--pairs", 1],
                ["--pairs", 1, "--depth", 8],
                ["--pairs", 1, "--clients", 8],
                ["--pairs", 8, "--clients", 64],
                ["--configs", 7200, "--max-distance", 1e-3],
            ):
                if transport != "shm" and "--configs" in words:
                    continue
                words = ["--connect", url, "--seconds", options.seconds, "--csv", path, *words]
                print(clearance(stage, machine.on(1), "bench", "throughput", *words), flush=True)


PARTS = {"latency": latency, "python": python, "doorbell": doorbell, "throughput": throughput}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS), metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--scene", default="scenes/nineteen/scene.yaml", type=Path, help="from the repository's folder")
    parser.add_argument("--seconds", default=5.0, type=float, help="of each measurement")
    parser.add_argument("--out", default="out", type=Path, help="folder of the CSV files, written anew")
    parser.add_argument(
        "--real-time", action="store_true", help="daemon and bench at real-time priority, on a machine that is shared"
    )
    options = parser.parse_args()
    os.chdir(ROOT)
    options.out.mkdir(parents=True, exist_ok=True)
    machine = Machine(options.real_time)
    try:
        for part in options.parts:
            path = options.out / ("latency.csv" if part == "latency" else f"latency_{part}.csv")
            print(
                f"{part}: {PARTS[part].__doc__} {options.scene}, {options.seconds:g} s each; load "
                f"{os.getloadavg()[0]:.1f}"
            )
            PARTS[part](machine, options, path)
            print(f"Written to {path}\n")
    except KeyboardInterrupt:
        return 130
    except DemoError as error:
        print(f"bench: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
