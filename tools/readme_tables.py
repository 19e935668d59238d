#!/usr/bin/env python3
"""Writes the tables of docs/accuracy.md, latency.md, cuda.md and robots.md from docs/results.

    tools/readme_tables.py            write them
    tools/readme_tables.py --check    exit code 1 if they are not those of the files

A table stands in a page between a line `<!-- table NAME -->` and a line `<!-- end -->`.
"""
import csv
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGES = ["docs/accuracy.md", "docs/latency.md", "docs/cuda.md", "docs/robots.md"]
GPU = "gpu_nvidia_h100_80gb_hbm3"
GPU_PLANS = "gpu_plans_nvidia_h100_80gb_hbm3"
GPU_DAEMON = "gpu_daemon_nvidia_h100_80gb_hbm3"
NAMES = {"shm": "shared memory", "zmq-ipc": "ZeroMQ, ipc", "zmq-tcp": "ZeroMQ, tcp", "lcm": "LCM"}


def read(name):
    """(first line's remark, rows) of docs/results/NAME.csv."""
    lines = (ROOT / "docs/results" / f"{name}.csv").read_text().splitlines()
    remark = lines[0].lstrip("# ") if lines[0].startswith("#") else ""
    return remark, list(csv.DictReader(line for line in lines if not line.startswith("#")))


def markdown(header, rows, words=1):
    """A table whose first columns are words and whose others are numbers."""
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * words + "---:|" * (len(header) - words)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows])


def accuracy():
    """The campaign against exact arithmetic: one row for each kind of question."""
    remark, rows = read("accuracy")
    kinds = {}
    for row in rows:
        if row["backend"] == "cpu":
            kinds.setdefault((row["depth"] == "signed", row["precision"], float(row["rel_tol"])), []).append(row)

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
        ["question", "answers judged", "intervals that miss", "worst error", "widest interval", "wider than asked"],
        [line(kind, kinds[kind]) for kind in sorted(kinds)],
    )
    return f"{table}\n\nFrom [results/accuracy.csv](results/accuracy.csv) ({remark}), by `build/bin/clearance-certify`."


def question(row):
    """What a row of `clearance bench` asked."""
    configurations = int(row["configs"])
    text = f"{row['pairs']} pair{'s' if row['pairs'] != '1' else ''}"
    text += f" x {configurations} configurations" if configurations else ""
    return text + ("" if row["mode"] == "closed" else f", {float(row['mode']):g} a second")


def latency_bars():
    """What is added to floor and engine, and the bars, for docs/latency.md."""
    _, rows = read("latency")

    def line(row):
        keys = ("floor_p50_us", "engine_p50_us", "p50_us", "added_p50_us")
        unit = " us" if row["transport"] == "shm" else ""
        return [question(row), NAMES[row["transport"]], *(f"{float(row[key]):,.2f}" for key in keys),
                f"{float(row['p50_bar']):.2f}{unit} ({float(row['p50_bar_limit']):g}): {row['p50_bar_met']}",
                f"{float(row['p99.9_us']):,.0f}", f"{float(row['p99.9_bar']):.2f} (2): {row['p99.9_bar_met']}",
                f"{float(row['throughput_hz']):,.0f}"]

    return markdown(
        [
            "query",
            "transport",
            "floor",
            "engine",
            "p50",
            "added",
            "bar: met?",
            "p99.9",
            "over floor: met?",
            "queries/s",
        ],
        [line(row) for row in rows],
        words=2,
    )


def latency_doorbell():
    """What spinning buys, with cores apart, shared and busy, for docs/latency.md."""
    _, rows = read("latency_doorbell")

    def line(row):
        keys = ("p50_us", "p99_us", "transport_p50_us", "floor_p50_us")
        return [
            row["cores"],
            question(row),
            f"{int(row['client_spin_us']):,}",
            *(f"{float(row[key]):,.1f}" for key in keys),
            f"{float(row['throughput_hz']):,.0f}",
        ]

    return markdown(["cores", "query", "client spins [us]", "p50", "p99", "transport p50", "floor p50", "queries/s"],
                    [line(row) for row in rows], words=2)


