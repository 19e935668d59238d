#!/usr/bin/env python3
"""Runs the snippets and commands of pages in order, and compares their output with the output shown on the page.

    tools/docs/snippets.py docs/cookbook.md             # exit code 1, and the difference, if the output differs
    tools/docs/snippets.py --write docs/cookbook.md     # writes the output of its snippets into the page

```python       is run. The first of a page is a common start: it is run again before each of the others, so that a
                reader can combine it with any of them. Its output is the block ```text that follows immediately.
an indented     block contains shell commands, one per line. A daemon that one starts serves until the next, or the end.
```yaml         that begins with "# NAME.yaml" is that file.

Other fenced blocks are not run (```py is another library's Python), nor are those in LEFT_OUT, with the reason. A page
is read in a separate folder with the repository's files (tools/docs/page_reader.py).
"""

import argparse
import difflib
import re
import sys
import textwrap
import traceback
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from page_reader import BUILD, ROOT, Failed, Reader, lines_of

FENCE = re.compile(r"^```([\w+]*)$")
NAMED_FILE = re.compile(r"# ([\w.-]+\.yaml)\b")

ELSEWHERE = "a test of its own runs it: "
NEEDS = "needs "
LONG = "takes minutes; the same in little: "
#: Snippets that are not run: by page, the start of the command or of the block's first line, and the reason. A test
#: finds stale ones.
LEFT_OUT: dict[str, dict[str, str]] = {
    "README.md": {
        "make demo": ELSEWHERE + "tests/python/cli/test_demo.py",
        "make test": "it runs this",
        "tools/wheel.sh native": NEEDS + "minutes; make test-extras EXTRAS=wheels",
        "pip install numpy": NEEDS + "a network; make test-extras EXTRAS=wheels installs it so",
    },
    "docs/trust/accuracy.md": {
        "make ": LONG + "make test has a part of it",
        "build/bin/clearance-certify": LONG + "tests/oracle",
        "build/bin/clearance-certificates": LONG + "tests/oracle",
        "build/bin/clearance-mine": LONG + "tests/oracle",
    },
    "docs/cuda.md": {
        "plan = engine": NEEDS + "a GPU; make gpu-test",
        "client = clearance": NEEDS + "a GPU; make gpu-test",
    },
    "docs/control.md": {
        "python3 client/examples/": LONG + "make test-extras EXTRAS=examples",
    },
    "docs/service/daemon.md": {
        "clearanced --scene scenes/nineteen/scene.yaml --shm /run": NEEDS + "the right to real-time priorities",
        "clearance stat --watch": "never ends; tests/server/base/test_stats.cpp has the counters",
    },
    "docs/examples.md": {
        "python3 client/examples/roadmap.py": LONG + "make test-extras EXTRAS=ray",
        "python3 client/examples/": LONG + "make test-extras EXTRAS=examples",
        "pip install": NEEDS + "a network",
        "clearance view": "never ends; make test-extras EXTRAS=viewer",
    },
    "docs/service/lcm.md": {
        "ip ": "changes the machine's network",
        "lcm-logger": "never ends",
        "lcm-logplayer": NEEDS + "a log",
        "sysctl ": "changes the machine's kernel",
    },
    "docs/planning.md": {"import clearance.ompl": NEEDS + "OMPL; make test-extras EXTRAS=ompl"},
    "docs/notes/report.md": {"make ": LONG + "make test has a part of it"},
    "docs/service/ros.md": {
        "ln -s $PWD/ros": NEEDS + "colcon; make test-extras EXTRAS=ros has the node",
        "tools/wheel.sh client": NEEDS + "a network; make test-extras EXTRAS=wheels installs it",
        "cd ~/ws": NEEDS + "colcon",
        "ros2 launch": NEEDS + "colcon",
    },
    "docs/service/safety.md": {"make ": LONG + "make test has a part of it"},
    "docs/start.md": {
        "git clone": "the repository is there",
        "make build": "it is built",
        ". .venv/bin/activate": "this Python has the package",
    },
    "docs/sweeps.md": {
        "clearance sweep": LONG + "tests/python/sweep/test_sweep.py; Ray by make test-extras EXTRAS=ray",
        "pip install": NEEDS + "a network",
    },
    "docs/install.md": {
        "pip install numpy": NEEDS + "a network; make test-extras EXTRAS=wheels installs it so",
        "mkdir -p /run/clearance": NEEDS + "Docker",
        "docker run": NEEDS + "Docker",
        "clearance bodies": NEEDS + "Docker",
    },
    "docs/service/wire.md": {"import struct": ELSEWHERE + "tests/python/docs/test_docs.py"},
}
#: Pages whose indented blocks are formulas or drawings.
FORMULAS = {
    "docs/trust/bounds.md",
    "docs/trust/bounds_bodies.md",
    "docs/trust/bounds_robots.md",
    "docs/architecture.md",
}


