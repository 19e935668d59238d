"""Tables of docs/trust/accuracy.md and docs/notes/accuracy.md: answers against exact arithmetic."""

from pages import markdown, results

GROUPS = [("cpu", "f64"), ("cpu", "f32"), ("reference", "f64")]


def kinds():
    """The run against exact arithmetic: one row for each kind of query."""
    remark, rows = results("accuracy")
    by_kind = {}
    for row in rows:
        if row["backend"] == "cpu":
            by_kind.setdefault((row["depth"] == "signed", row["precision"], float(row["rel_tol"])), []).append(row)

    def line(kind, rows):
        signed, precision, rel_tol = kind
        what = "signed distance" if signed else "distance"
        what += ", float32 iterations" if precision == "f32" else ""
        what += f", to {rel_tol:g}" if rel_tol else ", as narrow as float64 goes"
        total = {key: sum(int(row[key]) for row in rows) for key in ("cases", "violations", "unconverged")}
        worst = {key: max(float(row[key]) for row in rows) for key in ("worst_error", "worst_width")}
        return [what, f"{total['cases']:,}", str(total["violations"]), f"{worst['worst_error']:.2f}",
                f"{worst['worst_width']:.2f}", str(total["unconverged"])]

    table = markdown(
        ["query", "answers checked", "misses", "worst error", "widest interval", "wider than requested"],
        [line(kind, by_kind[kind]) for kind in sorted(by_kind)],
    )
    source = "[results/accuracy.csv](../results/accuracy.csv)"
    return f"{table}\n\nFrom {source} ({remark}), by `build/bin/clearance-certify`."


def worst(rows, column):
    values = [float(r[column]) for r in rows]
    return f"{max(values):.2g}" if values else "-"


def classes(file, label_of_meeting, meeting):
    """One row for each class. meeting: the columns that count pairs that are not apart."""
    remark, rows = results(file)
    errors = " / ".join(" ".join(g) for g in GROUPS)
    header = ["class", "pairs", label_of_meeting, "answers", "violations", f"worst error: {errors}",
              "worst width: the same", "contact", "unconverged"]  # fmt: skip
    lines, total = [], dict(pairs=0, touching=0)
    for name in [*dict.fromkeys(r["class"] for r in rows), None]:
        mine = [r for r in rows if name in (None, r["class"])]
        answers = sum(int(r["cases"]) for r in mine)
        violations = sum(int(r["violations"]) for r in mine)
        if name is None:
            pairs, touching, label = total["pairs"], total["touching"], "**all**"
        else:
            pairs, touching, label = int(mine[0]["cases"]), sum(int(mine[0][c]) for c in meeting), f"`{name}`"
            total = dict(pairs=total["pairs"] + pairs, touching=total["touching"] + touching)
        by_group = [[r for r in mine if (r["backend"], r["precision"]) == g] for g in GROUPS]
        share = [f"{100 * sum(int(r[c]) for r in mine) / answers:.3g} %" for c in ("contact", "unconverged")]
        figures = (" / ".join(worst(g, column) for g in by_group) for column in ("worst_error", "worst_width"))
        lines.append([label, *map(str, (pairs, touching, answers, violations)), *figures, *share])
    return f"From `docs/results/{file}.csv` ({remark}):\n\n{markdown(header, lines)}"


TABLES = {
    "accuracy": kinds,
    "accuracy classes": lambda: classes("accuracy", "touching", ["touching"]),
    "mesh accuracy classes": lambda: classes("mesh_accuracy", "in contact", ["touching", "overlapping"]),
}