def microseconds(text):
    """A CSV's figure for a table; nothing where nothing was measured."""
    value = float(text or 0)
    return "" if value == 0 else f"{value:,.0f}" if value >= 10 else f"{value:.1f}"


GPU_NAMES = {
    "2 arms of 35 pieces, 10 obstacles of 71, 4096 configurations, compact, f32": "the same, f32",
    "2 arms of 35 pieces, 10 obstacles of 71, 4096 configurations, near 0.1, compact": "the same, `max_distance` 0.1",
    "2 arms of 35 pieces, 10 obstacles of 71, 4096 configurations, min": "the same, min",
    "2 arms of 35 pieces, 10 obstacles of 71, 4096 configurations, depth, compact": "the same, with depths",
    "30 hulls, 150 pairs, 4096 configurations, depth, compact":
        "30 hulls, 150 pairs, 4096 configurations, compact, with depths",
}


def gpu_all():
    """Every row of the GPU benchmark, for docs/cuda.md."""
    _, rows = read(GPU)
    cores = rows[0]["cpu_cores"]

    def line(row):
        keys = ("kernel_us", "wall_pinned_us", "wall_pageable_us", "cpu_wall_us")
        routed = f"{microseconds(row['auto_wall_us'])} ({row['auto_backend']})" if row["auto_wall_us"] else ""
        return [
            GPU_NAMES.get(row["workload"], row["workload"]),
            f"{int(row['pairs']):,}",
            *(microseconds(row[key]) for key in keys),
            routed,
        ]

    return markdown(
        [
            "work",
            "pairs",
            "kernels [us]",
            "wall, pinned [us]",
            "wall, pageable [us]",
            f"CPU, {cores} cores [us]",
            "`auto` [us]",
        ],
        [line(row) for row in rows],
    )


def gpu_plans():
    """What a query takes whose poses and answers stay on the device, for docs/cuda.md."""
    _, rows = read(GPU_PLANS)
    keys = ("resident_us", "graph_us", "in_a_row_us", "to_host_us")

    def line(row):
        return [GPU_NAMES.get(row["workload"], row["workload"]), f"{int(row['pairs']):,}",
                *(microseconds(row[key]) for key in keys)]

    return markdown(["work", "pairs", "one run [us]", "in a graph [us]", "ten in a row, each [us]", "to the host [us]"],
                    [line(row) for row in rows])


def gpu_daemon():
    """Rows of a daemon's plan beside those of its replies, for docs/cuda.md."""
    _, rows = read(GPU_DAEMON)
    names = ("rows there [us]", "read by a kernel of the client's [us]", "in host memory [us]")
    keys = ("rows_there_us", "rows_read_us", "host_us")

    def line(row):
        how = "taking turns" if row["how"] == "alone" else "with MPS"
        return [row["columns"], row["poses"], how, *(microseconds(row[key]) for key in keys)]

    return markdown(["columns", "poses", "processes", *names], [line(row) for row in rows])


ROBOTS = {"panda": "Panda", "ur5": "UR5", "fetch": "Fetch", "baxter": "Baxter"}
COAL = "Coal"  # in tables of robots: the faster of its ways


def by_robot(ways):
    """Microseconds a state beside Coal, for docs/robots.md, of the ways {(question, contender): header}."""
    remark, rows = read("robots")
    found = {}
    for row in rows:
        key = row["robot"], row["states"], row["question"]
        found.setdefault(key, {})[row["contender"]] = float(row["us_a_state"])

    def figure(contenders, name):
        best = min(us for contender, us in contenders.items() if contender.startswith(COAL))
        if name == COAL:
            return f"{best:.3g}"
        us = contenders.get(name)
        return "" if us is None else f"{us:.3g}, **{best / us:.2g}x**"

    lines = [
        [ROBOTS[robot], states, *(figure(found[robot, states, question], name) for question, name in ways)]
        for robot in ROBOTS
        for states in ("free", "colliding")
        if (robot, states, "valid") in found
    ]
    return f"{markdown(['', 'states', *ways.values()], lines, words=2)}\n\nFrom `docs/results/robots.csv` ({remark})."


