"""Table of docs/notes/performance.md: methods that find near pairs."""

from harness import grouped
from pages import markdown, results, times


def milliseconds(row):
    value = float(row["ms_median"])
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"


def boxes_table(rows):
    """Finding the pairs alone: one row for each method and number of threads."""
    counts = list(dict.fromkeys(int(r["bodies"]) for r in rows))
    lines = []
    for (method, threads), mine in grouped(rows, "method", "threads").items():
        by_count = {int(r["bodies"]): milliseconds(r) for r in mine}
        lines.append([method.replace("anew", "rebuilt"), threads, *(by_count.get(n, "") for n in counts)])
    return markdown(["pairs within 2 m, ms", "threads", *(f"{n:,}" for n in counts)], lines)


def queries_table(rows):
    """Whole queries: brute force, the tree, and the ratio."""
    counts = list(dict.fromkeys(int(r["bodies"]) for r in rows))
    lines = []
    for (what, threads), mine in grouped(rows, "what", "threads").items():
        cells = []
        for n in counts:
            at = {r["method"]: r for r in mine if int(r["bodies"]) == n}
            if "brute" in at:
                ratio = float(at["brute"]["ms_median"]) / float(at["tree"]["ms_median"])
                cells.append(f"{milliseconds(at['brute'])} / {milliseconds(at['tree'])}, **{times(ratio)}**")
            else:
                cells.append(f"/ {milliseconds(at['tree'])}")
        lines.append([what, threads, *cells])
    return markdown(["query, ms: brute force / tree", "threads", *(f"{n:,}" for n in counts)], lines)


def broad():
    remark, rows = results("broad")
    lines = [f"From `docs/results/broad.csv` ({remark}):"]
    for setting, mine in grouped(rows, "setting").items():
        boxes = [r for r in mine if r["what"] == "boxes"]
        most = max(boxes, key=lambda r: int(r["bodies"]))
        lines += [
            "",
            f"**{setting}**, {int(most['pairs']):,} pairs of {int(most['bodies']):,} bodies",
            "",
            boxes_table(boxes),
            "",
            queries_table([r for r in mine if r["what"] != "boxes"]),
        ]
    return "\n".join(lines)


TABLES = {"broad": broad}
