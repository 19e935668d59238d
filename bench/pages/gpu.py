"""Tables of docs/cuda.md and docs/cuda_measured.md."""

from pages import markdown, results

GPU = "gpu_nvidia_h200"
GPU_PLANS = "gpu_plans_nvidia_h200"
GPU_FLOOR = "gpu_floor_nvidia_h200"
GPU_DAEMON = "gpu_daemon_nvidia_h200"


def microseconds(text):
    """A number of a CSV for a table; empty if it was not measured."""
    value = float(text or 0)
    return "" if value == 0 else f"{value:,.0f}" if value >= 10 else f"{value:.1f}"


SPHERES, BIG_SPHERES = "1000 spheres, box 100", "5000 spheres, box 171"
HULLS = "30 hulls, 150 pairs, 4096 configurations"
ARMS = "2 arms of 35 pieces, 10 obstacles of 71, 4096 configurations"
ARM = "an arm of 8 hulls, 21 things"
CLOUD = "an arm of 8 hulls in a cloud of 100,000 points, 4096 configurations of joints"
MESHES = "an arm of 7 meshes, 21 things, 4096 configurations of joints"
#: Workloads of the page's tables by their name there. The files have more.
GPU_ROWS = [
    (f"{SPHERES}, float32", f"{SPHERES}, float32"),
    (f"{BIG_SPHERES}, float32", f"{BIG_SPHERES}, float32"),
    (f"{HULLS}, float32", f"{HULLS}, float32"),
    ("the same with status and flags", f"{HULLS}, float32, status and flags"),
    ("the same, with depths", f"{HULLS}, depth, float32"),
    ("spheres, 1 pair", "spheres, 1 pair, float32"),
    ("spheres, 10000 pairs", "spheres, 10000 pairs, float32"),
    ("50000 spheres, box 368, within 2", "50000 spheres, box 368, within 2"),
    (f"{HULLS}, min", f"{HULLS}, min"),
    ("2 arms of 35 parts, 10 obstacles of 71, 4096 configurations", f"{ARMS}, float32"),
    ("the same, `max_distance` 0.1", f"{ARMS}, near 0.1, float32"),
    ("the same, min", f"{ARMS}, min"),
    (f"{ARM}, 4,096 configurations, any", f"{ARM}, 4096 configurations of joints, any"),
    ("the same, min", f"{ARM}, 4096 configurations of joints, min"),
    ("the same, a row for each pair", f"{ARM}, 4096 configurations of joints, bounds and status"),
    (f"{ARM}, 1,048,576 configurations, any", f"{ARM}, 1048576 configurations of joints, any"),
    ("an arm in a cloud of 100,000 points, any", f"{CLOUD}, any"),
    ("an arm of 7 meshes, 21 things, any", f"{MESHES}, any"),
    ("an arm of 7 meshes, 21 things, min", f"{MESHES}, min"),
    (f"{SPHERES}, the 2023 report's blocks", f"{SPHERES}, the report's block for each pair"),
]
PLAN_ROWS = [
    (f"{SPHERES}, float32", f"{SPHERES}, float32"),
    ("the same, lower and upper", f"{SPHERES}, lower and upper"),
    ("the same, bounds in float32", f"{SPHERES}, bounds in float32"),
    (f"{HULLS}, float32", f"{HULLS}, float32"),
    ("the same, lower and upper", f"{HULLS}, lower and upper"),
    (f"{HULLS}, min", f"{HULLS}, min"),
    ("spheres, 1 pair", "spheres, 1 pair, float32"),
    ("2 arms of 35 parts, 10 obstacles of 71, 4096 configurations", f"{ARMS}, float32"),
    ("the same, min", f"{ARMS}, min"),
    (f"{ARM}, 4,096 configurations, any", f"{ARM}, 4096 configurations of joints, any"),
    (
        f"{ARM}, 4,096 configurations, min, gradients by joints",
        f"{ARM}, 4096 configurations of joints, min, gradients by joints",
    ),
    (f"{ARM}, 1,048,576 configurations, any", f"{ARM}, 1048576 configurations of joints, any"),
]


def workloads(name, shown):
    """(name on the page, row) of some workloads of a file."""
    rows = {row["workload"]: row for row in results(name)[1]}
    return [(shown_as, rows[workload]) for shown_as, workload in shown]


def gpu_all():
    """The GPU benchmark."""
    rows = workloads(GPU, GPU_ROWS)
    cores = rows[0][1]["cpu_cores"]

    def line(name, row):
        keys = ("kernel_us", "wall_pinned_us", "wall_pageable_us", "cpu_wall_us")
        routed = f"{microseconds(row['auto_wall_us'])} ({row['auto_backend']})" if row["auto_wall_us"] else ""
        return [name, f"{int(row['pairs']):,}", *(microseconds(row[key]) for key in keys), routed]

    header = ["work", "pairs", "kernels", "wall, pinned", "wall, pageable", f"CPU, {cores} cores", "`auto`"]
    return markdown(header, [line(*row) for row in rows])


def gpu_plans():
    """Queries whose poses and answers stay on the device."""
    keys = ("resident_us", "graph_us", "in_a_row_us")
    lines = [
        [name, f"{int(row['pairs']):,}", *(microseconds(row[key]) for key in keys)]
        for name, row in workloads(GPU_PLANS, PLAN_ROWS)
    ]
    return markdown(["work", "pairs", "one run", "in a graph", "ten in a row, each"], lines)


def gpu_floor():
    """States a second without proofs, and with them."""
    lines = [[row["work"], int(row["states"]), float(row["graph_us"])] for row in results(GPU_FLOOR)[1]]
    plans = {row["workload"]: row for row in results(GPU_PLANS)[1]}
    for states in (4096, 1048576):
        row = plans[f"{ARM}, {states} configurations of joints, any"]
        lines.append([f"Clearance: {ARM}; proved", states, float(row["graph_us"])])
    return markdown(
        ["work", "states", "us", "million states a second"],
        [[work, f"{states:,}", f"{us:,.0f}", f"{states / us:,.0f}"] for work, states, us in lines],
    )


def gpu_daemon():
    """Rows of a daemon's device query, compared with those of its replies."""
    rows = [row for row in results(GPU_DAEMON)[1] if row["columns"] != "bounds in float32"]
    names = ("rows ready", "read by the client's kernel", "in host memory")
    keys = ("rows_there_us", "rows_read_us", "host_us")

    def line(row):
        how = "taking turns" if row["how"] == "alone" else "with MPS"
        return [row["columns"], row["poses"], how, *(microseconds(row[key]) for key in keys)]

    return markdown(["columns", "poses", "processes", *names], [line(row) for row in rows])


TABLES = {"gpu_all": gpu_all, "gpu_plans": gpu_plans, "gpu_floor": gpu_floor, "gpu_daemon": gpu_daemon}
