"""Picture of README.md: the cost of a proved state and of a proved edge, next to what planners do without a proof."""

from pages import plot, results

PICTURE = "proof.png"
TABLES: dict = {}

STATES = {
    "Coal, no proof": ("#b0b0b0", lambda row: row["contender"].startswith("Coal")),
    "proved, without covers": ("#8fb3d9", lambda row: row["covers"] == "off"),
    "proved, with covers": ("#1f5fa8", lambda row: row["covers"] == "background"),
}
EDGES = {
    "samples 0.02 rad apart, no proof": ("#b0b0b0", "us_a_sampled_edge"),
    "proved, without covers": ("#8fb3d9", "us_a_verdict_without_covers"),
    "proved, with covers": ("#1f5fa8", "us_a_verdict"),
}


def microseconds_a_state(rows, robot, kind, is_of):
    """The fastest way to the verdict on many free states in one call."""
    return min(
        float(row["us_a_state"])
        for row in rows
        if (row["robot"], row["question"], row["states"]) == (robot, "verdict", kind) and is_of(row)
    )


def bars(axis, robots, ways, height_of, title):
    width = 0.8 / len(ways)
    for i, (label, (colour, way)) in enumerate(ways.items()):
        places = [r + width * (i - (len(ways) - 1) / 2) for r in range(len(robots))]
        drawn = axis.bar(places, [height_of(robot, way) for robot in robots], width, color=colour, label=label)
        axis.bar_label(drawn, fmt="%.3g", fontsize=7)
    axis.set_xticks(range(len(robots)), robots)
    axis.set_yscale("log")
    axis.set_ylabel("us")
    axis.set_title(title, fontsize=10)
    axis.legend(fontsize=7, loc="upper center", bbox_to_anchor=(0.5, -0.08), ncols=len(ways))


def draw(path):
    """Needs docs/results/robots.csv and motions.csv."""
    figure, axes = plot().subplots(1, 2, figsize=(11, 3.8), layout="constrained")
    states, edges = results("robots")[1], results("motions")[1]
    robots = list(dict.fromkeys(row["robot"] for row in edges))
    by_robot = {row["robot"]: row for row in edges if float(row["margin_m"]) == 0}
    bars(axes[0], robots, STATES, lambda robot, way: microseconds_a_state(states, robot, "free", way), "a free state")
    bars(axes[1], robots, EDGES, lambda robot, way: float(by_robot[robot][way]), "an edge of 0.2 to 1.5 rad")
    figure.savefig(path, dpi=80)
