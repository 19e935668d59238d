"""The commands that a wheel brings: each is a program in clearance/libexec, but for `clearance view`.

A module of its own, since importing the package would load numpy first.
"""

import os
import sys
from pathlib import Path


def clearance() -> None:
    if sys.argv[1:2] == ["view"]:  # the one command that is Python
        from clearance.view.command import main

        sys.exit(main(sys.argv[2:]))
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
