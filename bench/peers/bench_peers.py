#!/usr/bin/env python3
"""Clearance compared with Coal, FCL and Bullet: same vertices and poses, timed and checked for accuracy in one run.

    bench/run.py peers                     time every workload, then count wrong answers in every hard class
    bench/run.py peers --workload cell     only workloads with this in their names (repeatable); no classes
    bench/run.py peers --classes           the classes only

Builds the peers in build/peers (Coal in its own Python environment there), runs each in its own process, and writes
peers_timing.csv and peers_accuracy.csv. A workload that is left out keeps its rows.
"""
import argparse
import datetime
import os
import statistics
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np

from environment import python_of
from harness import RESULTS, ROOT, commit, grouped, machine, read, run, write
from pages.peers import LEFT_OUT, best

BUILD = ROOT / "build/peers"
PROBLEMS = ROOT / "out/peers"
EXPORT = ROOT / "build/bin/clearance-peers-export"
CONTENDERS = {
    "Clearance": ROOT / "build/bin/clearance-peers-ours",
    "Coal": BUILD / "coal/peer",
    "FCL": BUILD / "fcl/peer",
    "Bullet": BUILD / "bullet/peer",
    "Bullet f32": BUILD / "bullet/peer_f32",
}
CELL_CONFIGURATIONS = 4096


def set_up(peers=("coal", "fcl", "bullet")):
    """Builds each peer as a separate project, because Coal's prefix has other versions of FCL's dependencies."""
    venv = python_of("bench/peers").parents[1]
    prefix = next(venv.glob("lib/python3*/site-packages/cmeel.prefix"))
    for peer in peers:
        print(f"Build {peer}'s program ...", flush=True)
        where = [f"-DCMAKE_PREFIX_PATH={prefix}"] if peer == "coal" else []
        run("cmake", "-S", ROOT / "bench/peers" / peer, "-B", BUILD / peer, "-G", "Ninja", *where)
        run("cmake", "--build", BUILD / peer)


def versions():
    coal = run(BUILD / "venv/bin/python", "-m", "pip", "show", "coal").split("Version: ")[1].split()[0]
    debian = [run("dpkg-query", "-W", "-f", "${source:Upstream-Version}", p) for p in ("libfcl-dev", "libbullet-dev")]
    return f"Coal {coal}, FCL {debian[0]}, Bullet {debian[1]}"


# ---- problems --------------------------------------------------------------------------------------------------------


