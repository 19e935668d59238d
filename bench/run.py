#!/usr/bin/env python3
"""Runs benchmarks: builds the targets of a suite, installs its peers, measures, and rewrites results and pages.

    bench/run.py list                         lists the suites, and the files that each rewrites
    bench/run.py SUITE... [OPTION...]         options of the suites' programs, such as --rounds 5
    bench/run.py all                          runs every suite, also after one that fails; the last lines list all. The
                                              defaults of the suites are for 90 minutes on two quiet cores
    bench/run.py --quick SUITE...             a small run: writes to out/bench and no pages
"""

import argparse
import subprocess
import sys
import time
from dataclasses import dataclass

from environment import ROOT, python_of, variables
from harness import stamp, stamp_of

VENV = ROOT / ".venv/bin/python"
ROBOTS = "bench/robots"


@dataclass(frozen=True)
class Suite:
    what: str  # a sentence
    program: str  # a Python program of bench, or a binary
    rewrites: str  # names of CSV files, without .csv
    quick: str  # options of a small run
    options: str = "--csv {results}/{name}.csv"  # where the program writes
    results: str = "docs/results"  # folder of the CSV files
    targets: str = "product"  # build target
    packages: str = ""  # list of Debian packages
    python: str = ""  # folder of the Python requirements; .venv if empty
    pages: str = ""  # pages that show the results
    draw: str = ""  # a picture of bench/write_pages.py

    def files(self):
        """Files that a run rewrites."""
        return [*(f"{self.results}/{name}.csv" for name in self.rewrites.split()), *self.pages.split()]


SUITES = {
    "latency": Suite(
        "Latency and throughput of every transport, with baselines and targets.",
        "bench/latency/bench.py", "latency latency_python latency_doorbell latency_throughput", "--seconds 0.2",
        options="--out {results}", results="out"),
    "calls": Suite(
        "Time that C++, Python and shared memory add to the engine: prepared and one-off calls.",
        "bench/latency/bench_calls.py", "calls", "--seconds 0.05", targets="product clearance_prepared"),
    "columns": Suite(
        "Rows of a QP with each optional column, in process and over shared memory.",
        "bench/latency/bench_columns.py", "columns", "--seconds 0.05", pages="docs/control.md"),
    "peers": Suite(
        "Pairs of hulls, compared with Coal, FCL and Bullet: times, and wrong answers in hard cases.",
        "bench/peers/bench_peers.py", "peers_timing peers_accuracy",
        "--workload gap_1mm_42 --rounds 1 --seconds 0.01", options="--results {results}",
        targets="clearance-peers-export clearance-peers-ours", packages="tools/packages/peers.txt",
        pages="docs/performance.md docs/pictures/performance.png docs/trust/accuracy.md", draw="peers"),
    "broad": Suite(
        "Ways to find near pairs, alone and within queries.",
        "build/bin/clearance-broad", "broad", "--bodies 120 --rounds 2", targets="clearance-broad",
        pages="docs/notes/performance.md"),
    "sections": Suite(
        "The longest that the daemon's loop is away from its transports, by kind of request.",
        "bench/latency/bench_sections.py", "sections", "--seconds 0.5 --kinds nothing groups"),
    "classes": Suite(
        "Waiting times of a client of the class control, next to the worst clients of the class planning.",
        "bench/latency/bench_classes.py", "classes", "--seconds 0.5 --rounds 1 --kinds groups",
        pages="docs/service/latency.md"),
    "view": Suite(
        "Waiting times of a control loop while a viewer reads its daemon.",
        "bench/latency/bench_view.py", "view", "--seconds 0.5 --turns 1", pages="docs/examples.md"),
    "robots": Suite(
        "MotionBenchMaker's states: validity and least distance, compared with Pinocchio and Coal.",
        "bench/robots/bench_robots.py", "robots", "--robots panda --problems 1 --states 5 --rounds 1",
        python=ROBOTS, pages="docs/performance.md docs/pictures/robots.png", draw="robots"),
    "rrt": Suite(
        "The same problems planned by RRT-Connect, end to end, compared with Pinocchio and Coal.",
        "bench/robots/bench_rrt.py", "rrt", "--robots panda --problems 1 --rounds 1", python=ROBOTS,
        pages="docs/performance.md docs/pictures/robots.png", draw="robots"),
    "plans": Suite(
        "The same problems planned by plan(), every motion proved.",
        "bench/robots/bench_plans.py", "plans", "--robots panda --problems 1 --rounds 1", targets="clearance-plans",
        python=ROBOTS, pages="docs/planning.md"),
    "motions": Suite(
        "Edges of these problems, proved free over their whole length, compared with sampling; verdicts alone.",
        "bench/robots/bench_motions.py", "motions",
        "--robots panda --problems 1 --edges 5 --verdicts 20 --rounds 1", targets="product clearance_prepared",
        python=ROBOTS, pages="docs/motions.md"),
    "free_bodies": Suite(
        "Motions of free bodies, compared with FCL's continuous collision.",
        "bench/robots/bench_free_bodies.py", "free_bodies", "--motions 20", python=ROBOTS),
    "ompl": Suite(
        "These problems planned by OMPL, with sampled and with proved edges.",
        "bench/robots/bench_ompl.py", "ompl", "--robots panda --problems 1 --seconds 5", python=ROBOTS),
    "surfaces": Suite(
        "Meshes that are not convex, compared with Coal.",
        "bench/surfaces/bench_surfaces.py", "surfaces", "--poses 8 --sizes 1000", python=ROBOTS,
        pages="docs/performance.md"),
    "link_meshes": Suite(
        "A robot's links and a concave mesh, compared with Pinocchio and Coal.",
        "bench/robots/bench_link_meshes.py", "link_meshes", "--robots panda --states 10 --rounds 1", python=ROBOTS,
        pages="docs/performance.md"),
    "clouds": Suite(
        "Points against a robot, compared with Coal's octree.",
        "bench/surfaces/bench_clouds.py", "clouds", "--points 5000 --states 3", python=ROBOTS,
        pages="docs/performance.md"),
    "sweep": Suite(
        "A sweep on Ray, compared with the engine alone.",
        "bench/sweep/bench_sweep.py", "sweep", "--rounds 1 --parts 2 --part-rows 64", python="bench/sweep"),
    "load": Suite(
        "Loading 1000 meshes without a cache, with an empty one and with a full one.",
        "bench/load/bench_load.py", "load", "--meshes 5 --runs 1"),
    "changes": Suite(
        "Changes of a scene in process, compared with new engines.",
        "bench/load/bench_changes.py", "changes", "--bodies 10 --runs 3"),
    "tradeoff": Suite(
        "Time against tolerance and margin: robots, edges, true meshes, clouds, numerical extremes.",
        "bench/tradeoff/bench_tradeoff.py", "tradeoff tradeoff_models tradeoff_extremes",
        "--robots panda --problems 1 --states 6 --rounds 1", options="--results {results}", python="bench/tradeoff",
        pages="docs/tradeoff.md docs/pictures/tradeoff.png", draw="tradeoff"),
    "report": Suite(
        "The experiments of the 2023 report with its systems, ours and Coal.",
        "bench/report/bench_report.py", "report", "--brief", targets="clearance-report",
        pages="docs/notes/report.md docs/pictures/report.png", draw="report"),
}  # fmt: skip


