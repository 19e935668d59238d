"""How long requests of each kind keep the daemon's loop from its transports, and the latency of another client.

For each kind: a new daemon, a client that repeats the largest request of that kind, and at the same time `clearance
bench` with one pair over shared memory. Prints and writes, as CSV: the longest section of the loop by the wall clock
and in units of work, the total CPU time of the loop's thread, the other client's latency, and the CPU time that the
host of a virtual machine took meanwhile, which this program cannot influence.
"""

import argparse
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np

import harness
from harness import shown, write
from processes import DemoError, Stage
from service import BIN

BODIES = 5000
PIECES = 100
SCENE = f"""\
bodies:
  - {{name: first, sphere: 0.1, pose: [0, 0, 0, 1, 0, 0, 0]}}
  - {{name: second, sphere: 0.1, pose: [0, 0, 1, 1, 0, 0, 0]}}
random: {{count: {BODIES}, shape: {{uv_sphere: {{radius: 0.2, resolution: 5}}}}, box: 60, seed: 1}}
"""


def heap(path):
    """A mesh of many components, each an octahedron, in one file."""
    random = np.random.default_rng(1)
    lines = []
    for part in range(PIECES):
        centre = random.uniform(-1, 1, 3)
        lines.append(f"o part{part}")
        for axis in range(3):
            for sign in (-1, 1):
                corner = centre.copy()
                corner[axis] += 0.3 * sign
                lines.append("v {:.6f} {:.6f} {:.6f}".format(*corner))
        first = 6 * part + 1
        for x in (0, 1):
            for y in (2, 3):
                for z in (4, 5):
                    face = (x, y, z) if (x + y + z) % 2 else (x, z, y)
                    lines.append("f " + " ".join(str(first + corner) for corner in face))
    path.write_text("\n".join(lines) + "\n")


def write_scene(folder):
    heap(folder / "heap.obj")
    scene = folder / "scene.yaml"
    heaps = [
        f"  - {{name: heap{i}, mesh: heap.obj, mesh_as: parts, pose: [{0.1 * i}, 0, 0, 1, 0, 0, 0]}}\n"
        for i in range(4)
    ]
    scene.write_text(SCENE.replace("random:", "".join(heaps) + "random:", 1))
    return scene


def aggressor(kind, url, as_planning=False):
    """Repeats one kind of request until it is terminated. as_planning: below the class of its user."""
    import clearance

    client = clearance.connect(url, 600, **({"service_class": "planning"} if as_planning else {}))
    names = [body.name for body in client.bodies]
    heaps = [name for name in names if name.startswith("heap")]
    pose = [0.1, 0, 0, 1, 0, 0, 0]
    pairs = np.stack([np.arange(4_000_000) % 4000, 4001 + np.arange(4_000_000) % 900], axis=1).astype(np.uint32)
    requests = {
        "nothing": None,
        "groups": lambda: client.distances(
            pairs=[("*", "*"), ("*", "heap0")], reduce="min", configurations=[[pose]], bodies=["first"]
        ),
        "explicit pairs": lambda: client.distances(pairs=pairs, reduce="min"),
        "poses": lambda: client.set_poses(dict.fromkeys(names, pose)),
        "pieces with depths": lambda: client.distances(
            pairs=[(a, b) for a in heaps for b in heaps if a < b], signed_distance=True
        ),
        "within": lambda: client.distances(reduce="within", max_distance=0.5),
        "dense": lambda: client.distances(reduce="none", fields=["lower"], pairs=pairs),
        "small ones": lambda: client.distances(pairs=pairs[:200], signed_distance=True),
        "motions": lambda: client.motions(
            [[pose]],
            [[[20, 0, 0, 1, 0, 0, 0]]],
            bodies=["first"],
            pairs=[("first", name) for name in names[-200:]],
            reduce="none",
            abs_tol=1e-9,
            max_evaluations=65536,
        ),
    }
    send = requests[kind]
    print("ready", flush=True)
    while send:
        send()
    signal.pause()


KINDS = [
    "nothing", "groups", "explicit pairs", "poses", "pieces with depths", "within", "dense", "small ones", "motions",
]  # fmt: skip


