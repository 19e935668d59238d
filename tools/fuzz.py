#!/usr/bin/env python3
"""Runs the fuzz targets of build-fuzz and writes their results into a CSV file.

    tools/fuzz.py [--seconds 600] [--jobs 1] [--csv docs/results/fuzz.csv] [TARGET...]

Seeds are tests/fuzz/corpus/TARGET and regressions/TARGET. New inputs are kept in out/fuzz/corpus/TARGET, from which the
next run continues. An input that causes a failure is written to out/fuzz/findings, and the exit code is 1. Minimise it
(-minimize_crash=1), fix the cause, and keep it in tests/fuzz/regressions/TARGET under a descriptive name.
"""

import argparse
import base64
import csv
import os
import re
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PROGRAMS = ROOT / "build-fuzz" / "bin"
KEPT = ROOT / "tests" / "fuzz"
OUT = ROOT / "out" / "fuzz"

# Expected findings in third-party code, and their containment. These targets continue after a finding.
CONTAINED = {"mesh_import": "in assimp: it runs in a process of its own, which may end (target mesh_child)"}
# An input is a file or a few frames; longer ones find the same, but more slowly.
MAX_BYTES = 8192
PROGRESS = re.compile(r"#(\d+).*?cov: (\d+).*?corp: (\d+)")
WHY = re.compile(r"^broken promise|ERROR|runtime error|Assertion|^\s+#\d+ .*/(wire|server|engine|client|tests)/")
FINDINGS = ("crash-", "timeout-", "oom-", "leak-")


def run(target: str, seconds: int) -> dict:
    """Runs one target and returns its row of the table."""
    corpus = OUT / "corpus" / target
    findings = OUT / "findings" / target
    for folder in (corpus, findings):
        folder.mkdir(parents=True, exist_ok=True)
    before = set(findings.iterdir())
    seeds = [folder for folder in (KEPT / "corpus" / target, KEPT / "regressions" / target) if folder.is_dir()]
    command = [str(PROGRAMS / f"fuzz_{target}"), f"-max_total_time={seconds}", f"-max_len={MAX_BYTES}", "-timeout=20",
               "-entropic=0",  # its bookkeeping takes longer than the inputs, with as many edges as the engine has
               "-rss_limit_mb=4096", f"-artifact_prefix={findings}/"]
    if target in CONTAINED:
        command += ["-fork=1", "-ignore_crashes=1", "-ignore_timeouts=1", "-ignore_ooms=1", "-detect_leaks=0"]
    environment = {
        **os.environ,
        "OMP_NUM_THREADS": "1",
        "UBSAN_OPTIONS": "print_stacktrace=1",
        "CLEARANCE_CACHE": "off",
    }
    log = OUT / f"{target}.log"
    begin = time.monotonic()
    with log.open("w") as file:
        subprocess.run(["nice", "-n", "15", *command, str(corpus), *map(str, seeds)], env=environment, stdout=file,
                       stderr=subprocess.STDOUT, cwd=OUT)
    took = time.monotonic() - begin
    lines = log.read_text(errors="replace").splitlines()
    progress = [tuple(map(int, m.groups())) for m in map(PROGRESS.search, lines) if m]
    if not progress:
        sys.exit(f"{target} did not run; see {log}")
    found = sorted(p for p in set(findings.iterdir()) - before if p.name.startswith(FINDINGS))
    for path in found:
        print(f"  {path.relative_to(ROOT)}: {base64.b64encode(path.read_bytes()).decode()}")
    if found:  # the only record if a run's files are lost with its machine
        print(*[f"    {line[:200]}" for line in lines if WHY.search(line)][:20], sep="\n", flush=True)
    return {"target": target, "seconds": round(took), "executions": progress[-1][0], "corpus": progress[-1][2],
            "edges": max(p[1] for p in progress), "findings": len(found)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=int, default=600, help="for each target")
    parser.add_argument("--jobs", type=int, default=1, help="targets side by side")
    parser.add_argument("--csv", type=Path, help="rows of the targets that ran replace those that are there")
    parser.add_argument("targets", nargs="*")
    arguments = parser.parse_args()
    known = sorted(p.name[len("fuzz_"):] for p in PROGRAMS.glob("fuzz_*"))
    if not known:
        sys.exit("no fuzz targets in build-fuzz/bin: run tools/build.sh fuzz fuzzers")
    if unknown := set(arguments.targets) - set(known):
        sys.exit(f"no target {', '.join(sorted(unknown))}; there are {', '.join(known)}")
    rows, broken = {}, 0
    if arguments.csv and arguments.csv.is_file():
        with arguments.csv.open() as file:
            rows = {row["target"]: row for row in csv.DictReader(file) if row["target"] in known}
    targets = arguments.targets or known
    pool = ThreadPoolExecutor(arguments.jobs)
    for target, row in zip(targets, pool.map(lambda target: run(target, arguments.seconds), targets)):
        rows[target] = row
        note = ""
        if row["findings"] and target in CONTAINED:
            note = f" ({CONTAINED[target]})"
        else:
            broken += row["findings"]
        print(
            f"{target}: {row['executions']} inputs in {row['seconds']} s, {row['edges']} edges, corpus "
            f"{row['corpus']}, "
            f"findings {row['findings']}{note}",
            flush=True,
        )
        if arguments.csv:
            with arguments.csv.open("w", newline="") as file:
                writer = csv.DictWriter(file, list(row), lineterminator="\n")
                writer.writeheader()
                writer.writerows(rows[name] for name in sorted(rows))
    sys.exit(1 if broken else 0)


if __name__ == "__main__":
    main()
