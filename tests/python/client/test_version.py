"""The version is defined once, in CMakeLists.txt; all other places derive from it."""

import re
import subprocess
import sys

import clearance
from conftest import BUILD, INSTALLED


def version_of_project(root):
    return re.search(r"project\(clearance VERSION ([0-9.]+)", (root / "CMakeLists.txt").read_text()).group(1)


def test_package_and_programs_say_the_projects_version(root):
    version = version_of_project(root)
    assert clearance.__version__ == version
    for name in () if INSTALLED else ("clearance", "clearanced"):
        said = subprocess.run([BUILD / "bin" / name, "--version"], capture_output=True, text=True, check=True).stdout
        assert said.split() == [name, version]


def test_the_package_runs_the_command(root):
    command = [sys.executable, "-m", "clearance", "--version"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["clearance", version_of_project(root)]
    assert subprocess.run([*command[:-1], "--nonsense"], capture_output=True).returncode == 2


def test_changelog_has_the_version(root):
    assert re.search(rf"^## {re.escape(version_of_project(root))}\b", (root / "CHANGELOG.md").read_text(), re.MULTILINE)
