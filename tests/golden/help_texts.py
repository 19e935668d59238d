#!/usr/bin/env python3
"""The --help of every installed program and subcommand, as help_texts.txt records it.

.venv/bin/python tests/golden/help_texts.py        writes help_texts.txt from the programs in build/bin
"""

import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
RECORD = Path(__file__).with_suffix(".txt")
RENEW = f".venv/bin/python {Path(__file__).relative_to(ROOT)}"
#: Subcommands of `clearance` that are Python modules.
MODULES = {"sweep": "clearance.sweep.__main__", "view": "clearance.view.command"}
sys.path.insert(0, str(ROOT / "tools" / "docs"))

import man_page  # noqa: E402


def _help_of_module(module: str, packages: Path) -> str:
    code = f"import sys; sys.argv[0] = 'clearance'; from {module} import main; main(['--help'])"
    environment = {**os.environ, "COLUMNS": "100", "PYTHONPATH": str(packages)}
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment
    ).stdout


def _add_with_commands(texts: dict[str, str], program: str, path: str, commands: list[str]) -> None:
    """Adds the text of a command and those of the commands below it."""
    text = man_page.help_of(path, *commands)
    texts[" ".join([program, *commands])] = text
    for command in man_page.commands_of(text):
        if commands or command not in MODULES:
            _add_with_commands(texts, program, path, [*commands, command])


def help_texts(build: Path) -> dict[str, str]:
    """Help texts of the programs in a build folder, by command line."""
    texts = {}
    for program in ("clearanced", "clearance"):
        path = str(build / "bin" / program)
        _add_with_commands(texts, program, path, [])
    for command, module in MODULES.items():
        texts[f"clearance {command}"] = _help_of_module(module, build / "python")
    return texts


def recorded() -> dict[str, str]:
    parts = re.split(r"^=== (.+)\n", RECORD.read_text(), flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def words(text: str) -> list[str]:
    """A help text's words in lower case, because releases of CLI11 and argparse wrap and capitalise differently."""
    return text.casefold().split()


if __name__ == "__main__":
    blocks = [f"=== {name}\n{text.rstrip()}\n\n" for name, text in sorted(help_texts(ROOT / "build").items())]
    RECORD.write_text("".join(blocks))
