"""A mutant: a deliberate error in the engine, which a test must find (table.py)."""

from __future__ import annotations

from typing import NamedTuple


class Mutant(NamedTuple):
    """A deliberate error."""

    program: str
    name: str
    file: str
    edits: list[tuple[str, str]]


def mutants_of(program: str, *rows: tuple[str, ...]) -> list[Mutant]:
    """Mutants of one program. A row holds a name, a file, then text and replacement of each edit."""
    return [Mutant(program, name, file, list(zip(edits[::2], edits[1::2]))) for name, file, *edits in rows]
