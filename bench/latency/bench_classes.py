"""Latency of a client of class control, alongside each worst legal client of class planning.

A query of one pair over shared memory, a thousand times a second: first alongside programs that only keep CPUs busy, as
many as the daemon's compute threads, then alongside each aggressor of bench_sections.py, whose queries are of class
planning. All of it is repeated with a daemon with --real-time. Prints and writes, as CSV: p50, p99.9 and max, the ratio
of p99.9 to that with the busy programs, and the CPU time that the host of a virtual machine took. Of several rounds,
the one with the least of it counts. With four CPUs or more the client and the daemon have CPUs of their own, which the
aggressor and the busy programs avoid. The client runs at real-time priority, as a controller does, all others at one
priority above other programs (both if permitted).
"""

import contextlib
import os
import subprocess
import sys
from pathlib import Path

from bench_sections import KINDS, bench_one_pair, parser_of, quietest, start_aggressor, start_clearanced, write_scene

from harness import shown, write
from processes import DemoError, Stage

MOST_RATIO, MOST_MS_SHARED = 2, 10
SECTIONS = Path(__file__).with_name("bench_sections.py")


class Cpus:
    """Assignment of CPUs to the client, the daemon, and all others."""

    def __init__(self):
        cpus = sorted(os.sched_getaffinity(0))
        self.are_shared = len(cpus) < 4
        half = len(cpus) // 2
        own = cpus[:1], cpus[1:half], cpus[half:]
        self.client, self.daemon, self.others = (cpus, cpus, cpus) if self.are_shared else own

    @staticmethod
    def run_on(cpus):
        return ["taskset", "-c", ",".join(map(str, cpus))]


class Priority:
    """Priorities above other programs, if permitted: real time for the client, and a common one for all others.

    They apply to sessions if the kernel shares CPUs by session (autogroup), otherwise to processes.
    """

    def __init__(self):
        self.prefix = self.allowed(["nice", "-n", "-15"])
        self.of_client = self.allowed(["chrt", "-f", "20"])
        self.raise_session("self")

    @staticmethod
    def allowed(prefix):
        """The prefix, or nothing if the kernel rejects it: even root of a container may lack the right."""
        done = subprocess.run([*prefix, "true"], capture_output=True)
        return [] if done.returncode or done.stderr else prefix

    def raise_session(self, pid):
        with contextlib.suppress(OSError):
            Path(f"/proc/{pid}/autogroup").write_text("-15")


class Players(Stage):
    """Starts processes at that priority."""

    def __init__(self, priority):
        super().__init__()
        self.priority = priority

    def start(self, name, command, **options):
        child = super().start(name, [*self.priority.prefix, *command], **options)
        self.priority.raise_session(child.pid)
        return child


def control_options(real_time):
    """Options of a daemon that assign this user's clients to the class control."""
    return ["--control-user", str(os.geteuid()), *(["--real-time"] if real_time else [])]


def measure(kind, cpus, options, priority, real_time):
    """One row: the client alongside one aggressor or busy programs."""
    with Players(priority) as stage:
        of_daemon = control_options(real_time), cpus.run_on(cpus.daemon)
        _, url = start_clearanced(stage, options.binaries, write_scene(stage.folder), *of_daemon)
        others = [*cpus.run_on(cpus.others), sys.executable]
        if kind == "busy CPUs":  # as the daemon's threads keep them busy at most
            for i in range(len(cpus.daemon)):
                stage.start(f"busy{i}", [*others, "-c", "while True: pass"])
        else:
            start_aggressor(stage, [*others, SECTIONS, "--as-planning"], kind, url)
        client = [*priority.of_client, *cpus.run_on(cpus.client)]
        arguments = (options.binaries, url, options.seconds, kind, client)
        row, stolen = quietest(options.rounds, lambda: bench_one_pair(*arguments))
        stage.check()
        return {**row, "stolen_ms": stolen}


def row_of(kind, got, base, are_shared, real_time):
    """base: p99.9 alongside the busy programs, in us."""
    ratio, more_ms = got["p99.9_us"] / base, (got["p99.9_us"] - base) / 1000
    return {
        "daemon": "--real-time" if real_time else "ordinary",
        "cpus": "shared" if are_shared else "own",
        "beside": kind,
        **{name: round(got[name], 1) for name in ("p50_us", "p99.9_us", "max_us", "stolen_ms")},
        "ratio": round(ratio, 2),
        "more_ms": round(more_ms, 2),
        "met": "yes" if (more_ms <= MOST_MS_SHARED if are_shared else ratio <= MOST_RATIO) else "no",
        "load": round(os.getloadavg()[0], 1),
    }


def main():
    parser = parser_of(__doc__)
    parser.add_argument("--seconds", type=float, default=5, help="of each round")
    parser.add_argument(
        "--rounds", type=int, default=3, help="of each row; the one counts that the host disturbed least"
    )
    parser.add_argument("--kinds", nargs="*", default=[kind for kind in KINDS if kind != "nothing"], choices=KINDS)
    options = parser.parse_args()
    write(shown(rows_of(options)), options.csv)


def rows_of(options):
    cpus = Cpus()
    priority = Priority()
    for real_time in (False, True):
        base = None
        for kind in ["busy CPUs", *options.kinds]:
            got = measure(kind, cpus, options, priority, real_time)
            base = base or got["p99.9_us"]
            yield row_of(kind, got, base, cpus.are_shared, real_time)


if __name__ == "__main__":
    try:
        main()
    except DemoError as error:
        sys.exit(f"bench_classes: {error}")
