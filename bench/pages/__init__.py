"""Tables, claims and pictures of the pages, generated from docs/results by bench/write_pages.py.

A module has TABLES: by name, a function that returns the text between `<!-- table NAME -->` and `<!-- end -->`. It may
have claims(): by name, whether the results support the sentence before `<!-- claim NAME -->`. It may have PICTURE, a
file in docs, and draw(path).
"""

from harness import RESULTS, read


def results(name):
    """Returns (remark, rows) of docs/results/NAME.csv."""
    return read(RESULTS / f"{name}.csv")


def markdown(header, rows, words=1):
    """A table with text in its first columns and numbers in the others."""
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * words + "--:|" * (len(header) - words)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows])


def all_of(conditions):
    """Whether there is at least one condition and all hold."""
    conditions = list(conditions)
    return bool(conditions) and all(conditions)


def times(ratio):
    return f"{ratio:,.0f}x" if ratio >= 10 else f"{ratio:.2g}x"


def plot():
    """Matplotlib's pyplot, drawing into files."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot

    return matplotlib.pyplot
