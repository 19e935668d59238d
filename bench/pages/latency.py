"""Tables of docs/service/latency.md, docs/notes/latency.md, docs/control.md and docs/examples.md."""

from harness import grouped
from pages import markdown, results

NAMES = {"shm": "shared memory", "zmq-ipc": "ZeroMQ, ipc", "zmq-tcp": "ZeroMQ, tcp", "lcm": "LCM"}


def question(row):
    """Query of a row of `clearance bench`."""
    configurations = int(row["configs"])
    text = f"{row['pairs']} pair{'s' if row['pairs'] != '1' else ''}"
    text += f" x {configurations} configurations" if configurations else ""
    return text + ("" if row["mode"] == "closed" else f", {float(row['mode']):g} a second")


def latency_bars():
    """Time added to baseline and engine, and the targets."""
    _, rows = results("latency")

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
            "baseline",
            "engine",
            "p50",
            "added",
            "target: met?",
            "p99.9",
            "over baseline: met?",
            "queries/s",
        ],
        [line(row) for row in rows],
        words=2,
    )


def latency_doorbell():
    """Effect of spinning, with cores apart, shared and busy."""
    _, rows = results("latency_doorbell")

    def line(row):
        keys = ("p50_us", "p99_us", "transport_p50_us", "floor_p50_us")
        return [
            row["cores"],
            question(row),
            f"{int(row['client_spin_us']):,}",
            *(f"{float(row[key]):,.1f}" for key in keys),
            f"{float(row['throughput_hz']):,.0f}",
        ]

    return markdown(["cores", "query", "client spins [us]", "p50", "p99", "transport p50", "baseline p50", "queries/s"],
                    [line(row) for row in rows], words=2)


def throughput():
    """Queries of one pair a second, by clients and transport."""
    _, rows = results("latency_throughput")
    rows = [row for row in rows if row["pairs"] == row["depth"] == "1"]
    rates = {(row["transport"], row["clients"]): float(row["queries_per_s"]) for row in rows}
    clients = {"1": "1", "8": "8, on the one CPU left to them"}
    over = ("shm", "zmq-ipc", "lcm")
    lines = [[name, *(f"{rates[transport, count]:,.0f}" for transport in over)] for count, name in clients.items()]
    return markdown(["clients", *(NAMES[transport] for transport in over)], lines)


def classes():
    """Waiting times of a control query next to each planning client, and next to busy programs."""
    machines = {
        ("classes_own_cpus", "ordinary"): "[separate CPUs](../results/classes_own_cpus.csv), 16 virtual",
        ("classes_own_cpus", "--real-time"): "the same, `--real-time`",
        ("classes", "--real-time"): "[two shared CPUs](../results/classes.csv), `--real-time`",
        ("classes", "ordinary"): "the same, ordinary daemon",
    }
    lines = []
    for (name, daemon), machine in machines.items():
        rows = grouped(results(name)[1], "daemon")[daemon]
        busy = [row for row in rows if row["beside"] == "busy CPUs"]
        others = [row for row in rows if row["beside"] != "busy CPUs"]
        waits = [float(row["p99.9_us"]) / 1e3 for row in others]
        loads = [float(row["load"]) for row in rows]
        met = sum(row["met"] == "yes" for row in others)
        lines.append([
            machine,
            " to ".join(dict.fromkeys(f"{load:.0f}" for load in (min(loads), max(loads)))),
            f"{min(waits):.2g} to {max(waits):.2g} ms",
            f"{float(busy[0]['p99.9_us']) / 1e3:.2g} ms",
            f"{met} of {len(others)}",
        ])
    return markdown(["machine", "load", "p99.9 next to the clients", "next to busy programs", "target met"], lines)


def view():
    """Waiting times of a control loop with and without a viewer."""
    _, rows = results("view")
    lines = [
        [row["daemon"].replace("--real-time", "`--real-time`"), row["beside"].replace("viewer", "a viewer"),
         f"{float(row['p50_us']):.1f}", f"{float(row['p99.9_us']):,.0f}",
         f"{float(row['least_p99.9_us']):,.0f} to {float(row['most_p99.9_us']):,.0f}", f"{float(row['max_us']):,.0f}"]
        for row in rows
    ]
    return markdown(["daemon", "load", "p50", "p99.9", "p99.9, range", "max"], lines, words=2)


def qp_columns():
    """Times of 20 rows of a QP by their columns."""
    _, rows = results("columns")
    keys = ("engine_us", "process_p50_us", "shm_p50_us", "process_p99.9_us", "shm_p99.9_us")
    names = {"lower": "`lower`", "lower normal gradient_joints": "the same, `normal`, `gradient_joints`"}
    first_order = "lower normal gradient_joints rate"

    def name_of(columns):
        if columns in names:
            return names[columns]
        added = columns.removeprefix(first_order).split()
        if len(added) > 1:
            return "all of these"
        return f"first order and `{added[0]}`" if added else "the same and `rate`: first order"

    lines = [
        [name_of(row["columns"]), *(f"{float(row[key]):,.0f}" for key in keys), f"{float(row['idle_p99.9_us']):,.1f}"]
        for row in rows
    ]
    header = ["columns", "engine", "Python", "shared memory", "p99.9: Python", "shared memory", "bare loop"]
    return markdown(header, lines)


TABLES = {
    "latency_bars": latency_bars,
    "latency_doorbell": latency_doorbell,
    "throughput": throughput,
    "classes": classes,
    "view": view,
    "qp_columns": qp_columns,
}
