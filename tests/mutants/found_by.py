#!/usr/bin/env python3
"""Renews found_by.txt: which test finds a mutant, where the tests before it take long.

    ctest --test-dir build -R mutant_ && tests/mutants/found_by.py build/Testing/Temporary/LastTest.log

found_main.cpp runs this test first, and all others if it does not find the mutant.
"""

import re
import sys
from pathlib import Path

TABLE = Path(__file__).with_name("found_by.txt")
LONG_MS = 300  # of the tests before it


def main() -> None:
    known = dict(line.split(" ") for line in TABLE.read_text().splitlines()) if TABLE.exists() else {}
    for part in re.split(r"^\d+/\d+ Testing: mutant_", Path(sys.argv[1]).read_text(errors="replace"), flags=re.M)[1:]:
        name = part.split("_is_found\n", 1)[0]
        found = re.search(r"^\[  FAILED  \] ([^\s,]+)(?:,.*)? \(\d+ ms\)$", part, re.M)
        before = sum(int(ms) for ms in re.findall(r"^\[       OK \] \S+ \((\d+) ms\)$", part, re.M))
        if found and before > LONG_MS:
            known[name] = found[1]
    TABLE.write_text("".join(f"{name} {test}\n" for name, test in sorted(known.items())))


if __name__ == "__main__":
    main()
