"""Tables of docs/cuda.md."""

from pages import markdown, results

GPU = "gpu_nvidia_h100_80gb_hbm3"
GPU_PLANS = "gpu_plans_nvidia_h100_80gb_hbm3"
GPU_DAEMON = "gpu_daemon_nvidia_h100_80gb_hbm3"


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
    """Every row of the GPU benchmark."""
    _, rows = results(GPU)
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
    """What a query takes whose poses and answers stay on the device."""
    _, rows = results(GPU_PLANS)
    keys = ("resident_us", "graph_us", "in_a_row_us", "to_host_us")

    def line(row):
        return [GPU_NAMES.get(row["workload"], row["workload"]), f"{int(row['pairs']):,}",
                *(microseconds(row[key]) for key in keys)]

    return markdown(["work", "pairs", "one run [us]", "in a graph [us]", "ten in a row, each [us]", "to the host [us]"],
                    [line(row) for row in rows])


def gpu_daemon():
    """Rows of a daemon's plan beside those of its replies."""
    _, rows = results(GPU_DAEMON)
    names = ("rows there [us]", "read by a kernel of the client's [us]", "in host memory [us]")
    keys = ("rows_there_us", "rows_read_us", "host_us")

    def line(row):
        how = "taking turns" if row["how"] == "alone" else "with MPS"
        return [row["columns"], row["poses"], how, *(microseconds(row[key]) for key in keys)]

    return markdown(["columns", "poses", "processes", *names], [line(row) for row in rows])


TABLES = {"gpu_all": gpu_all, "gpu_plans": gpu_plans, "gpu_daemon": gpu_daemon}
