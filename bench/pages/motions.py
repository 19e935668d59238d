"""Tables of docs/motions.md: microseconds of edges, compared with samples and with the exact search."""

from pages import markdown, results
from pages.robots import ROBOTS

KINDS = {"states": "states", "near": "edges near", "anywhere": "anywhere"}
WAYS = {"batch": "batch", "call": "one a call"}


def motion_edges():
    """Edges by the columns that are requested, compared with samples."""
    header = ["", "margin [mm]", "verdict", "and pair, time", "and steps", "samples", "verdict / samples", "undecided",
              "missed by samples"]  # fmt: skip
    keys = ("us_a_verdict", "us_with_pair", "us_with_steps", "us_a_sampled_edge", "verdict_over_sampling", "undecided",
            "missed_by_samples")  # fmt: skip
    rows = [row for row in results("motions")[1] if row["edges"]]
    lines = [[ROBOTS[row["robot"]], f"{1e3 * float(row['margin_m']):g}", *(row[key] for key in keys)] for row in rows]
    return markdown(header, lines)


def motion_verdicts():
    """Verdicts alone in C++: microseconds, and how many times faster than without covers."""
    columns = {(kind, way): f"{title}, {words}" for kind, title in KINDS.items() for way, words in WAYS.items()}
    lines = {}
    for row in results("motions")[1]:
        if not row["edges"]:
            kind, verdict = row["of"].rsplit(" ", 1)
            cells = lines.setdefault((row["robot"], row["margin_m"], verdict), {})
            cells[kind, row["way"]] = f"{float(row['us']):.2g}, **{float(row['times_off']):.2g}x**"
    rows = [
        [ROBOTS[robot], f"{1e3 * float(margin):g}", verdict, *(cells.get(column, "") for column in columns)]
        for (robot, margin, verdict), cells in lines.items()
    ]
    return markdown(["", "margin [mm]", "verdict", *columns.values()], rows, words=3)


TABLES = {"motion_edges": motion_edges, "motion_verdicts": motion_verdicts}
