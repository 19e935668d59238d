"""Shared by the benchmark programs: options, timing, result rows and their CSV files."""

import argparse
import csv
import datetime
import functools
import os
import platform
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "docs/results"
STAMP = "# measured "  # begin of the line with which bench/run.py dates a CSV file


def parser(doc, seed=None):
    """Parser with --csv and, if a seed is given, --seed. Its description is the first line of `doc`."""
    made = argparse.ArgumentParser(description=doc.strip().splitlines()[0])
    made.add_argument("--csv", type=Path, help="file to write")
    if seed is not None:
        made.add_argument("--seed", type=int, default=seed)
    return made


def timed(call, *args, clock=time.process_time, **more):
    """Returns (seconds, result) of one call."""
    begin = clock()
    result = call(*args, **more)
    return clock() - begin, result


# ---- rows ------------------------------------------------------------------------------------------------------------


def shown(rows):
    """Prints rows as they come, and returns all of them."""
    kept = []
    for row in rows:
        kept.append(row)
        print("  ".join(f"{name} {value}" for name, value in row.items() if value != ""), flush=True)
    return kept


def write(rows, path, remark=None):
    """Writes rows as CSV, preceded by the remark as a comment. Without a path nothing is written."""
    if path is None:
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    columns = list(dict.fromkeys(name for row in rows for name in row))
    with path.open("w", newline="") as file:
        if remark:
            file.write(f"# {remark}\n")
        writer = csv.DictWriter(file, columns, restval="", lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def read(path):
    """Returns (remark, rows) of a CSV file. The remark is its first comment without that of stamp(), or empty."""
    lines = path.read_text().splitlines()
    comments = [line.lstrip("# ").strip() for line in lines if line.startswith("#") and not line.startswith(STAMP)]
    return (comments or [""])[0], list(csv.DictReader(line for line in lines if not line.startswith("#")))


def grouped(rows, *keys):
    """Rows by the value of one column, or by the values of several."""
    groups = {}
    for row in rows:
        groups.setdefault(row[keys[0]] if len(keys) == 1 else tuple(row[key] for key in keys), []).append(row)
    return groups


# ---- where and when --------------------------------------------------------------------------------------------------


def stamped(remark):
    """The remark with machine, date and load."""
    return f"{remark}; {machine()}, {datetime.date.today()}, one thread, load {os.getloadavg()[0]:.0f}"


def stamp(path, minutes):
    """Begins a CSV file with a comment of the date, the commit, the minutes of the suite, and the machine."""
    lines = [line for line in path.read_text().splitlines(keepends=True) if not line.startswith(STAMP)]
    line = f"{STAMP}{datetime.date.today()}, commit {commit()}, {minutes:.1f} minutes, {machine()}\n"
    path.write_text("".join([line, *lines]))


def stamp_of(path):
    """The comment of stamp() in a CSV file, or an empty string."""
    lines = path.read_text().splitlines() if path.exists() else []
    return next((line.lstrip("# ") for line in lines if line.startswith(STAMP)), "")


@functools.cache
def machine():
    """The processor's name, and the number of processors."""
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    names = (line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    return f"{next(names, platform.machine())} x{os.cpu_count()}"


@functools.cache
def commit():
    """HEAD, followed by + if files other than those written by benchmarks differ from it."""
    changed = run("git", "status", "--porcelain", "--", ".", ":!docs")
    return run("git", "rev-parse", "--short=8", "HEAD").strip() + ("+" if changed else "")


def run(*command):
    """Runs a command in the repository and returns its output. Exits with that output if it fails."""
    words = [str(word) for word in command]
    done = subprocess.run(words, capture_output=True, text=True, cwd=ROOT)
    if done.returncode:
        sys.exit(f"{' '.join(words)}\n{done.stdout[-3000:]}{done.stderr[-3000:]}")
    return done.stdout
