"""python -m clearance COMMAND: the command `clearance` of this installation, or of the build folder."""

import os
import pathlib
import sys


def main() -> None:
    try:
        from _clearance_programs import clearance  # of a wheel
    except ImportError:
        program = pathlib.Path(__file__).parents[2] / "bin" / "clearance"
        if not program.exists():
            sys.exit("python -m clearance: this installation has no command line")
        os.execv(program, ["clearance", *sys.argv[1:]])
    clearance()


if __name__ == "__main__":
    main()
