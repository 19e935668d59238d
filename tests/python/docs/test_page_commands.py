"""Commands on pages that the tests do not run: few, each with a reason, and our own programs accept them."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from conftest import BUILD, ROOT

sys.path.insert(0, str(ROOT / "tools/docs"))

import snippets
from page_reader import lines_of


def beginnings(page):
    """Every command and every Python snippet of a page."""
    name = snippets.name_of(page)
    for block in snippets.blocks(page.read_text(), name):
        if block.kind == "shell":
            yield from (line for _, line in lines_of(block))
        elif block.kind == "python":
            yield block.code


def test_the_list_of_what_is_left_out_is_up_to_date():
    pages = {snippets.name_of(page): list(beginnings(page)) for page in snippets.pages()}
    for name, entries in snippets.LEFT_OUT.items():
        for beginning, why in entries.items():
            assert any(text.startswith(beginning) for text in pages[name]), f"{name} has no {beginning!r}"
            for path in re.findall(r"tests/[\w/.]+", why):
                assert (ROOT / path).exists(), path
    out = [bool(snippets.left_out(name, text)) for name, texts in pages.items() for text in texts]
    assert len(out) > 100 and sum(out) < len(out) / 2, "most of what pages say is run"


def commands(*programs):
    """(page, command) of the untested commands of the given programs."""
    found = []
    for page in snippets.pages():
        name = snippets.name_of(page)
        for text in beginnings(page):
            if snippets.left_out(name, text) and re.match(rf"(?:[\w/]*/)?(?:{'|'.join(programs)})\b(?!\n)", text):
                found.append(pytest.param(text, id=f"{name}: {text[:50]}"))
    return found


@pytest.mark.parametrize("line", commands("make"))
def test_targets_that_are_left_out_exist(line):
    makefile = (ROOT / "Makefile").read_text()
    assert re.search(rf"^{line.split()[1]}:", makefile, re.MULTILINE)


@pytest.mark.parametrize("line", commands("clearance", "clearanced"))
def test_options_that_are_left_out_exist(line):
    program, *rest = shlex.split(line.rstrip(" &"), comments=True)
    command = [str(BUILD / "bin" / Path(program).name), *(rest[:1] if Path(program).name == "clearance" else [])]
    said = subprocess.run([*command, "--help"], capture_output=True, text=True)
    assert said.returncode == 0, said.stderr
    options = [word for word in rest if word.startswith("--")]
    assert not [option for option in options if not re.search(rf"{option}\b", said.stdout)], line


@pytest.mark.parametrize("line", commands("python3"))
def test_programs_that_are_left_out_exist_and_have_the_options(line):
    _, program, *rest = shlex.split(line, comments=True)
    text = (ROOT / program).read_text()
    assert not [word for word in rest if word.startswith("--") and f'"{word}"' not in text], line
