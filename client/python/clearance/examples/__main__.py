"""python -m clearance.examples [NAME] [--source] [--picture FILE]: lists the examples, or runs one.

--source prints the program instead. --picture draws its scene into a file, and needs matplotlib.
"""

from __future__ import annotations

import argparse
import importlib
import pathlib
import sys
from collections.abc import Sequence
from types import ModuleType
from typing import Optional

FOLDER = pathlib.Path(__file__).parent
NAMES = ("two_bodies", "arm_state", "proved_edge", "batch", "point_cloud", "grasp", "barrier", "trajectory")


def main(arguments: Optional[Sequence[str]] = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m clearance.examples", description="Programs to start from.")
    parser.add_argument("name", nargs="?", choices=NAMES, metavar="NAME", help="the example to run")
    parser.add_argument("--source", action="store_true", help="print the program")
    parser.add_argument("--picture", metavar="FILE", help="draw its scene into a file (needs matplotlib)")
    options = parser.parse_args(arguments)
    if options.name is None:
        for name in NAMES:
            print(f"{name:12}  {_module(name).__doc__}")
        print("\npython -m clearance.examples NAME   runs one; --source prints it, --picture FILE draws its scene")
        return 0
    if options.source:
        print((FOLDER / f"{options.name}.py").read_text(), end="")
        return 0
    scene, engine, lines = _module(options.name).main()
    if options.picture:
        from ._picture import draw

        draw(scene, engine, lines, options.picture)
    return 0


def _module(name: str) -> ModuleType:
    return importlib.import_module(f".{name}", __package__)


if __name__ == "__main__":
    sys.exit(main())
