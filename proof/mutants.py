#!/usr/bin/env python3
"""Changes the source at random, and fails unless the proof fails for each change.

    proof/mutants.py [--count 12] [--seed 1]     after proof/prove.py, whose compiled files it uses

Makes --count changes of each kind: another operation, coordinate or number; a name replaced by another one of the same
function; a statement `x = x * 0.5;` after an assignment to x. A changed source must fail in the extraction or in Tie.v.
Parentheses that change nothing must pass. Works on texts in memory: no file of the source is written.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import random
import re
import shutil
import sys
import tempfile
from pathlib import Path

from cpp import Unknown
from extract import write
from passages import Source
from prove import FILES, HERE, compile_all

SITE = re.compile(r"(?<= )[-+*/>](?= )|(?<=[(\s])-(?=\w)|(?<![\w.])(?:0x1p-?\d+|\d+e-?\d+|\d+)(?![\w.])|(?<=\.)[xyz]\b")

NAME = re.compile(r"(?<!\w)[A-Za-z_]\w*")
ASSIGNMENT = re.compile(r"(?<![\w.\]])([A-Za-z_][\w.]*(?:\[\w+\][\w.]*)*) [-+]?= [^;{}]*;")
SAME_TYPE = {"T", "S", "double"}  # in float64
KINDS = ("operations", "names", "statements")


def changed(token: str, rng: random.Random, unary: bool = False) -> str:
    """Another token in place of an operation, a coordinate or a number; a sign is dropped."""
    if unary:
        return ""
    if token in "+-*/>":
        return rng.choice([other for other in "+-*/" if other != token])
    if token in "xyz":
        return rng.choice([other for other in "xyz" if other != token])
    match = re.fullmatch(r"(.*?)(\d+)", token)
    assert match, token
    step = rng.choice([-1, 1, 2]) if int(match[2]) else 1
    return f"{match[1]}{int(match[2]) + step}"


def sites(source: Source, kind: str = "operations") -> list[tuple[str, int, int]]:
    """Places of one kind of change: file, begin, end. Only operations are confined to the parts that become terms."""
    found = set()
    for file, begin, end in source.read if kind == "operations" else source.whole:
        pattern = {"operations": SITE, "names": NAME, "statements": ASSIGNMENT}[kind]
        for match in pattern.finditer(source.text(file), begin, end):
            if kind != "names" or others(source, file, match.start(), match[0]):
                found.add((file, match.start(), match.end()))
    return sorted(found)


def others(source: Source, file: str, at: int, name: str) -> list[str]:
    """The other names of a function or passage of which the exchange changes the meaning."""
    begin, end = next((b, e) for f, b, e in source.whole if f == file and b <= at < e)
    names = set(NAME.findall(source.text(file)[begin:end])) - {name}
    return sorted(names - SAME_TYPE if name in SAME_TYPE else names)


def mutant(
    original: Source, rng: random.Random, site: tuple[str, int, int] | None = None, kind: str = "operations"
) -> tuple[Source, str]:
    """A source with one change, at a place or at a random one, and a line that describes it."""
    file, begin, end = site or rng.choice(sites(original, kind))
    text = original.text(file)
    token = text[begin:end]
    if kind == "names":
        other = rng.choice(others(original, file, begin, token))
    elif kind == "statements":
        match = ASSIGNMENT.match(text, begin)
        assert match, token
        other = f"{token} {match[1]} = {match[1]} * 0.5;"
    else:
        other = changed(token, rng, unary=token == "-" and text[end] != " ")
    return edited(original, file, begin, end, other), (
        f"{file}: {text[max(0, begin - 30) : begin]}[{token} -> {other}]{text[end : end + 30]}"
    )


def edited(original: Source, file: str, begin: int, end: int, other: str) -> Source:
    """A copy of a source in memory, with another text from `begin` to `end`."""
    source = Source(original.root)
    text = original.text(file)
    source.texts = {**original.texts, file: text[:begin] + other + text[end:]}
    return source


def reason(source: Source, compiled: Path) -> str:
    """Which step rejects a source, or nothing if the proof passes."""
    try:
        text = write(source)
    except Unknown as unknown:
        return f"extraction: {unknown}"
    with tempfile.TemporaryDirectory() as folder:
        build = Path(folder)
        for name in FILES[: FILES.index("Source")]:
            for suffix in (".v", ".vo"):
                shutil.copy2(compiled / f"{name}{suffix}", build)
        shutil.copy(HERE / "Tie.v", build)
        (build / "Source.v").write_text(text)
        with contextlib.redirect_stdout(io.StringIO()):
            error = compile_all(build, ["Source", "Tie"])
        line = re.search(r"line (\d+)", error)
        if not error or not error.startswith("Tie.v") or not line:
            return error
        return f"Tie.v: {(HERE / 'Tie.v').read_text().splitlines()[int(line[1]) - 1].split(' :')[0]}"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=12)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--compiled", type=Path, default=HERE.parent / "out" / "proof", help="folder of proof/prove.py")
    options = parser.parse_args()
    rng = random.Random(options.seed)
    original = Source(HERE.parent)
    write(original)

    same = Source(original.root)
    name = "T lower_from_gap(const T& gap, const T& length"
    text = original.text("engine/narrow/certify.h")
    assert text.count(name) == 1 and text.count("gap / length - radius") == 1
    same.texts = {
        **original.texts,
        "engine/narrow/certify.h": text.replace("return (gap / length", "return ((gap) / length"),
    }
    if why := reason(same, options.compiled):
        sys.exit(f"error: a change that means nothing fails: {why}")
    survived = []
    for kind in KINDS:
        for i in range(options.count):
            source, what = mutant(original, rng, kind=kind)
            why = reason(source, options.compiled)
            print(f"{kind} {i + 1:3} {what}\n      {why or 'PROVED'}", flush=True)
            if not why:
                survived.append(what)
    count = options.count * len(KINDS)
    if survived:
        sys.exit(f"error: {len(survived)} of {count} changes pass")
    places = ", ".join(f"{len(sites(original, kind))} of {kind}" for kind in KINDS)
    print(f"{count} of {count} changes fail; places to choose from: {places}")


if __name__ == "__main__":
    main()