class Differs(Exception):
    """A page differs from the output of its snippets; the message is the difference."""


@dataclass(frozen=True)
class Block:
    """Code on a page."""

    kind: str  #: the fence's language; "shell" for an indented block
    code: str  #: without fence and indentation
    line: int  #: line of the page on which the code begins, from 1
    end: int  #: line of the page after the block, from 0


def pages() -> "list[Path]":
    """Every page whose snippets are run."""
    return [ROOT / "README.md", ROOT / "lcmtypes/README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def blocks(text: str, name: str = "") -> "list[Block]":
    """All code of a page, in order."""
    lines, found, i = text.splitlines(), [], 0
    while i < len(lines):
        fence = FENCE.match(lines[i])
        if fence:
            end = lines.index("```", i + 1)
            found.append(Block(fence[1], "\n".join(lines[i + 1 : end]) + "\n", i + 2, end + 1))
            i = end + 1
        elif lines[i].startswith("    ") and begins_code(lines, i) and name not in FORMULAS:
            end = i
            while end < len(lines) and (lines[end].startswith("    ") or not lines[end].strip()):
                end += 1
            while not lines[end - 1].strip():
                end -= 1
            found.append(Block("shell", textwrap.dedent("\n".join(lines[i:end])) + "\n", i + 1, end))
            i = end
        else:
            i += 1
    return found


def begins_code(lines: "list[str]", i: int) -> bool:
    """Whether an indented line begins a block: after an empty line or a heading."""
    return i == 0 or not lines[i - 1].strip() or lines[i - 1].startswith("#")


def left_out(name: str, beginning: str) -> "str | None":
    """The reason why a command or block is not run, or None if it is."""
    return next((why for key, why in LEFT_OUT.get(name, {}).items() if beginning.startswith(key)), None)


def run_page(text: str, name: str) -> str:
    """The page with the output of its snippets. Raises a snippet's exception, with the page's line."""
    lines, out, done = text.splitlines(), [], 0
    found = blocks(text, name)
    with Reader() as reader:
        first: list = []
        for i, block in enumerate(found):
            if block.end <= done:
                continue  # the previous block's output
            printed = run_block(reader, block, name, first)
            out += lines[done : block.end]
            done = block.end
            behind = found[i + 1] if i + 1 < len(found) else None
            shown = behind and behind.kind == "text" and behind.line == block.end + 3
            if (block.kind == "python" and printed is not None) or (block.kind == "shell" and shown):
                done = behind.end if shown else done
                out += ["", "```text", *printed.splitlines(), "```"] if printed else []
    return "".join(f"{line}\n" for line in out + lines[done:])


def run_block(reader: Reader, block: Block, name: str, first: list) -> "str | None":
    """The output of a block, or None if it is not run."""
    if block.kind == "shell":
        return "".join(
            reader.command(line, f"{name}:{at}") for at, line in lines_of(block) if left_out(name, line) is None
        )
    if block.kind == "yaml" and NAMED_FILE.match(block.code):
        (reader.work / NAMED_FILE.match(block.code)[1]).write_text(reader.stand_in(block.code))
    if block.kind != "python" or left_out(name, block.code) is not None:
        return None
    names: dict = {}
    for before in first:
        reader.python(names, before.code, f"{name}, snippet", before.line)
    first.extend([] if first else [block])
    return reader.python(names, block.code, f"{name}, snippet", block.line)


def check(page: Path) -> None:
    """Raises Differs if the page differs from the output of its snippets, and a snippet's exception."""
    text = page.read_text()
    before, after = text.splitlines(keepends=True), run_page(text, name_of(page)).splitlines(keepends=True)
    if before != after:
        difference = difflib.unified_diff(before, after, f"{page.name} as it is", "and what its snippets print")
        raise Differs("".join(difference))


def name_of(page: Path) -> str:
    """A page's name in LEFT_OUT: its path from the repository."""
    page = page.resolve()
    return page.relative_to(ROOT).as_posix() if ROOT in page.parents else page.name


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("pages", nargs="*", type=Path, default=pages())
    parser.add_argument("--write", action="store_true", help="write what snippets print into the pages")
    options = parser.parse_args()
    sys.path.insert(0, str(BUILD / "python"))
    failed = 0
    for page in options.pages:
        try:
            if options.write:
                page.write_text(run_page(page.read_text(), name_of(page)))
            else:
                check(page)
        except (Differs, Failed) as difference:
            print(difference)
            failed += 1
        except Exception:
            traceback.print_exc()
            failed += 1
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
