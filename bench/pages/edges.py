"""Table and claims of docs/tradeoff.md about edges: proofs and samples."""

from pages import markdown, results


class Edges:
    """The rows of the CSV, by question, margin and setting."""

    def __init__(self):
        self.remark, self.rows = results("edges")
        self.by_setting = {(r["question"], float(r["margin_m"]), float(r["setting"] or 0)): r for r in self.rows}
        self.margins = [margin for question, margin, _ in self.by_setting if question == "proof"]
        self.sampled_margins = sorted({margin for question, margin, _ in self.by_setting if question == "samples"})
        self.tolerances = [setting for question, _, setting in self.by_setting if question == "least"]

    def proof(self, margin=0.0):
        return self.by_setting["proof", margin, 0.0]

    def sampled(self, step, margin=0.0):
        return self.by_setting["samples", margin, step]

    def least(self, tolerance):
        return self.by_setting["least", 0.0, tolerance]

    def ratio(self, row):
        return float(row["ratio"])

    def decisions(self):
        """Rows of (task, cells) for deciding whether edges are free."""
        for r in self.rows:
            if r["question"] == "least":
                continue
            what = "proved" if r["question"] == "proof" else f"samples, {float(r['setting']):g} rad apart"
            yield [f"{what}, margin {1000 * float(r['margin_m']):g} mm", r["us_an_edge"], r["ratio"],
                   r["configurations"], r["free"], r["hits"], r["undecided"],
                   "" if r["question"] == "proof" else r["missed"]]  # fmt: skip

    def distances(self):
        """Rows of cells for the least distance of edges."""
        for r in self.rows:
            if r["question"] == "least":
                yield [f"{1000 * float(r['setting']):g} mm", r["us_an_edge"], r["ratio"], r["configurations"],
                       r["width_mm"], r["undecided"]]  # fmt: skip


def table():
    edges = Edges()
    return "\n\n".join(
        [
            f"From `docs/results/edges.csv` ({edges.remark}), by `make bench SUITE=edges`.\nTime is relative to "
            "the proof with the same margin; *missed* edges are free by samples, with two bodies proved within the "
            "margin.",
            markdown(
                ["is an edge free?", "us an edge", "time", "configurations", "free", "hits", "undecided", "missed"],
                edges.decisions(),
            ),
            "The least distance of a whole edge, by tolerance (`abs_tol`); time over that of the proof that it is "
            "free, margin 0:",
            markdown(
                ["`abs_tol`", "us an edge", "time", "configurations", "width, 99 % [mm]", "wider after 256"],
                edges.distances(),
            ),
        ]
    )


# Claims of the page about edges, as conditions on the results.
CLAIMS = {
    "edges proved": lambda e: all(r["wrong"] == "0" for r in e.rows),
    "a proof is cheaper than samples": lambda e: min(e.ratio(e.sampled(0.02, m)) for m in e.sampled_margins) > 3,
    # Samples that cost no more than the proof miss contacts.
    "cheap samples miss": lambda e: all(
        e.ratio(e.sampled(0.2, m)) < 1 and int(e.sampled(0.2, m)["missed"]) > 0 for m in e.sampled_margins
    ),
    "seldom undecided": lambda e: all(
        1000 * int(e.proof(m)["undecided"]) < int(e.proof(m)["edges"]) for m in e.margins
    ),
    "margins are cheap": lambda e: all(
        float(e.proof(m)["us_an_edge"]) < 1.3 * float(e.proof()["us_an_edge"]) for m in e.margins
    ),
    "ten times nearer": lambda e: all(
        e.ratio(e.least(fine)) < 2 * e.ratio(e.least(coarse)) for coarse, fine in zip(e.tolerances, e.tolerances[1:])
    ),
}
TABLES = {"edges": table}


def claims():
    edges = Edges()
    return {name: holds(edges) for name, holds in CLAIMS.items()}
