"""The command `clearance view`: its arguments and errors. None of it needs viser."""

import os
import shutil
import subprocess
import sys

import pytest

from clearance.view import command
from clearance.view.model import ViewQuery
from conftest import BUILD, INSTALLED
from patience import PATIENCE_S

PROGRAM = shutil.which("clearance") if INSTALLED else str(BUILD / "bin" / "clearance")


def options(*arguments):
    return command.parser().parse_args([str(argument) for argument in arguments])


def test_what_is_shown_is_what_was_named(start_daemon, cell, urdf, monkeypatch):
    monkeypatch.delenv("CLEARANCE_URL", raising=False)
    session = command.open_session(options(cell))
    assert not session.asks_only and len(session.shapes) == 23
    session = command.open_session(options(urdf))
    assert session.joints.names[0].startswith("arm/") and session.picture(ViewQuery()).placed.all()
    url = start_daemon(cell, ["ipc"]).urls["ipc"]
    session = command.open_session(options("--connect", url))
    assert session.asks_only and not any(session.known)
    session = command.open_session(options(cell, "--connect", url))
    assert session.asks_only and all(session.known)
    monkeypatch.setenv("CLEARANCE_URL", url)
    assert command.open_session(options()).source == url
    assert not command.open_session(options(cell)).asks_only


def test_what_does_not_go_together_is_refused(cell, urdf, monkeypatch):
    monkeypatch.delenv("CLEARANCE_URL", raising=False)
    with pytest.raises(ValueError, match="expected a scene file, a URDF, or --connect URL"):
        command.open_session(options())
    with pytest.raises(ValueError, match="--srdf and --packages are of a URDF"):
        command.open_session(options(cell, "--packages", "a=b"))
    with pytest.raises(ValueError, match="--packages: expected NAME=FOLDER, got 'a'"):
        command.open_session(options(urdf, "--packages", "a"))
    with pytest.raises(SystemExit):
        options(cell, "--rate", "1000")


def test_without_viser_the_command_says_what_to_install(cell, tmp_path):
    (tmp_path / "viser.py").write_text("raise ModuleNotFoundError('No module named viser', name='viser')\n")
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [PROGRAM, "view", str(cell)],
        env={**os.environ, "PYTHONPATH": path, "PYTHON": sys.executable},
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
    )
    assert (done.returncode, done.stdout) == (1, "")
    assert (
        done.stderr
        == 'clearance view: the page needs viser: pip install "WHEEL[view]", where WHEEL is the file clearance-*.whl\n'
    )


def test_a_wheels_command_knows_it(root):
    code = "import runpy, sys; sys.argv[:] = ['clearance', 'view', '--help']; runpy.run_path({!r})['clearance']()"
    done = subprocess.run(
        [sys.executable, "-c", code.format(str(root / "client/python/_clearance_programs.py"))],
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        cwd=root / "tests",
    )
    assert done.returncode == 0 and done.stdout.startswith("usage: clearance view"), done.stderr


@pytest.mark.skipif(INSTALLED, reason="the wheel's command runs the package itself")
def test_a_program_without_the_package_says_what_to_install(tmp_path):
    def run(path):
        command = [shutil.copy(PROGRAM, tmp_path / "clearance"), "view", "scene.yaml", "--port", "1"]
        return subprocess.run(
            command, capture_output=True, text=True, timeout=PATIENCE_S, env={**os.environ, "PATH": str(path)}
        )

    answer = run(tmp_path)
    assert answer.returncode == 1
    assert (
        "clearance-view is part of the Python package" in answer.stderr and 'pip install "WHEEL[view]"' in answer.stderr
    )
    # ... and finds the program on PATH.
    program = tmp_path / "bin" / "clearance-view"
    program.parent.mkdir()
    program.write_text('#!/bin/sh\necho "found: $*"\n')
    program.chmod(0o755)
    assert run(program.parent).stdout == "found: scene.yaml --port 1\n"
