"""Tables of docs/latency.md."""

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


TABLES = {"latency_bars": latency_bars, "latency_doorbell": latency_doorbell}
