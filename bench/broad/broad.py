#!/usr/bin/env python3
"""Writes what docs/results/broad.csv says into docs/performance.md, between its markers.

    bench/broad/broad.py            write it
    bench/broad/broad.py --check    only says whether the page shows the CSV (exit code 1 if not)
"""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "peers"))

from peers_pages import ROOT, grouped, read_csv, replace_table, times

CSV = ROOT / "docs/results/broad.csv"
PAGE = ROOT / "docs/performance.md"


def milliseconds(row):
    value = float(row["ms_median"])
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"


def boxes_table(rows):
    """Finding the pairs alone: one row for each method and number of threads."""
    counts = list(dict.fromkeys(int(r["bodies"]) for r in rows))
    lines = ["| pairs within 2 m, ms | threads | " + " | ".join(f"{n:,}" for n in counts) + " |",
             "|---|--:|" + "--:|" * len(counts)]
    for (method, threads), mine in grouped_by(rows, "method", "threads").items():
        by_count = {int(r["bodies"]): milliseconds(r) for r in mine}
        lines.append(f"| {method} | {threads} | " + " | ".join(by_count.get(n, "") for n in counts) + " |")
    return lines


def queries_table(rows):
    """Whole queries: brute force, the tree, and the ratio."""
    counts = list(dict.fromkeys(int(r["bodies"]) for r in rows))
    lines = ["| query, ms: brute force / tree | threads | " + " | ".join(f"{n:,}" for n in counts) + " |",
             "|---|--:|" + "--:|" * len(counts)]
    for (what, threads), mine in grouped_by(rows, "what", "threads").items():
        cells = []
        for n in counts:
            at = {r["method"]: r for r in mine if int(r["bodies"]) == n}
            if "brute" in at:
                ratio = float(at["brute"]["ms_median"]) / float(at["tree"]["ms_median"])
                cells.append(f"{milliseconds(at['brute'])} / {milliseconds(at['tree'])}, **{times(ratio)}**")
            else:
                cells.append(f"/ {milliseconds(at['tree'])}")
        lines.append(f"| {what} | {threads} | " + " | ".join(cells) + " |")
    return lines


def grouped_by(rows, *keys):
    groups = {}
    for row in rows:
        groups.setdefault(tuple(row[k] for k in keys), []).append(row)
    return groups


def main():
    remark, rows = read_csv(CSV)
    lines = [f"From `docs/results/broad.csv` ({remark}):"]
    for setting, mine in grouped(rows, "setting").items():
        boxes = [r for r in mine if r["what"] == "boxes"]
        most = max(boxes, key=lambda r: int(r["bodies"]))
        lines += [
            "",
            f"**{setting}**, {int(most['pairs']):,} pairs of {int(most['bodies']):,} bodies",
            "",
            *boxes_table(boxes),
            "",
            *queries_table([r for r in mine if r["what"] != "boxes"]),
        ]
    replace_table(PAGE, "broad", "\n".join(lines), "--check" in sys.argv[1:])


if __name__ == "__main__":
    main()
