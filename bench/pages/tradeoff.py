"""Tables, claims and picture of docs/tradeoff.md: time against tolerance, margin and model."""

from pages import all_of, markdown, plot, results, times

PICTURE = "pictures/tradeoff.png"
EXACT = "exact"
ITSELF = " and itself"
NAMES = {EXACT: "exact", "1e-06": "1 um", "0.0001": "0.1 mm", "0.001": "1 mm", "0.01": "1 cm", "0.05": "5 cm",
         "0.1": "10 cm", "10%": "10 %"}  # fmt: skip


class Costs:
    """The rows of the results by workload, question and setting."""

    def __init__(self):
        self.remark, self.rows = results("tradeoff")
        self.by_key = {(r["workload"], r["question"], r["setting"]): r for r in self.rows}
        self.workloads = list(dict.fromkeys(r["workload"] for r in self.rows))
        self.margins = list(dict.fromkeys(r["setting"] for r in self.rows if r["question"] == "decision"))

    def number(self, workload, question, setting, column="us"):
        return float(self.by_key[workload, question, setting][column])

    def robots(self):
        """Workloads of robots with hulls or meshes, among obstacles alone."""
        return [w for w in self.workloads if w.endswith((", hulls", ", meshes"))]


def us(value):
    return f"{float(value):.3g}"


def tolerances():
    """Time of a least distance by tolerance, and its ratio to the exact engine."""
    costs = Costs()
    lines = []
    for workload in costs.workloads:
        if workload.endswith(ITSELF):
            continue
        exact = costs.by_key[workload, "least", EXACT]
        cells = [us(exact["us_off"])]
        for setting in NAMES:
            row = costs.by_key[workload, "least", setting]
            cells.append(f"{us(row['us'])}, **{times(float(row['over_exact']))}**")
        lines.append([workload, *cells])
    header = ["us a state or edge", "exact, no covers", *NAMES.values()]
    return f"{markdown(header, lines)}\n\nFrom `docs/results/tradeoff*.csv` ({costs.remark}), by `make tradeoff`."


def covers():
    """Time without covers over the time with them, by tolerance and margin."""
    costs = Costs()
    header = ["", *NAMES.values(), *(f"margin {1000 * float(m):g} mm" for m in costs.margins)]
    return markdown(header, [
        [workload, *(times(costs.number(workload, "least", t, "over_off")) for t in NAMES),
         *(times(costs.number(workload, "decision", m, "over_off")) for m in costs.margins)]
        for workload in costs.workloads
    ])  # fmt: skip


def margins():
    """Time of a decision by margin, and its ratio to the exact distance."""
    costs = Costs()
    lines = []
    for workload in costs.workloads:
        lines.append([workload])
        for margin in costs.margins:
            row = costs.by_key[workload, "decision", margin]
            share = 100 * int(row["free"]) / int(row["items"])
            lines[-1].append(f"{us(row['us'])}, **{times(float(row['over_exact']))}**, {share:.0f} %")
        if (sampled := costs.by_key.get((workload, "sampled", "0"))) is not None:
            missed = f"{sampled['wrong']} of {sampled['items']} missed"
            lines.append([f"{workload}, samples", f"{us(sampled['us'])}, {missed}", *[""] * (len(costs.margins) - 1)])
    return markdown(["us a state or edge", *(f"{1000 * float(m):g} mm" for m in costs.margins)], lines)


def models():
    """Error of hulls in place of true meshes."""
    costs, lines = Costs(), []
    for row in results("tradeoff_models")[1]:
        name, what = row["robot"].removesuffix(ITSELF), ITSELF if row["robot"].endswith(ITSELF) else ""
        hulls, meshes = (f"{name}, {model}{what}" for model in ("hulls", "meshes"))
        ratios = [costs.number(meshes, *key) / costs.number(hulls, *key)
                  for key in (("decision", "0"), ("least", EXACT), ("least", "0.001"), ("least", "0.01"))]  # fmt: skip
        short = [f"{float(row[column]):.2f}" for column in ("short_mm", "short_most_mm")]
        lines.append([row["robot"], f"{row['rejected']} of {row['free']}", *short, *map(times, ratios)])
    header = ["", "free states rejected", "short by, median [mm]", "most [mm]", "meshes cost: free or not", "exact",
              "1 mm", "1 cm"]  # fmt: skip
    return markdown(header, lines)


def extremes():
    """Width of intervals, time and proofs of numerical extremes."""
    rows = results("tradeoff_extremes")[1]
    cases = {}
    for row in rows:
        cases.setdefault(row["case"], []).append(row)
    lines = [
        [case, mine[0]["distance_m"], *(f"{row['width_most_m']}, {us(row['us'])}" for row in mine),
         f"{sum(int(r['pairs']) - int(r['wrong']) for r in mine)} of {sum(int(r['pairs']) for r in mine)}"]
        for case, mine in cases.items()
    ]  # fmt: skip
    header = ["", "distance [m]", *(f"{NAMES[row['setting']]}: widest [m], us a pair" for row in rows[:3]), "proved"]
    return markdown(header, lines)


