"""The set-up script and the Makefile on a new user's machine."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from patience import PATIENCE_S

ROOT = Path(__file__).resolve().parents[3]


def package_list():
    lines = (ROOT / "tools/packages/build.txt").read_text().splitlines()
    return [name for name in (line.split("#")[0].strip().rstrip("?") for line in lines) if name]


@pytest.fixture
def bare_machine(tmp_path):
    """A PATH on which no Debian package is installed, the user is not root, and there is no sudo."""
    tools = tmp_path / "bin"
    tools.mkdir()
    for name in ["bash", "cat", "cut", "dirname", "env", "grep", "mkdir", "realpath", "sed", "sha256sum", "tail", "tr"]:
        (tools / name).symlink_to(shutil.which(name))
    (tools / "python3").symlink_to(sys.executable)

    def fake(name, text):
        (tools / name).write_text("#!/bin/sh\n" + text + "\n")
        (tools / name).chmod(0o755)

    fake("dpkg-query", "exit 1")
    fake("id", "echo 1000")
    fake("apt-get", 'echo "apt-get was called" >&2; exit 99')
    return {**os.environ, "PATH": str(tools)}


def run_setup(env, **more):
    return subprocess.run(
        ["bash", "tools/setup.sh"],
        cwd=ROOT,
        env={**env, **more},
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
        timeout=PATIENCE_S,
    )


def test_without_root_the_exact_command_is_printed(bare_machine):
    result = run_setup(bare_machine)
    assert result.returncode == 1
    command = re.search(r"apt-get update && apt-get install -y --no-install-recommends (.*)", result.stdout)
    assert command, result.stdout + result.stderr
    requested = command.group(1).split()
    assert set(package_list()) <= set(requested)
    assert "apt-get was called" not in result.stderr


def test_a_failing_apt_shows_its_output(bare_machine):
    tools = Path(bare_machine["PATH"])
    (tools / "id").write_text("#!/bin/sh\necho 0\n")
    (tools / "sleep").symlink_to(shutil.which("sleep"))
    result = run_setup(bare_machine)
    assert result.returncode == 99
    assert "apt-get was called" in result.stdout
    assert "out/log/apt.log" in result.stdout


def test_an_old_python_is_refused_with_a_reason(bare_machine, tmp_path):
    old = tmp_path / "old-python"
    old.write_text('#!/bin/sh\ncase "$1" in --version) echo "Python 3.7.3";; *) exit 1;; esac\n')
    old.chmod(0o755)
    result = run_setup(bare_machine, PYTHON=str(old))
    assert result.returncode == 1
    assert "Python 3.7.3 is too old: Python 3.9 or newer is needed" in result.stderr


def test_a_second_run_does_nothing():
    assert run_setup(os.environ).returncode == 0
    again = run_setup(os.environ)
    assert (again.returncode, again.stdout) == (0, "")


def test_help_lists_every_target():
    phony = re.search(r"^\.PHONY: (.*)$", (ROOT / "Makefile").read_text(), re.MULTILINE).group(1).split()
    listed = subprocess.run(
        ["make", "--no-print-directory"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout
    assert re.findall(r"^  ([a-z-]+) +\S", listed, re.MULTILINE) == phony


def test_presets_that_look_for_bugs_have_assertions():
    presets = json.loads((ROOT / "CMakePresets.json").read_text())["configurePresets"]
    variables = {preset["name"]: preset["cacheVariables"] for preset in presets}
    assert variables["debug"]["CLEARANCE_WERROR"] == "ON"
    for name in ("asan", "fuzz"):  # their type's own flags leave assertions out
        assert variables[name]["CMAKE_BUILD_TYPE"] == "RelWithDebInfo"
        assert "NDEBUG" not in variables[name]["CMAKE_CXX_FLAGS_RELWITHDEBINFO"], name