def robots():
    """Many states a call."""
    return by_robot({
        ("valid", COAL): "Coal: valid",
        ("valid", "Clearance in process"): "ours",
        ("valid", "Clearance over shared memory"): "shared memory",
        ("least", COAL): "Coal: least distance",
        ("least", "Clearance in process"): "ours",
        ("least", "Clearance over shared memory"): "shared memory",
    })  # fmt: skip


def robots_one_a_call():
    """One state a call."""
    return by_robot({
        ("valid", COAL): "Coal: valid",
        ("valid", "Clearance in process, one a call"): "`check()`",
        ("valid", "Clearance in process, prepared, one a call"): "prepared",
        ("valid", "Clearance over shared memory, prepared, one a call"): "prepared, shared memory",
        ("least", COAL): "Coal: least distance",
        ("least", "Clearance in process, one a call"): "`distances()`",
        ("least", "Clearance in process, prepared, one a call"): "prepared",
        ("least", "Clearance over shared memory, prepared, one a call"): "prepared, shared memory",
    })  # fmt: skip


def rrt():
    """RRT-Connect end to end, and where its time goes, for docs/robots.md."""
    remark, rows = read("rrt")
    keys = ("total_ms", "checking_ms", "kinematics_ms", "transport_ms", "planning_ms")

    def line(row):
        ours = row["contender"].startswith("Clearance")
        figures = [f"{float(row[key]):.3g}" if ours or key != "transport_ms" else "" for key in keys]
        return [ROBOTS[row["robot"]], row["contender"], row["problems"], f"{int(row['states']):,}", *figures]

    header = ["", "edges asked of", "problems", "states", "whole plan [ms]", "checking", "kinematics", "transport",
              "planner"]  # fmt: skip
    return f"{markdown(header, [line(row) for row in rows], words=2)}\n\nFrom `docs/results/rrt.csv` ({remark})."


TABLES = {"robots": robots, "robots_one_a_call": robots_one_a_call, "rrt": rrt, "accuracy": accuracy,
          "latency_bars": latency_bars, "latency_doorbell": latency_doorbell,
          "gpu_all": gpu_all, "gpu_plans": gpu_plans, "gpu_daemon": gpu_daemon}


def fill(page, text):
    """The page's text with every table made anew. Raises SystemExit naming a table that nobody can make."""
    out, lines = [], iter(text.splitlines())
    for line in lines:
        out.append(line)
        if line.startswith("<!-- table "):
            name = line.split()[2]
            if name not in TABLES:
                sys.exit(f"{page}: no table is called {name!r}; there are {', '.join(TABLES)}")
            out.append(TABLES[name]())
            for line in lines:
                if line == "<!-- end -->":
                    out.append(line)
                    break
            else:
                sys.exit(f"{page}: table {name!r} has no <!-- end --> line")
    return "\n".join(out) + "\n"


def main():
    if sys.argv[1:] not in ([], ["--check"]):
        sys.exit(__doc__)
    pages = {page: (ROOT / page).read_text() for page in PAGES}
    nowhere = [name for name in TABLES if not any(f"<!-- table {name} -->" in text for text in pages.values())]
    if nowhere:
        sys.exit(f"no page shows the table {' or '.join(nowhere)}")
    for page, old in pages.items():
        new = fill(page, old)
        if not sys.argv[1:]:
            (ROOT / page).write_text(new)
        elif new != old:
            sys.exit(f"{page}: its tables are not those of docs/results; run tools/readme_tables.py")


if __name__ == "__main__":
    main()