class Problem:
    """A file of bench/peers/problem.h, of which only the reference answers are read here."""

    def __init__(self, kind, name, count=0):
        self.name, self.path = name, PROBLEMS / f"{name}.bin"
        PROBLEMS.mkdir(parents=True, exist_ok=True)
        if not self.path.exists() or self.path.stat().st_mtime < EXPORT.stat().st_mtime:
            extra = link_poses() if name.startswith("cell") else []
            extra += ["--count", count] if kind == "class" else []
            run(EXPORT, f"--{kind}", name, "--scenes", ROOT / "scenes", "--out", self.path, *extra)
        with open(self.path, "rb") as f:
            kind, self.max_distance = struct.unpack("<8xId", f.read(20))
            self.depth = kind == 2
            self.truth, self.scale = (np.fromfile(f, count=np.fromfile(f, np.uint64, 1)[0]) for _ in range(2))
        self.count = len(self.truth)

    def errors(self, answers):
        """Relative error beyond 16 eps S of each answer whose exact distance is known; inf if the answer is missing."""
        known = ~np.isnan(self.truth) & ~(self.truth > self.max_distance)
        truth, answers, scale = self.truth[known], answers[known], self.scale[known]
        if not self.depth:
            truth, answers = np.maximum(truth, 0), np.maximum(answers, 0)
        error = np.abs(answers - truth)
        error[np.isnan(error)] = np.inf
        beyond = np.maximum(error - 16 * np.finfo(float).eps * scale, 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            relative = np.where(beyond == 0, 0, beyond / np.abs(truth))
        return error, relative, scale


def link_poses():
    """Random joint angles about the cell's home position, from the cell's own arm.py."""
    sys.path.insert(0, str(ROOT / "scenes/cell"))
    import arm
    turns = np.random.default_rng(1).uniform(-90, 90, (CELL_CONFIGURATIONS, len(arm.HOME)))
    poses = [arm.link_poses(np.array(arm.HOME) + t) for t in turns]
    path = PROBLEMS / "links.bin"
    np.array([list(p.values()) for p in poses]).tofile(path)
    return ["--links", ",".join(poses[0]), "--link-poses", path]


# ---- timing ----------------------------------------------------------------------------------------------------------


class Contender:
    """A contender's program on one problem."""

    def __init__(self, name, problem):
        self.name = name
        self.log = open(PROBLEMS / "stderr.txt", "w+")  # noqa: SIM115  # until close()
        self.process = subprocess.Popen([CONTENDERS[name], problem.path], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                        stderr=self.log, text=True, bufsize=1)
        line = self.process.stdout.readline().rstrip("\n").split("\t")
        self.settings = line[1:]  # empty if it rejected the problem
        if not self.settings:
            self.log.seek(0)
            self.rejection = self.log.read().strip().split(": ", 1)[-1]

    def _ask(self, line):
        self.process.stdin.write(line + "\n")
        answer = self.process.stdout.readline()
        if not answer:
            raise RuntimeError(f"{self.name} ended on \"{line}\"")
        return answer

    def time(self, setting, seconds):
        """Seconds of a pass: wall time, and processor time, which excludes other programs' turns."""
        _, wall, processor = self._ask(f"time {seconds} {setting}").split()
        return float(wall), float(processor)

    def answers(self, setting):
        path = PROBLEMS / "answers.bin"
        self._ask(f"write {path} {setting}")
        return np.fromfile(path)

    def close(self):
        self.process.stdin.close()
        self.process.wait()
        self.log.close()


def time_workload(problem, what, rounds, seconds):
    contenders = [Contender(name, problem) for name in CONTENDERS if (problem.name, name) not in LEFT_OUT]
    requested = [(c, s) for c in contenders for s in c.settings]
    load = os.getloadavg()[0]
    times = {key: [] for key in requested}
    for k in range(rounds + 1):
        for c, s in requested if k % 2 else reversed(requested):
            t = c.time(s, seconds)
            if k > 0:  # the first round is a warm-up
                times[c, s].append(t)
    rows = []

    def clock(s):
        return 0 if "threads" in s else 1  # the gain of several threads shows in wall time only

    for c, s in requested:
        ns = [1e9 * t[clock(s)] / problem.count for t in times[c, s]]
        error, relative, _ = problem.errors(c.answers(s))
        rows.append(
            {
                "workload": problem.name,
                "what": what,
                "pairs": problem.count,
                "contender": c.name,
                "setting": s,
                "ns_median": f"{statistics.median(ns):.4g}",
                "ns_least": f"{min(ns):.4g}",
                "ns_most": f"{max(ns):.4g}",
                "worst_relative_error": f"{relative.max():.2g}",
                "worst_error_m": f"{error.max():.2g}",
                "rounds": rounds,
                "load": f"{load:.1f}",
                "machine": machine(),
                "date": datetime.date.today().isoformat(),
                "commit": commit(),
            }
        )
    for c in contenders:
        if not c.settings:
            rows.append({"workload": problem.name, "what": what, "pairs": problem.count, "contender": c.name,
                         "setting": f"refused: {c.rejection}"[:80]})
        c.close()
    # Ratios within each round, so that another program's load affects both sides.
    ours = {s: times[c, s] for c, s in requested if c.name == "Clearance"}
    for (c, s), r in zip(requested, rows):
        for precision in ("f64", "f32"):
            ratios = [t[clock(s)] / m[clock(s)] for t, m in zip(times[c, s], ours[precision])]
            r[f"over_ours_{precision}"] = f"{statistics.median(ratios):.3g}"
    return rows


def show(rows):
    print(f"\n{rows[0]['what']} ({rows[0]['pairs']} pairs a pass, load {rows[0]['load']})")
    for r in rows:
        if not r.get("ns_median"):
            print(f"  {r['contender']:11} {r['setting']}")
            continue
        chosen, right = best(rows, r["contender"])
        mark = "*" if r is chosen and right else " "
        print(
            f" {mark}{r['contender']:11} {r['setting']:22} {float(r['ns_median']):11.0f} ns "
            f"[{float(r['ns_least']):.0f}, {float(r['ns_most']):.0f}]   error {float(r['worst_relative_error']):8.1e} "
            "  "
            f"{float(r['over_ours_f64']):7.2f} x ours f64 {float(r['over_ours_f32']):7.2f} x f32",
            flush=True,
        )


# ---- classes ---------------------------------------------------------------------------------------------------------

HARD = {"Clearance": ["f64"], "Coal": ["default", "default 1e-12"], "FCL": ["libccd signed"], "Bullet": ["gjk epa"],
        "Bullet f32": ["gjk epa"]}
PATIENCE_S = 10  # for one answer


def answer_one_by_one(contender, problem, setting):
    """(answers, crashes, hangs): a pair that ends the program is skipped, and another process continues."""
    path = PROBLEMS / "answers.bin"
    path.unlink(missing_ok=True)
    path.touch()
    ends = {"crash": 0, "hang": 0}

    def done():
        return path.stat().st_size // 8

    while done() < problem.count:
        process = subprocess.Popen([CONTENDERS[contender], problem.path, path, setting, str(done())],
                                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        before, end = done(), "crash"
        while True:
            try:
                process.wait(PATIENCE_S)
                break
            except subprocess.TimeoutExpired:
                if done() == before:
                    process.kill()
                    end = "hang"
                before = done()
        if done() < problem.count:
            with open(path, "ab") as f:
                f.write(struct.pack("<d", float("nan")))
            ends[end] += 1
    return np.fromfile(path), ends["crash"], ends["hang"]


def try_class(name, count):
    problem, rows = Problem("class", name, count), []
    for contender, settings in HARD.items():
        for setting in settings:
            if contender == "Clearance":
                c = Contender(contender, problem)
                answers, crashes, hangs = c.answers(setting), 0, 0
                c.close()
            else:
                answers, crashes, hangs = answer_one_by_one(contender, problem, setting)
            error, relative, scale = problem.errors(answers)
            given = ~np.isnan(answers)
            wrong, gross = relative[given] > 1e-6, relative[given] > 1e-3
            rows.append(
                {
                    "class": name,
                    "contender": contender,
                    "setting": setting,
                    "cases": problem.count,
                    "refused": int((~given).sum()) - crashes - hangs,
                    "crashed": crashes,
                    "hung": hangs,
                    "wrong": int(wrong.sum()),
                    "wrong_by_1e-3": int(gross.sum()),
                    "wrong_by_1e-6_of_size": int((error[given] > 1e-6 * scale[given]).sum()),
                    "apart_called_touching": int(
                        ((answers <= 0) & (problem.truth > 16 * 2**-52 * problem.scale)).sum()
                    ),
                    "worst_relative_error": f"{relative[given].max(initial=0):.2g}",
                    "worst_error_over_size": f"{(error / scale)[given].max(initial=0):.2g}",
                }
            )
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--workload", action="append", default=[], help="only those whose names hold this")
    parser.add_argument("--classes", action="store_true", help="only the classes of hard cases")
    parser.add_argument("--rounds", type=int, default=7, help="timed, after one that is not")
    parser.add_argument("--seconds", type=float, default=0.1, help="least time of one measurement")
    parser.add_argument("--cases", type=int, default=200, help="of each class")
    parser.add_argument("--results", type=Path, default=RESULTS, help="folder of the CSV files")
    options = parser.parse_args()
    os.chdir(ROOT)
    set_up()
    timing, accuracy = (options.results / f"peers_{kind}.csv" for kind in ("timing", "accuracy"))
    listed = [line.split("\t") for line in run(EXPORT, "--list").splitlines()]
    if not options.classes:
        kept = grouped(read(timing)[1] if timing.exists() else [], "workload")
        for _, name, what in (x for x in listed if x[0] == "workload"):
            if options.workload and not any(w in name for w in options.workload):
                continue
            kept[name] = time_workload(Problem("workload", name), what, options.rounds, options.seconds)
            show(kept[name])
            order = [x[1] for x in listed if x[1] in kept]
            write([r for name in order for r in kept[name]], timing, f"{versions()}, one thread")
    if not options.workload:
        rows = []
        for _, name, _ in (x for x in listed if x[0] == "class"):
            print(f"class {name} ...", flush=True)
            rows += try_class(name, options.cases)
            what = f"{options.cases} cases of each class, seed 1, {versions()}"
            write(rows, accuracy, f"{what}, {datetime.date.today()}, commit {commit()}")


if __name__ == "__main__":
    main()
