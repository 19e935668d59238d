#!/usr/bin/env python3
"""Changes constants and operations of the source at random, and fails unless the proof fails for each of them.

    proof/mutants.py [--count 12] [--seed 1]     after proof/prove.py, whose compiled files it uses

A changed source must fail in the extraction or in Tie.v. Parentheses that change nothing must
pass. Works on texts in memory: no file of the source is written.
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


def sites(source: Source) -> list[tuple[str, int, int]]:
    """Operations, coordinates and numbers of the parts that become terms of Coq: file, begin, end."""
    found = set()
    for file, begin, end in source.read:
        for match in SITE.finditer(source.text(file), begin, end):
            found.add((file, match.start(), match.end()))
    return sorted(found)


def mutant(original: Source, rng: random.Random, site: tuple[str, int, int] | None = None) -> tuple[Source, str]:
    """A source with one change, at a place or at a random one, and a line that describes it."""
    file, begin, end = site or rng.choice(sites(original))
    text = original.text(file)
    token = text[begin:end]
    other = changed(token, rng, unary=token == "-" and text[end] != " ")
    source = Source(original.root)
    source.texts = {**original.texts, file: text[:begin] + other + text[end:]}
    return source, f"{file}: {text[max(0, begin - 30) : begin]}[{token} -> {other}]{text[end : end + 30]}"


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
    for i in range(options.count):
        source, what = mutant(original, rng)
        why = reason(source, options.compiled)
        print(f"{i + 1:3} {what}\n      {why or 'PROVED'}", flush=True)
        if not why:
            survived.append(what)
    if survived:
        sys.exit(f"error: {len(survived)} of {options.count} changes pass")
    print(f"{options.count} of {options.count} changes fail; {len(sites(original))} places were to choose from")


if __name__ == "__main__":
    main()