def start_aggressor(stage, command, kind, url):
    """Starts an aggressor on the stage, and returns just before its first request."""
    client = stage.start("aggressor", [*command, "--aggressor", kind, url], stdout=subprocess.PIPE, text=True)
    if client.stdout.readline() != "ready\n":
        raise DemoError(f"the client that requests {kind} did not start: {stage.log('aggressor').strip()}")


def cpu_ms(pid):
    """CPU time so far of a process's first thread, which runs the daemon's loop."""
    return int(Path(f"/proc/{pid}/task/{pid}/schedstat").read_text().split()[0]) / 1e6


def stats(binaries, url):
    done = subprocess.run([binaries / "clearance", "stat", "--connect", url, "--json"], capture_output=True, text=True)
    return {row["counter"]: row["value"] for row in json.loads(done.stdout)} if done.returncode == 0 else {}


def stolen_ms():
    """CPU time so far that the host of a virtual machine gave to others while a program here needed it."""
    steal = Path("/proc/stat").read_text().split("\n", 1)[0].split()[8]
    return 1000 * int(steal) / os.sysconf("SC_CLK_TCK")


def quietest(rounds, measure_one):
    """The round in which the host took the least time, a choice that no program's result affects: (row, ms taken)."""
    got = []
    for _ in range(rounds):
        before = stolen_ms()
        row = measure_one()
        got.append((row, round(stolen_ms() - before)))
    return min(got, key=lambda one: one[1])


def bench_one_pair(binaries, url, seconds, load, prefix=()):
    """A row of `clearance bench`: one pair over shared memory, a thousand times a second."""
    command = [*prefix, binaries / "clearance", "bench", "--connect", url, "--pairs", "1", "--rate", "1000"]
    command += ["--warmup", "0", "--timeout", "120", "--seconds", str(seconds), "--json"]
    bench = subprocess.run(command, capture_output=True, text=True)
    if bench.returncode:
        raise DemoError(f"clearance bench next to {load}: {bench.stderr.strip()}")
    return json.loads(bench.stdout)[0]


def start_clearanced(stage, binaries, scene, options=(), prefix=()):
    """Starts a daemon with shared memory alone, and waits until it serves. Returns its process and its URL."""
    socket = stage.folder / "c.sock"
    command = [*prefix, binaries / "clearanced", "--scene", scene, "--shm", socket, *options]
    daemon = stage.start("clearanced", command)
    stage.wait_until(lambda: "event=ready" in stage.log("clearanced"), "the daemon", 600)
    return daemon, f"shm://{socket}"


def measure(kind, binaries, seconds):
    with Stage() as stage:
        daemon, url = start_clearanced(stage, binaries, write_scene(stage.folder))
        start_aggressor(stage, [sys.executable, __file__], kind, url)
        before, stolen = cpu_ms(daemon.pid), stolen_ms()
        row = bench_one_pair(binaries, url, seconds, kind)
        loop_cpu = cpu_ms(daemon.pid) - before
        stage.check()
        counters = stats(binaries, url)
        section = counters.get("loop.longest_section_ns")
        return {
            "request": kind,
            "section_us": "" if section is None else round(section / 1000),
            "section_units": counters.get("loop.longest_section_units", ""),
            "loop_cpu_ms": round(loop_cpu),
            "p50_us": round(row["p50_us"]),
            "p99.9_us": round(row["p99.9_us"]),
            "max_us": round(row["max_us"]),
            "stolen_ms": round(stolen_ms() - stolen),
            "load": round(os.getloadavg()[0], 1),
        }


def parser_of(doc):
    """Options shared by the benchmarks of daemons."""
    parser = harness.parser(doc)
    parser.add_argument("--binaries", type=Path, default=BIN, help="where clearanced and clearance are")
    return parser


def main():
    parser = parser_of(__doc__)
    parser.add_argument("--seconds", type=float, default=10)
    parser.add_argument("--kinds", nargs="*", default=KINDS, choices=KINDS)
    parser.add_argument("--aggressor", nargs=2, metavar=("KIND", "URL"), help=argparse.SUPPRESS)
    parser.add_argument("--as-planning", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.aggressor:
        kind, url = options.aggressor
        return aggressor(kind, url, options.as_planning)
    rows = shown(measure(kind, options.binaries, options.seconds) for kind in options.kinds)
    write(rows, options.csv)


if __name__ == "__main__":
    try:
        main()
    except DemoError as error:
        sys.exit(f"bench_sections: {error}")
