#!/usr/bin/env python3
"""Draws docs/robots.png from docs/results/robots.csv and rrt.csv: microseconds a state, and where a plan's time goes.

    bench/robots/draw.py
"""

import csv
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(Path(__file__).parent))
from environment import in_own_environment  # noqa: E402

PICTURE = ROOT / "docs" / "robots.png"
WAYS = {
    "Coal": ("#999999", "Pinocchio and Coal, the faster way"),
    "Clearance over shared memory": ("#74a9cf", "Clearance, shared memory, batches"),
    "Clearance in process": ("#045a8d", "Clearance in process, batches"),
    "Clearance in process, prepared, one a call": ("#fdae61", "the same, one state a call"),
}
SHARES = {"kinematics": "#fdae61", "distances": "#045a8d", "transport": "#74a9cf", "planning": "#dddddd"}


def read(name):
    lines = (ROOT / "docs/results" / f"{name}.csv").read_text().splitlines()
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))


def times(rows, robot, question):
    """Microseconds a free state, by way."""
    found = {}
    for row in rows:
        if (row["robot"], row["question"], row["states"]) == (robot, question, "free"):
            name = "Coal" if row["contender"].startswith("Coal") else row["contender"]
            found[name] = min(found.get(name, float("inf")), float(row["us_a_state"]))
    return found


def draw_states(axis, rows, question, title):
    robots = list(dict.fromkeys(row["robot"] for row in rows))
    for i, (way, (colour, label)) in enumerate(WAYS.items()):
        heights = [times(rows, robot, question).get(way, 0) for robot in robots]
        axis.bar([r + 0.2 * (i - 1.5) for r in range(len(robots))], heights, 0.2, color=colour, label=label)
    axis.set_xticks(range(len(robots)), robots)
    axis.set_ylabel("us a state")
    axis.set_title(title, fontsize=10)


def draw_plans(axis, rows):
    labels = [f"{row['robot']}: {row['contender']}" for row in rows]
    left = [0.0] * len(rows)
    for share, colour in SHARES.items():
        widths = [share_of(row, share) for row in rows]
        axis.barh(labels, widths, left=left, color=colour, label=share)
        left = [a + b for a, b in zip(left, widths)]
    axis.invert_yaxis()
    axis.tick_params(axis="y", labelsize=7)
    axis.set_xlabel("ms a plan")
    axis.set_title("RRT-Connect, end to end", fontsize=10)
    axis.legend(fontsize=7)


def share_of(row, share):
    if share != "distances":
        return float(row[f"{share}_ms"])
    rest = float(row["checking_ms"]) - float(row["kinematics_ms"]) - float(row["transport_ms"])
    return max(rest, 0.0)


def main():
    in_own_environment()
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 3, figsize=(15, 4.2), width_ratios=(1, 1, 1.1), layout="constrained")
    states = read("robots")
    draw_states(axes[0], states, "valid", "free states: is it valid?")
    draw_states(axes[1], states, "least", "free states: least distance of all pairs")
    axes[0].legend(fontsize=7)
    draw_plans(axes[2], read("rrt"))
    figure.savefig(PICTURE, dpi=80)


if __name__ == "__main__":
    main()
