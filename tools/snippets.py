#!/usr/bin/env python3
"""Runs the Python snippets of pages as they stand, and compares what they print with what the page says they print.

    tools/snippets.py docs/cookbook.md             # exit code 1, and the difference, where a page says something else
    tools/snippets.py --write docs/cookbook.md     # writes what they print into the page

A snippet is a block ```python; what it prints is the block ```text right behind it. The first snippet of a page is what
the others begin with: it is run anew before each of them, so that a reader who has the first can take any other.
Snippets run in the repository's folder. One that asks a daemon is given one: the command that the page starts it with,
build/bin/clearanced ..., with its sockets in a folder of its own in place of /tmp. (```py is another library's code.)
"""
import argparse
import contextlib
import difflib
import io
import os
import re
import subprocess
import sys
import tempfile
import traceback
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BUILD = Path(os.environ.get("CLEARANCE_BUILD", ROOT / "build"))
PAGES = ["start", "concepts", "cookbook", "shapes", "motions", "fcl", "drake", "moveit", "curobo"]
BLOCK = re.compile(r"^```python\n(.*?)^```\n(?:\n```text\n(.*?)^```\n)?", re.MULTILINE | re.DOTALL)
COMMAND = re.compile(r"^ *(build/bin/clearanced .*?)(?: *&)?$", re.MULTILINE)


class Differs(Exception):
    """A page says otherwise than its snippets do; the text is the difference."""


def run_page(text: str, name: str) -> str:
    """The page with what its snippets print. Raises what a snippet raises, with the page's line."""
    with tempfile.TemporaryDirectory() as folder, daemon_of(text, Path(folder)):
        first: list = []

        def written(block):
            snippet = block[1].replace("/tmp/", f"{folder}/"), f"{name}, snippet", text[: block.start()].count("\n") + 2
            names: dict = {}
            for before in first:
                run(names, *before)
            first.extend([] if first else [snippet])
            printed = run(names, *snippet).replace(f"{folder}/", "/tmp/")
            return f"```python\n{block[1]}```\n" + (f"\n```text\n{printed}```\n" if printed else "")

        return BLOCK.sub(written, text)


def run(names: dict, code: str, name: str, line: int) -> str:
    """What a snippet prints; its line numbers are those of the page."""
    printed = io.StringIO()
    before = os.getcwd()
    os.chdir(ROOT)
    try:
        with contextlib.redirect_stdout(printed):
            exec(compile("\n" * (line - 1) + code, name, "exec"), names)
    finally:
        os.chdir(before)
    return printed.getvalue()


@contextlib.contextmanager
def daemon_of(text: str, folder: Path):
    """The daemon that a page starts, until the end; nothing for a page that starts none."""
    command = COMMAND.search(text)
    if not command:
        yield
        return
    arguments = command[1].replace("/tmp/", f"{folder}/").replace("build/bin/", f"{BUILD}/bin/").split()
    read_end, write_end = os.pipe()
    process = subprocess.Popen([*arguments, "--ready-fd", str(write_end)], cwd=ROOT, pass_fds=[write_end],
                               stderr=subprocess.PIPE, text=True)
    os.close(write_end)
    try:
        with os.fdopen(read_end) as ready:
            if not ready.read():
                raise RuntimeError(f"{command[1]}: ended before it was ready: {process.communicate()[1]}")
        yield
    finally:
        process.terminate()
        process.communicate()


def check(page: Path) -> None:
    """Raises Differs where the page says otherwise than its snippets do, and what a snippet raises."""
    text = page.read_text()
    before, after = text.splitlines(keepends=True), run_page(text, page.name).splitlines(keepends=True)
    if before != after:
        difference = difflib.unified_diff(before, after, f"{page.name} as it is", "and what its snippets print")
        raise Differs("".join(difference))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("pages", nargs="*", type=Path, default=[ROOT / f"docs/{page}.md" for page in PAGES])
    parser.add_argument("--write", action="store_true", help="write what snippets print into the pages")
    options = parser.parse_args()
    sys.path.insert(0, str(BUILD / "python"))
    failed = 0
    for page in options.pages:
        try:
            if options.write:
                page.write_text(run_page(page.read_text(), page.name))
            else:
                check(page)
        except Differs as difference:
            print(difference, end="")
            failed += 1
        except Exception:
            traceback.print_exc()
            failed += 1
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
