"""What a benchmark measured, row by row: shown as it comes, and kept in a file."""

import csv
import datetime
import os
import platform
from pathlib import Path


def show(row):
    print("  ".join(f"{name} {value}" for name, value in row.items()), flush=True)


def save(rows, path, remark=None):
    """Writes rows with the same columns as CSV; path None: nowhere. With a remark a first line says what was measured,
    on what, when, and how busy the machine was."""
    if path is None:
        return
    with open(path, "w", newline="") as file:
        if remark:
            load = os.getloadavg()[0]
            file.write(f"# {remark}; {_processor()}, {datetime.date.today()}, one thread, load {load:.0f}\n")
        writer = csv.DictWriter(file, rows[0].keys(), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def _processor():
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return f"{line.split(':', 1)[1].strip()} x{os.cpu_count()}"
    return platform.machine()
