#!/usr/bin/env python3
"""Python environments of benchmarks that need other packages than Clearance.

    bench/environment.py FOLDER PROGRAM [OPTION...]    run a program with the packages of FOLDER/requirements.txt

The environment build/NAME/venv, where NAME is the folder's name, is created if it is missing or its list has changed.
"""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
MODULES = ("build/python", "bench", "bench/peers", "bench/robots", "bench/surfaces", "tools")


def python_of(folder, base=sys.executable):
    """A Python with a folder's packages, created from the Python `base`, whose version must fit our modules."""
    wanted, venv = ROOT / folder / "requirements.txt", ROOT / "build" / Path(folder).name / "venv"
    stamp, python = venv / "installed", venv / "bin/python"
    if not stamp.exists() or stamp.read_text() != wanted.read_text():
        print(f"Install the packages of {folder} into {venv.relative_to(ROOT)} ...", flush=True)
        subprocess.run([base, "-m", "venv", "--clear", venv], check=True)
        pip = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
        subprocess.run([*pip, "-r", wanted], check=True)
        stamp.write_text(wanted.read_text())
    return python


def variables():
    """The environment variables of a benchmark program, with the folders of its modules."""
    modules = [str(ROOT / folder) for folder in MODULES]
    return {**os.environ, "PYTHONPATH": os.pathsep.join([*modules, *filter(None, [os.environ.get("PYTHONPATH")])])}


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    program = python_of(sys.argv[1])
    os.execve(program, [str(program), *sys.argv[2:]], variables())
