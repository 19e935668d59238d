#!/usr/bin/env python3
"""Writes the accuracy tables into docs/accuracy.md (between their markers) from docs/results/*accuracy.csv.

usage: tools/accuracy_table.py [--check]     --check: only says whether the page is up to date (exit code 1 if not)
"""

import csv
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "accuracy.md"
# A table's name in its markers, its file, and which columns say how many pairs are not apart by how they meet.
TABLES = [
    ("accuracy table", "accuracy.csv", "touching", ["touching"]),
    ("mesh accuracy table", "mesh_accuracy.csv", "in contact", ["touching", "overlapping"]),
]
GROUPS = [("cpu", "f64"), ("cpu", "f32"), ("reference", "f64")]


def read(path):
    """The first line's remark, and the rows."""
    with open(path, newline="") as f:
        remark = f.readline().lstrip("# ").strip()
        return remark, list(csv.DictReader(f))


def worst(rows, column):
    values = [float(r[column]) for r in rows]
    return f"{max(values):.2g}" if values else "-"


def table(file, label_of_meeting, meeting, remark, rows):
    classes = list(dict.fromkeys(r["class"] for r in rows))
    lines = [
        f"| class | pairs | {label_of_meeting} | answers | violations | worst error: "
        + " / ".join(" ".join(g) for g in GROUPS)
        + " | worst width: the same | contact | unconverged |",
        "|---|--:|--:|--:|--:|--:|--:|--:|--:|",
    ]
    total = dict(pairs=0, answers=0, violations=0)
    for name in [*classes, None]:
        mine = [r for r in rows if name in (None, r["class"])]
        answers = sum(int(r["cases"]) for r in mine)
        violations = sum(int(r["violations"]) for r in mine)
        if name is None:
            pairs, touching, label = total["pairs"], total["touching"], "**all**"
        else:
            pairs, touching, label = int(mine[0]["cases"]), sum(int(mine[0][c]) for c in meeting), f"`{name}`"
            for key, value in (("pairs", pairs), ("touching", touching)):
                total[key] = total.get(key, 0) + value
        by_group = [[r for r in mine if (r["backend"], r["precision"]) == g] for g in GROUPS]
        share = [f"{100 * sum(int(r[c]) for r in mine) / answers:.3g} %" for c in ("contact", "unconverged")]
        lines.append(
            f"| {label} | {pairs} | {touching} | {answers} | {violations} | "
            + " / ".join(worst(g, "worst_error") for g in by_group)
            + " | "
            + " / ".join(worst(g, "worst_width") for g in by_group)
            + f" | {share[0]} | {share[1]} |"
        )
    return f"From `docs/results/{file}` ({remark}):\n\n" + "\n".join(lines) + "\n"


def main():
    text = new = PAGE.read_text()
    for name, file, label, meeting in TABLES:
        begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
        block = f"{begin}\n{table(file, label, meeting, *read(ROOT / 'docs' / 'results' / file))}{end}"
        new, found = re.subn(f"{re.escape(begin)}.*{re.escape(end)}", block.replace("\\", r"\\"), new, flags=re.S)
        if found != 1:
            sys.exit(f"{PAGE}: the marker {begin} or {end} is missing")
    if "--check" in sys.argv[1:]:
        if new != text:
            sys.exit(f"{PAGE} does not show docs/results: run tools/accuracy_table.py")
    else:
        PAGE.write_text(new)


if __name__ == "__main__":
    main()