TABLES = {"tradeoff": tolerances, "tradeoff_margins": margins, "tradeoff_covers": covers, "tradeoff_models": models,
          "tradeoff_extremes": extremes}  # fmt: skip


def monotone(costs):
    """For robots: no tolerance costs a quarter more than one a tenth of it."""
    for workload in costs.robots():
        for loose, tight in (("0.1", "0.01"), ("0.01", "0.001"), ("0.001", "0.0001"), ("0.0001", "1e-06")):
            yield costs.number(workload, "least", loose) <= 1.25 * costs.number(workload, "least", tight)


def claims():
    """Whether results support the sentences of the page."""
    costs, models, extreme = Costs(), results("tradeoff_models")[1], results("tradeoff_extremes")[1]
    proofs = [row for row in costs.rows if row["question"] != "sampled"]
    edges = [w for w in costs.workloads if w.endswith("edges")]
    share = {row["robot"]: int(row["rejected"]) / int(row["free"]) for row in models}
    return {
        "nothing wrong": all_of(row["wrong"] == row["wider"] == "0" for row in [*proofs, *extreme]),
        "a centimetre is cheap": all_of(costs.number(w, "least", "0.01", "over_exact") >= 3 for w in costs.robots()),
        "looser costs no more": all_of(monotone(costs)),
        "decisions are cheap": all_of(
            costs.number(w, "decision", m, "over_exact") >= 2 for w in costs.robots() for m in costs.margins
        ),
        "covers pay": all_of(
            costs.number(w, "decision", m, "over_off") >= 1.5 for w in costs.robots() for m in costs.margins
        ),
        "samples cost more": all_of(
            costs.number(w, "sampled", "0") > 1.5 * costs.number(w, "decision", "0") for w in edges
        ),
        "samples miss": sum(costs.number(w, "sampled", "0", "wrong") for w in edges) > 0,
        "hulls of the UR5": share["UR5" + ITSELF] > 0.1,
        "hulls of the Panda": share["Panda" + ITSELF] < 0.01,
        "abs_tol for touching": all_of(
            float(exact["us"]) > 2 * float(loose["us"])
            for exact, loose in zip(extreme[::3], extreme[1::3])
            if float(exact["distance_m"]) < 1e-8
        ),
    }  # fmt: skip


# ---- the picture -----------------------------------------------------------------------------------------------------


def draw_lines(axis, costs, workloads, last):
    """Time against tolerance: with covers, and by the exact engine alone (dashed)."""
    settings = [s for s in NAMES if s != "10%"]
    where = [2e-7 if s == EXACT else float(s) for s in settings]
    for i, (workload, label) in enumerate(workloads.items()):
        rows = [costs.by_key[workload, "least", s] for s in settings]
        axis.plot(where, [float(r["us"]) for r in rows], "o-", color=f"C{i}", label=label)
        axis.plot(where, [float(r["us_off"]) for r in rows], "--", color=f"C{i}", lw=1)
    axis.set(xscale="log", yscale="log", xlabel="tolerance of the proved distance", ylabel=last)
    axis.set_xticks(where, ["exact", "1 um", "0.1 mm", "1 mm", "1 cm", "5 cm", "10 cm"], fontsize=8, rotation=30)
    axis.minorticks_off()
    axis.grid(alpha=0.3, which="both")


def draw(path):
    costs, plt = Costs(), plot()
    figure, (states, edges) = plt.subplots(1, 2, figsize=(10.5, 4.2), layout="constrained")
    draw_lines(states, costs, {"Panda, hulls": "Panda, hulls", "UR5, hulls": "UR5, hulls",
                               "UR5, meshes": "UR5, true meshes"}, "us a state")  # fmt: skip
    states.plot([], [], "--", color="grey", lw=1, label="exact engine alone")
    states.set_title("least distance of a state", fontsize=10)
    draw_lines(edges, costs, {"Panda, edges": "Panda, hulls", "UR5, edges": "UR5, hulls"}, "us an edge")
    for i, workload in enumerate(("Panda, edges", "UR5, edges")):
        sampled = costs.by_key[workload, "sampled", "0"]
        edges.plot([float(sampled["width_mm"]) / 1000], [float(sampled["us"])], "x", color=f"C{i}", ms=9, mew=2)
        edges.axhline(costs.number(workload, "decision", "0"), color=f"C{i}", ls=":", lw=1.5)
    edges.plot([], [], "x", color="grey", ms=9, mew=2, label="samples: free or not, not proved between them")
    edges.plot([], [], ":", color="grey", label="proved: free or not")
    edges.set_title("least distance of a whole edge", fontsize=10)
    for axis in (states, edges):
        low, high = axis.get_ylim()
        axis.set_yticks([t for t in (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500) if low < t < high])
        axis.yaxis.set_major_formatter(lambda v, _: f"{v:g}")
        axis.legend(fontsize=8)
    figure.savefig(path, dpi=100)
