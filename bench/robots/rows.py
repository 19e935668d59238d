"""What a benchmark measured, row by row: shown as it comes, and kept in a file."""

import csv


def show(row):
    print("  ".join(f"{name} {value}" for name, value in row.items()), flush=True)


def save(rows, path):
    """Writes rows with the same columns as CSV; path None: nowhere."""
    if path is None:
        return
    with open(path, "w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys(), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
