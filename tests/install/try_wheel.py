"""try_wheel.py WHEELS SCENES [PROGRAM]: installs a wheel as a new user would, queries, removes it; in a bare root.

WHEELS: a folder with one wheel of ours and its dependencies; nothing comes from a network. SCENES: as in the checkout.
PROGRAM: a clearanced for a wheel that has none.
"""

import os
import pathlib
import subprocess
import sys
import tempfile
import venv

CHECK = pathlib.Path(__file__).with_name("check_wheel.py")


def files(folder):
    """Every path below, except Python's compiled files."""
    return {path for path in pathlib.Path(folder).rglob("*") if "__pycache__" not in path.parts}


def main():
    wheels, *rest = sys.argv[1:]
    (ours,) = [wheel for wheel in os.listdir(wheels) if wheel.startswith("clearance")]
    name = ours.split("-")[0].replace("_", "-")
    with tempfile.TemporaryDirectory() as folder:
        home = pathlib.Path(folder) / "home"
        os.environ["HOME"] = str(home)
        home.mkdir()
        environment = pathlib.Path(folder) / "venv"
        venv.create(environment, with_pip=True)
        before = files(environment)
        pip = [environment / "bin/python", "-m", "pip", "--disable-pip-version-check", "--no-cache-dir"]
        subprocess.run([*pip, "install", "--quiet", "--no-index", "--find-links", wheels, name], check=True)
        subprocess.run([environment / "bin/python", "-I", CHECK, name, *rest], check=True, cwd=home)
        added = [line.split("==")[0] for line in subprocess.check_output([*pip, "freeze"], text=True).split()]
        subprocess.run([*pip, "uninstall", "--quiet", "--yes", *added], check=True)
        left = files(environment) - before
        left |= files(home)
        assert not left, f"left behind: {sorted(map(str, left))}"
    print(f"{ours}: installed, asked, removed without a trace, by Python {sys.version.split()[0]}")


main()
