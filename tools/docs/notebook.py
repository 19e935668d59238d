#!/usr/bin/env python3
"""Runs a notebook and compares the output of its cells with the stored output; pictures only have to exist.

    tools/docs/notebook.py --check docs/notebook/first_steps.ipynb   # exit code 1, and the cell, if the output differs
    tools/docs/notebook.py --write docs/notebook/first_steps.ipynb   # writes the output and pictures into the notebook

Runs in the repository's folder, with the Python that runs this. Needs nbclient and ipykernel.
"""
import argparse
import sys
from pathlib import Path

import nbformat
from nbclient import NotebookClient

ROOT = Path(__file__).resolve().parents[2]


def outputs(cell) -> list:
    """The output of a cell as text; a picture counts as one."""
    found = []
    for output in cell.get("outputs", []):
        data = output.get("data", {})
        found.append("a picture" if "image/png" in data else output.get("text") or data.get("text/plain"))
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("notebook", type=Path)
    parser.add_argument("--write", action="store_true", help="write what cells print and draw")
    parser.add_argument("--check", action="store_true", help="compare (the default)")
    options = parser.parse_args()
    before = nbformat.read(options.notebook, 4)
    after = nbformat.read(options.notebook, 4)
    NotebookClient(after, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(ROOT)}}).execute()
    if options.write:
        for cell in after.cells:
            cell.metadata.pop("execution", None)  # times, which differ in each run
        nbformat.write(after, options.notebook)
        return 0
    said, ran = [[outputs(cell) for cell in each.cells if cell.cell_type == "code"] for each in (before, after)]
    for number, (old, new) in enumerate(zip(said, ran), 1):
        if old != new:
            print(f"{options.notebook}: code cell {number} holds {old}, and now prints {new}")
    print(f"{options.notebook}: {len(ran)} code cells, {sum('a picture' in cell for cell in ran)} pictures")
    return int(said != ran)


if __name__ == "__main__":
    sys.exit(main())
