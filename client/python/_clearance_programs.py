"""The commands that a wheel brings: each becomes the program of its name in clearance/libexec, or runs as Python.

A module of its own, since importing the package would load numpy first.
"""

import importlib
import os
import sys
from pathlib import Path

#: Commands of `clearance` that are Python: the modules whose main(arguments) they run.
PYTHON = {"sweep": "clearance.sweep.__main__", "view": "clearance.view.command"}


def clearance() -> None:
    module = PYTHON.get(sys.argv[1]) if len(sys.argv) > 1 else None
    if module is not None:
        sys.exit(importlib.import_module(module).main(sys.argv[2:]))
    _become("clearance")


def clearanced() -> None:
    _become("clearanced")


def _become(name: str) -> None:
    program = Path(__file__).resolve().parent / "clearance" / "libexec" / name
    try:
        os.execv(program, [name, *sys.argv[1:]])
    except OSError as error:
        why = "a client-only install has none" if isinstance(error, FileNotFoundError) else error.strerror
        sys.exit(f"{name}: cannot start {program}: {why}")
