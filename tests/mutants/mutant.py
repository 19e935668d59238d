"""A mutant: a deliberate error in the engine, which a test must find (table.py)."""

from __future__ import annotations

from typing import NamedTuple


class Mutant(NamedTuple):
    """A deliberate error."""

    program: str  # and the tests that run, as in --gtest_filter
    name: str
    file: str
    edits: list[tuple[str, str]]


def mutants_of(program: str, *rows: tuple[str, ...]) -> list[Mutant]:
    """Mutants of a program or of some of its tests. A row holds name, file, then text and replacement of each edit."""
    return [Mutant(program, name, file, list(zip(edits[::2], edits[1::2]))) for name, file, *edits in rows]
