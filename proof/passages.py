"""The passages of the C++ source that the proof is about.

Those of proof/text are compared as text, each a whole function or block that must stand in its file once. `@name@` in
one is an expression that extract.py turns into the term of that name, so that no statement around it is unknown.
"""

from __future__ import annotations

import functools
import re
from pathlib import Path

from cpp import Unknown

VEC, ARITHMETIC = "engine/base/vec.h", "engine/base/arithmetic.h"
CERTIFY, CERTIFY_CPP = "engine/narrow/certify.h", "engine/narrow/certify.cpp"
HOLE = re.compile(r"@(\w+)@")


def stripped(text: str) -> str:
    """A text without comments and with single blanks."""
    return re.sub(r"\s+", " ", re.sub(r"//[^\n]*", "", text)).strip()


@functools.cache
def passages() -> list[tuple[str, str]]:
    """The source's file and text of each passage in proof/text, whose files begin with the name of the source's."""
    found = []
    for path in sorted((Path(__file__).parent / "text").glob("*.txt")):
        file, *texts = path.read_text().split("\n====\n")
        found += [(file, stripped(text)) for text in texts]
    return found


def difference(text: str, passage: str) -> str:
    """The part of a passage up to where the text departs from it."""
    known, beyond = 0, len(passage) + 1
    while beyond - known > 1:
        middle = (known + beyond) // 2
        known, beyond = (middle, beyond) if passage[:middle] in text else (known, middle)
    if known == len(passage):
        return passage
    return f"...{passage[max(0, known - 60) : known]} [here the source differs from] {passage[known : known + 60]}..."


class Source:
    """Texts of the source's files, without comments and with single blanks."""

    def __init__(self, root: Path):
        self.root, self.texts = root, {}
        self.read: list[tuple[str, int, int]] = []  # the parts that became terms: file, begin, end
        self.whole: list[tuple[str, int, int]] = []  # functions and passages known as a whole
        self.holes: dict[str, tuple[str, str]] = {}  # expressions of passages that are not read yet: file, text

    def text(self, file: str) -> str:
        if file not in self.texts:
            self.texts[file] = stripped((self.root / file).read_text())
        return self.texts[file]

    def after(self, file: str, anchor: str) -> int:
        """The end of a passage that stands in the file once."""
        text = self.text(file)
        if text.count(anchor) != 1:
            raise Unknown(f"{file}: {text.count(anchor)} times, not once: {anchor}")
        return text.index(anchor) + len(anchor)

    def part(self, file: str, begin: int, end: int) -> str:
        self.read.append((file, begin, end))
        return self.text(file)[begin:end]

    def body(self, file: str, anchor: str) -> str:
        """The block in braces that follows a signature."""
        text = self.text(file)
        begin, depth = self.after(file, anchor) + 1, 0
        if text[begin - 1 : begin + 1] != " {":
            raise Unknown(f"{file}: no block after {anchor}")
        for i in range(begin, len(text)):
            depth += {"{": 1, "}": -1}.get(text[i], 0)
            if depth == 0:
                self.whole.append((file, begin + 1, i))
                return self.part(file, begin + 1, i)
        raise Unknown(f"{file}: no end of {anchor}")

    def compare(self, file: str, passage: str) -> None:
        """Finds a passage, and keeps its expressions in `holes`."""
        text, parts = self.text(file), HOLE.split(passage)
        if text.count(parts[0]) != 1:
            raise Unknown(f"{file}: {text.count(parts[0])} times, not once: {difference(text, parts[0])}")
        begin = text.index(parts[0])
        at = begin + len(parts[0])
        for name, after in zip(parts[1::2], parts[2::2]):
            end = text.find(after, at)
            if end < 0:
                raise Unknown(f"{file}: not found after {name}: {difference(text[at:], after)}")
            if name in self.holes:
                raise Unknown(f"{file}: {name} is read twice")
            self.holes[name] = (file, self.part(file, at, end))
            at = end + len(after)
        self.whole.append((file, begin, at))

    def expression(self, name: str) -> tuple[str, str]:
        """File and text of an expression in a passage."""
        if name not in self.holes:
            raise Unknown(f"no passage of proof/text has @{name}@")
        return self.holes.pop(name)

    def value(self, file: str, struct: str, name: str) -> str:
        """The constant of a struct for double."""
        begin = self.after(file, f"struct {struct}<double> {{")
        text = self.text(file)[begin:].split("}")[0]
        found = re.search(rf"static constexpr double (?:\w+ = [^,;]+, )*{name} = ([^,;]+)[,;]", text)
        if not found:
            raise Unknown(f"{file}: {struct}<double>::{name}")
        return self.part(file, begin + found.start(1), begin + found.end(1))
