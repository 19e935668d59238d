#!/usr/bin/env python3
"""Writes versions of the engine's sources that hold mutants: deliberate errors, one of which is active in a process.

mutants.py OUT      writes the mutated files to OUT/engine; files that would not change keep their time
mutants.py --files  prints the mutated files, and the sources that include a mutated header, relative to engine/
mutants.py --tests  prints a line "NAME PROGRAM [TESTS]" for each mutant
"""

from __future__ import annotations

import re
import sys
from collections import defaultdict
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
from mutant import Mutant
from table import MUTANTS, SOURCES_OF_HEADERS

ENGINE = Path(__file__).resolve().parents[2] / "engine"


def pattern_of(text: str) -> str:
    """Matches the text with any blanks and line breaks between its characters: clang-format may move them."""
    return r"\s*".join(re.escape(c) for c in text if not c.isspace())


def span_of(text: str, source: str, file: str) -> tuple[int, int]:
    """Where a mutant's expression stands: between the two @ of its text, or the whole text."""
    before, _, rest = text.partition("@")
    expression, _, after = rest.partition("@")
    if not rest:
        before, expression = "", text
    parts = [pattern_of(before), f"({pattern_of(expression)})", pattern_of(after)]
    found = list(re.finditer(r"\s*".join(part for part in parts if part), source))
    if len(found) != 1:
        plain = text.replace("@", "")
        sys.exit(f'engine/{file}: expected "{plain}" exactly once, found {len(found)}; see tests/mutants/table.py')
    return found[0].span(1)


def mutated(file: str, mutants: list[tuple[int, Mutant]]) -> str:
    """The source of a file in which each mutant's expression depends on clearance_mutant."""
    source = (ENGINE / file).read_text()
    choices: dict[tuple[int, int], list[tuple[int, str]]] = defaultdict(list)
    for number, mutant in mutants:
        for text, replacement in mutant.edits:
            choices[span_of(text, source, file)].append((number, replacement))
    for (begin, end), alternatives in sorted(choices.items(), reverse=True):
        if alternatives[0][1].startswith("="):
            chosen = alternatives[0][1][1:]
        else:
            cases = "".join(f"::clearance_mutant == {number} ? ({text}) : " for number, text in alternatives)
            chosen = f"({cases}({source[begin:end]}))"
        source = source[:begin] + chosen + source[end:]
    return f"extern int clearance_mutant;\n{source}"


def names_and_numbers() -> str:
    cases = "".join(f'  if (name == "{mutant.name}") return {number};\n' for number, mutant in enumerate(MUTANTS, 1))
    return f"""// Written by tests/mutants/mutants.py.
#include <cstdio>
#include <cstdlib>
#include <string_view>

/// The number of the active mutant, 0 if none.
extern int clearance_mutant;
int clearance_mutant = 0;

static int number_of(std::string_view name) {{
{cases}  return 0;
}}

// Before the constructors of static objects, which may depend on it.
__attribute__((constructor(101))) static void choose() {{
  const char* name = std::getenv("CLEARANCE_MUTANT");
  if (!name) return;
  clearance_mutant = number_of(name);
  if (clearance_mutant) return;
  std::fprintf(stderr, "CLEARANCE_MUTANT=%s: there is no such mutant\\n", name);
  std::_Exit(2);
}}
"""


def write_if_changed(path: Path, text: str) -> None:
    if not path.is_file() or path.read_text() != text:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


def main() -> None:
    by_file: dict[str, list[tuple[int, Mutant]]] = defaultdict(list)
    for number, mutant in enumerate(MUTANTS, 1):
        by_file[mutant.file].append((number, mutant))
    if sys.argv[1:] == ["--files"]:
        print("\n".join(sorted({*by_file, *(s for sources in SOURCES_OF_HEADERS.values() for s in sources)})))
    elif sys.argv[1:] == ["--tests"]:
        print("\n".join(f"{mutant.name} {mutant.program}" for mutant in MUTANTS))
    else:
        out = Path(sys.argv[1])
        for file, mutants in by_file.items():
            write_if_changed(out / "engine" / file, mutated(file, mutants))
        for source in {s for sources in SOURCES_OF_HEADERS.values() for s in sources} - by_file.keys():
            write_if_changed(out / "engine" / source, (ENGINE / source).read_text())
        write_if_changed(out / "clearance_mutant.cpp", names_and_numbers())


if __name__ == "__main__":
    main()
