#!/usr/bin/env python3
"""Writes the README's tables from the files in docs/results.

    tools/readme_tables.py            write them
    tools/readme_tables.py --check    exit code 1 if they are not those of the files

A table stands in the README between a line `<!-- table NAME -->` and a line `<!-- end -->`. A result file begins with lines
`# key: value` that say what made it.
"""
import csv
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
README = ROOT / "README.md"


def read(name):
    """(facts, rows) of docs/results/NAME.csv: what its first lines say about it, and its rows as dicts of strings."""
    lines = (ROOT / "docs/results" / f"{name}.csv").read_text().splitlines()
    facts = dict(line[1:].strip().split(": ", 1) for line in lines if line.startswith("#") and ": " in line)
    return facts, list(csv.DictReader(line for line in lines if not line.startswith("#")))


def markdown(header, rows):
    """A table whose first column is text and whose others are numbers."""
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" + "---:|" * (len(header) - 1)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows])


def accuracy():
    """Every answer of the campaign was judged by an exact oracle; one row for each kind of question."""
    facts, rows = read("accuracy")
    kinds = {}
    for row in rows:
        kinds.setdefault((row["signed"], row["precision"], float(row["rel_tol"])), []).append(row)

    def line(kind, rows):
        signed, precision, rel_tol = kind
        what = "signed distance" if int(signed) else "distance"
        what += ", float32 iterations" if precision == "f32" else ""
        what += f", {rel_tol:g} relative" if rel_tol else ", as narrow as the arithmetic goes"
        total = {key: sum(int(row[key]) for row in rows) for key in ("cases", "violations", "inaccurate", "unconverged")}
        worst = max(float(row["worst_error"]) for row in rows)
        return [what, f"{total['cases']:,}", str(total["violations"]), str(total["inaccurate"]), str(total["unconverged"]),
                f"{worst:.2f}"]

    table = markdown(["question", "answers judged", "bounds violated", "less accurate than asked", "unconverged",
                      "worst error / allowed"], [line(kind, kinds[kind]) for kind in sorted(kinds)])
    return f"{table}\n\n{made_by('accuracy', facts)}"


def made_by(name, facts):
    return f"From [docs/results/{name}.csv](docs/results/{name}.csv), made by `{facts['command']}` on {facts['machine']}."


TABLES = {"accuracy": accuracy}


def fill(text):
    """The README's text with every table made anew. Raises SystemExit naming a table that nobody can make."""
    out, lines = [], iter(text.splitlines())
    for line in lines:
        out.append(line)
        if line.startswith("<!-- table "):
            name = line.split()[2]
            if name not in TABLES:
                sys.exit(f"README.md: no table is called {name!r}; there are {', '.join(TABLES)}")
            out.append(TABLES[name]())
            for line in lines:
                if line == "<!-- end -->":
                    out.append(line)
                    break
            else:
                sys.exit(f"README.md: table {name!r} has no <!-- end --> line")
    return "\n".join(out) + "\n"


def main():
    old = README.read_text()
    new = fill(old)
    if sys.argv[1:] == ["--check"]:
        if new != old:
            sys.exit("README.md: its tables are not those of docs/results; run tools/readme_tables.py")
    elif sys.argv[1:]:
        sys.exit(__doc__)
    else:
        README.write_text(new)


if __name__ == "__main__":
    main()
