"""Tables and picture of robots in docs/performance.md and docs/planning.md: times of states, and of parts of a plan."""

from pages import markdown, plot, results

PICTURE = "pictures/robots.png"
WAYS = {
    "Coal": ("#999999", "Pinocchio and Coal, the faster way"),
    "Clearance over shared memory": ("#74a9cf", "Clearance, shared memory, batches"),
    "Clearance in process": ("#045a8d", "Clearance in process, batches"),
    "Clearance in process, prepared, one a call": ("#fdae61", "the same, one state a call"),
}
SHARES = {"kinematics": "#fdae61", "distances": "#045a8d", "transport": "#74a9cf", "planning": "#dddddd"}


ROBOTS = {"panda": "Panda", "ur5": "UR5", "fetch": "Fetch", "baxter": "Baxter"}
COAL = "Coal"  # in tables of robots: the fastest of its variants
ONE = "prepared, one a call"


def by_robot(columns):
    """Microseconds per state, in columns {header: (question, contender, covers)}.

    With covers, relative to the same without; else to Coal.
    """
    remark, rows = results("robots")
    found = {}
    for row in rows:
        key = row["robot"], row["states"], row["question"]
        contenders = found.setdefault(key, {})
        name = COAL if row["contender"].startswith(COAL) else (row["contender"], row["covers"])
        contenders[name] = min(contenders.get(name, float("inf")), float(row["us_a_state"]))

    def cell(contenders, question, name, covers):
        if name == COAL:
            return f"{contenders[COAL]:.3g}"
        us = contenders[name, covers]
        baseline = contenders[COAL] if covers == "off" or question == "least" else contenders[name, "off"]
        return f"{us:.3g}, **{baseline / us:.2g}x**"

    lines = [
        [
            ROBOTS[robot],
            states,
            *(
                cell(found[robot, states, question], question, name, covers)
                for question, name, covers in columns.values()
            ),
        ]
        for robot in ROBOTS
        for states in ("free", "colliding")
        if (robot, states, "verdict") in found
    ]
    return f"{markdown(['', 'states', *columns], lines, words=2)}\n\nFrom `docs/results/robots.csv` ({remark})."


def robots():
    """Many states per call."""
    process, memory = "Clearance in process", "Clearance over shared memory"
    return by_robot({
        "Coal: valid": ("verdict", COAL, ""),
        "verdict, no covers": ("verdict", process, "off"),
        "verdict": ("verdict", process, "background"),
        "and pair": ("check", process, "background"),
        "and bounds": ("bounds", process, "background"),
        "and pair, shared memory": ("check", memory, "background"),
        "Coal: least distance": ("least", COAL, ""),
        "least distance": ("least", process, "background"),
    })  # fmt: skip


def robots_one_a_call():
    """One state per call, prepared."""
    program, process, memory = (f"Clearance {way}, {ONE}" for way in ("in C++", "in process", "over shared memory"))
    return by_robot({
        "Coal: valid": ("verdict", COAL, ""),
        "C++: verdict, no covers": ("verdict", program, "off"),
        "verdict": ("verdict", program, "background"),
        "and pair": ("check", program, "background"),
        "Python: verdict": ("verdict", process, "background"),
        "and pair ": ("check", process, "background"),
        "shared memory: verdict": ("verdict", memory, "background"),
        "Coal: least distance": ("least", COAL, ""),
        "C++: least distance": ("least", program, "background"),
    })  # fmt: skip


def rrt():
    """RRT-Connect end to end, and the distribution of its time."""
    remark, rows = results("rrt")
    keys = ("total_ms", "checking_ms", "kinematics_ms", "transport_ms", "planning_ms")

    def line(row):
        ours = row["contender"].startswith("Clearance")
        figures = [f"{float(row[key]):.3g}" if ours or key != "transport_ms" else "" for key in keys]
        return [ROBOTS[row["robot"]], row["contender"], row["problems"], f"{int(row['states']):,}", *figures]

    header = ["", "edges by", "problems", "states", "whole plan [ms]", "checking", "kinematics", "transport",
              "planner"]  # fmt: skip
    return f"{markdown(header, [line(row) for row in rows], words=2)}\n\nFrom `docs/results/rrt.csv` ({remark})."


def plans():
    """Problems planned by plan()."""
    remark, rows = results("plans")
    header = ["", "margin [mm]", "ends free", "solved", "proved", "first: median [us]", "mean", "again: median", "mean",
              "95 %", "motions", "length", "with shortcuts: median [us]", "mean", "length"]  # fmt: skip
    keys = ("margin_mm", "free", "solved", "proved", "first_median_us", "first_mean_us", "median_us", "mean_us",
            "p95_us", "motions", "length", "shortened_median_us", "shortened_mean_us", "shortened_length")  # fmt: skip
    lines = [[ROBOTS[row["robot"]], *(row[key] for key in keys)] for row in rows]
    return f"{markdown(header, lines)}\n\nFrom `docs/results/plans.csv` ({remark})."


TABLES = {"plans": plans, "robots": robots, "robots_one_a_call": robots_one_a_call, "rrt": rrt}


# ---- the picture -----------------------------------------------------------------------------------------------------


def microseconds(rows, robot, question):
    """Microseconds per free state, by way."""
    found = {}
    for row in rows:
        if (row["robot"], row["question"], row["states"]) == (robot, question, "free") and row["covers"] != "off":
            name = "Coal" if row["contender"].startswith("Coal") else row["contender"]
            found[name] = min(found.get(name, float("inf")), float(row["us_a_state"]))
    return found


def draw_states(axis, rows, question, title):
    robots = list(dict.fromkeys(row["robot"] for row in rows))
    for i, (way, (colour, label)) in enumerate(WAYS.items()):
        heights = [microseconds(rows, robot, question).get(way, 0) for robot in robots]
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


def draw(path):
    plt = plot()
    figure, axes = plt.subplots(1, 3, figsize=(15, 4.2), width_ratios=(1, 1, 1.1), layout="constrained")
    states = results("robots")[1]
    draw_states(axes[0], states, "verdict", "free states: is it valid?")
    draw_states(axes[1], states, "least", "free states: least distance of all pairs")
    axes[0].legend(fontsize=7)
    draw_plans(axes[2], results("rrt")[1])
    figure.savefig(path, dpi=80)