def show_suites():
    for name, suite in SUITES.items():
        print(f"  {name:<12} {suite.what}\n  {'':<12} {' '.join(suite.files())}")
        stamps = {stamp_of(ROOT / file) for file in suite.files() if file.endswith(".csv")}
        for found in sorted(filter(None, stamps)):
            print(f"  {'':<12} {found}")
    print(f"  {'pages':<12} The tables of docs/ from docs/results, without measuring.")


def call(*command, **more):
    """Runs a command in the repository. Raises CalledProcessError if it fails."""
    subprocess.run([str(word) for word in command], cwd=ROOT, check=True, **more)


def write_pages(*options):
    call(VENV, "bench/write_pages.py", *options)


def run(name, options, quick):
    suite = SUITES[name]
    call("tools/setup.sh", *suite.packages.split())
    call("tools/build.sh", "release", *suite.targets.split())
    results = "out/bench" if quick else suite.results
    (ROOT / results).mkdir(parents=True, exist_ok=True)
    command = [suite.program, *suite.options.format(results=results, name=name).split()]
    if suite.program.endswith(".py"):
        command.insert(0, python_of(suite.python, VENV) if suite.python else VENV)
    files = [ROOT / results / f"{file}.csv" for file in suite.rewrites.split()]
    old, begin = [modified(file) for file in files], time.monotonic()
    call(*command, *suite.quick.split() * quick, *options, env=variables())
    minutes = (time.monotonic() - begin) / 60
    for file, before in zip(files, old):
        if modified(file) != before:
            stamp(file, minutes)
    if suite.pages and not quick:
        write_pages(*(["--draw", suite.draw] if suite.draw else []))


def modified(file):
    """Time of a file's last change, or None without a file."""
    return file.stat().st_mtime_ns if file.exists() else None


def attempt(name, options, quick):
    """Runs a suite, or another word of the command line. Returns whether it succeeded."""
    try:
        if name == "list":
            show_suites()
        elif name == "pages":
            call("tools/setup.sh")
            write_pages(*options)
        else:
            print(f"{name}: {SUITES[name].what}", flush=True)
            run(name, options, quick)
    except (OSError, subprocess.CalledProcessError, SystemExit) as error:
        print(f"bench: {name}: {error}", file=sys.stderr)
        return False
    return True


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a small run, into out/bench")
    parser.add_argument("words", nargs=argparse.REMAINDER, metavar="SUITE... [OPTION...]")
    given = parser.parse_args()
    first = next((i for i, word in enumerate(given.words) if word.startswith("-")), len(given.words))
    names, options = given.words[:first], given.words[first:]
    if names == ["all"]:
        names = list(SUITES)
    unknown = [name for name in names if name not in (*SUITES, "list", "pages")]
    if unknown or not names:
        parser.error(f"no suite {' '.join(unknown)!r}; there are all, list, pages, {', '.join(SUITES)}")
    failed, lines = [], []
    for name in names:
        begin = time.monotonic()
        if not attempt(name, options, given.quick):
            failed.append(name)
        outcome = "failed" if name in failed else "done"
        lines.append(f"bench: {name:<12} {outcome:<6} {(time.monotonic() - begin) / 60:6.1f} minutes")
    if len(names) > 1:
        print("\n".join(lines), flush=True)
    return f"bench: failed: {' '.join(failed)}" if failed else 0


if __name__ == "__main__":
    sys.exit(main())
