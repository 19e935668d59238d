"""The generated man pages contain all help texts of the programs, and roff accepts them."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from conftest import BUILD

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "tools" / "docs"))

import man_page  # noqa: E402


@pytest.mark.parametrize("program, section", [("clearance", "1"), ("clearanced", "8")])
def test_a_page_has_every_command_and_option(program, section):
    path = str(BUILD / "bin" / program)
    text = man_page.page(path, section)
    assert text.startswith(f".TH {program.upper()} {section} ")
    commands = [[command] for command in man_page.commands_of(man_page.help_of(path))]
    assert (["path"] in commands) == (program == "clearance")
    for command in commands:  # grows meanwhile
        assert f"\n.SH CLEARANCE {' '.join(command).upper()}\n".replace("-", "\\-") in text, command
        commands += [[*command, below] for below in man_page.commands_of(man_page.help_of(path, *command))]
    assert (["scene", "add"] in commands) == (program == "clearance")
    helps = [man_page.help_of(path)] + [man_page.help_of(path, *command) for command in commands]
    options = {option for each in helps for option in re.findall(r"^ +(?:-\w,)?(--[a-z-]+)", each, re.MULTILINE)}
    assert len(options) > 20
    assert not [option for option in options if man_page.roff(option) not in text]
    assert "/clearance-0/" not in text, "the page names a folder of the user who builds"


@pytest.mark.skipif(not shutil.which("groff"), reason="no groff on this machine")
def test_roff_warns_of_nothing(tmp_path):
    text = man_page.page(str(BUILD / "bin/clearance"), "1")
    done = subprocess.run(["groff", "-man", "-Tutf8", "-ww"], input=text, capture_output=True, text=True)
    assert done.returncode == 0 and not done.stderr, done.stderr
    assert "--max-distance" in re.sub(r"\x1b\[[0-9;]*m", "", done.stdout)


def completed(*words):
    """Completions that bash offers for the last of some words."""
    script = (
        'source "$1"; shift; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _clearance; printf "%s\\n" "${COMPREPLY[@]}"'
    )
    command = ["bash", "-c", script, "bash", str(ROOT / "cli/completion.bash"), *words]
    path = f"{BUILD}/bin{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "PATH": path})
    assert done.returncode == 0 and not done.stderr, done.stderr
    return set(done.stdout.split())


def test_the_shell_completes_commands_and_options():
    clearance = str(BUILD / "bin/clearance")
    assert completed("clearance", "") == set(man_page.commands_of(man_page.help_of(clearance)))
    assert completed("clearance", "sel") == {"selftest"}
    assert completed("clearance", "scene", "for") == {"forbid"}
    assert not completed("clearance", "scene", "forbid", "for")
    assert "--cylinder" in completed("clearance", "scene", "add", "--")
    options = re.findall(r"^ +(?:-\w,)?(--[a-z-]+)", man_page.help_of(clearance, "query"), re.MULTILINE)
    assert len(options) > 10 and set(options) <= completed("clearance", "query", "--")
    assert completed("clearance", "query", "--max-d") == {"--max-distance"}
    assert "--control-user" in completed("clearanced", "--c") and not completed("clearanced", "for")


def test_a_line_that_begins_as_a_request_is_text():
    assert man_page.roff(".so\n'x\na.b") == "\\&.so\n\\&'x\na.b"
