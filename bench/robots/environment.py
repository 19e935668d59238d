"""The Python environment that these benchmarks run in, with Pinocchio, Coal, OMPL, FCL and what reads the problems."""

import os
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
