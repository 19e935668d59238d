"""The Python environment that these benchmarks run in, with Pinocchio, Coal, OMPL, FCL and what reads the problems."""

import csv
import datetime
import os
import platform
import subprocess
import sys
from pathlib import Path

BUILD = Path(__file__).resolve().parents[2] / "build/robots"
PACKAGES = ["pin==4.1.0", "coal==3.0.3", "numpy", "pyyaml", "scikit-build-core", "matplotlib"]
PACKAGES += ["ompl==2.0.1", "python-fcl==0.7.0.11"]


def in_own_environment():
    """Runs this program again with the Python that has the peers."""
    venv = BUILD / "venv"
    stamp = venv / "installed"
    if not stamp.exists() or stamp.read_text() != " ".join(PACKAGES):
        print("Install Pinocchio and Coal into build/robots/venv ...", flush=True)
        subprocess.run([sys.executable, "-m", "venv", "--clear", venv], check=True)
        pip = [venv / "bin/python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
        subprocess.run([*pip, *PACKAGES], check=True)
        stamp.write_text(" ".join(PACKAGES))
    python = venv / "bin/python"
    if Path(sys.prefix).resolve() != venv.resolve():
        os.execv(python, [str(python), *sys.argv])


def write_rows(path, rows, remark):
    """A CSV file whose first line says what was measured, when, and how busy the machine was."""
    load = os.getloadavg()[0]
    with open(path, "w", newline="") as f:
        f.write(f"# {remark}; {_processor()}, {datetime.date.today()}, one thread, load {load:.0f}\n")
        writer = csv.DictWriter(f, rows[0].keys(), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def _processor():
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return f"{line.split(':', 1)[1].strip()} x{os.cpu_count()}"
    return platform.machine()
