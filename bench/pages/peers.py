"""Tables and picture of the peers in docs/performance.md and docs/trust/accuracy.md."""

from harness import grouped
from pages import markdown, plot, results, times

PICTURE = "pictures/performance.png"
LEFT_OUT = {("two_2M", "Bullet"), ("two_2M", "Bullet f32")}  # 80 ms a pair, and wrong
RIGHT = 1e-5  # a peer's setting counts if its worst relative error in the run is below


def best(rows, contender):
    """The contender's fastest correct setting, or its fastest one if none is correct; and whether it is correct."""
    mine = [r for r in rows if r["contender"] == contender and r.get("ns_median")]
    right = [r for r in mine if float(r["worst_relative_error"]) < RIGHT]
    rows = right or mine
    return (min(rows, key=lambda r: float(r["ns_median"])), bool(right)) if rows else (None, False)


def nanoseconds(value):
    return f"{value:,.0f} ns" if value < 1e4 else f"{value / 1e3:,.1f} us" if value < 1e7 else f"{value / 1e6:,.1f} ms"


def figure(row):
    error = float(row["worst_relative_error"])
    return "0" if error == 0 else f"{error:.0e}"


def ours(rows, precision):
    return next(r for r in rows if r["contender"] == "Clearance" and r["setting"].startswith(precision))


def peer_cells(rows, show):
    """The peers' best settings: show(row) and the time over ours."""
    cells = []
    for contender in ("Coal", "FCL", "Bullet"):
        r, right = best(rows, contender)
        if r is None:
            cells.append("left out" if (rows[0]["workload"], contender) in LEFT_OUT else "rejected")
            continue
        ratio = times(float(r["over_ours_f64"]))
        cells.append(f"{show(r)}, " + (f"**{ratio}**" if right else f"{ratio}, *wrong*"))
    return cells


def timing():
    """(machine and date, rows by workload)."""
    remark, rows = results("peers_timing")
    loads = [float(row["load"]) for row in rows if row.get("load")]
    timed = [row for row in rows if row["commit"]]
    measured = dict.fromkeys(f"{row['machine']}, {row['date']}, commit {row['commit']}" for row in timed)
    return "; ".join([*measured, remark]) + f", load {min(loads):.0f} to {max(loads):.0f}", grouped(rows, "workload")


def timing_table():
    def show(r):
        return f"{nanoseconds(float(r['ns_median']))} ({figure(r)})"

    remark, groups = timing()
    lines = [
        [rows[0]["what"], show(ours(rows, "f64")), show(ours(rows, "f32")), *peer_cells(rows, show)]
        for rows in groups.values()
    ]
    faster = [f"{1 / float(r['over_ours_f64']):.2f}x ({r['what']})" for rows in groups.values() for r in rows
              if r["setting"].endswith("two threads")]
    threads = f"\n\nTwo threads over one, float64: {', '.join(faster)}." if faster else ""
    table = markdown(["work", "ours, float64", "ours, float32", "Coal", "FCL", "Bullet"], lines)
    return f"From `docs/results/peers_timing.csv` ({remark}):\n\n{table}{threads}"


def draw(path):
    _, groups = timing()
    plt = plot()
    names = ["Clearance f64", "Clearance f32", "Coal", "FCL", "Bullet"]
    figure, axes = plt.subplots(figsize=(11, 6), layout="constrained")
    for i, name in enumerate(names):
        heights = []
        for rows in groups.values():
            if name.startswith("Clearance"):
                r = next(r for r in rows if r["contender"] == "Clearance" and r["setting"].startswith(name[-3:]))
                heights.append(float(r["ns_median"]))
            else:
                r, right = best(rows, name)
                heights.append(float(r["ns_median"]) if r and right else float("nan"))
        axes.barh([k + (i - 2) * 0.16 for k in range(len(groups))], heights, 0.16, label=name)
    axes.set_yticks(range(len(groups)), [rows[0]["what"] for rows in groups.values()])
    axes.invert_yaxis()
    axes.set_xscale("log")
    axes.set_xlabel("ns per pair, one thread; a peer's fastest setting that is right to 1e-5 (no bar: none is)")
    axes.grid(axis="x", alpha=0.3)
    axes.legend()
    figure.savefig(path, dpi=100)


def share(count, cases):
    return "0" if not count else f"{100 * count / cases:.2g} %" if count < cases else "all"


def total(rows, *keys):
    return sum(int(r[k]) for r in rows for k in keys)


def accuracy_table():
    remark, rows = results("peers_accuracy")
    tried = list(dict.fromkeys((r["contender"], r["setting"]) for r in rows if r["contender"] != "Bullet f32"))
    label = {"Clearance": "ours"}
    names = [label.get(c, f"{c} {s}" if c == "Coal" else c) for c, s in tried]
    lines = []
    groups = grouped(rows, "class")
    for name in [*groups, None]:
        cells = [f"`{name}`" if name else "**all**"]
        for who in tried:
            mine = [r for r in rows if (r["contender"], r["setting"]) == who and name in (None, r["class"])]
            cases, none = total(mine, "cases"), total(mine, "refused", "crashed", "hung")
            cells.append(" / ".join(share(x, cases) for x in (total(mine, "wrong"), total(mine, "wrong_by_1e-3"),
                                                               total(mine, "wrong_by_1e-6_of_size"), none)))
        lines.append(cells)
    return (
        f"From `docs/results/peers_accuracy.csv` ({remark}); shares of all "
        "cases.\nEach cell: wrong by more than 1e-6 of the distance (and 16 eps S) / by more than 1e-3 of it / by "
        "more than 1e-6 of S, the bodies' size and separation / without an answer (rejected, crashed or "
        "hung).\n\n" + markdown(["class", *names], lines)
    )


TABLES = {"peers timing": timing_table, "peers accuracy": accuracy_table}
