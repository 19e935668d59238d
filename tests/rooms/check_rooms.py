#!/usr/bin/env python3
"""Holds the tree's includes against rooms.txt, and compiles each header by itself.

check_rooms.py arrows                      every include is allowed, and the rooms have an order
check_rooms.py headers COMPILER FLAGS...   every header compiles alone
"""

import concurrent.futures
import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SOURCES = (".h", ".cpp", ".cu", ".cuh")
FOLDERS = ("wire", "engine", "client", "server", "cli", "inspect", "bench", "tests")
INSTALLED = {
    f"clearance/{name}": f"{room}/{name}"
    for room, name in (
        ("wire", "types.h"), ("wire", "convexify.h"), ("wire", "model.h"),
        ("wire", "query_options.h"), ("wire", "query.h"), ("wire", "protocol.h"),
        ("client", "client.h"), ("client", "eigen.h"),
    )
} | {"clearance/engine.h": "engine/embed/embed.h"}  # fmt: skip


def files() -> list[Path]:
    found = [
        p.relative_to(ROOT) for folder in FOLDERS for p in sorted((ROOT / folder).rglob("*")) if p.suffix in SOURCES
    ]
    if len(found) < 300:
        sys.exit(f"only {len(found)} sources under {ROOT}: the check looks in the wrong place")
    return found


def room_of(path: Path) -> str:
    """The folder that names a room: one level, within the engine two."""
    depth = 2 if path.parts[0] == "engine" and len(path.parts) > 2 else 1
    return "/".join(path.parts[:depth])


def includes(path: Path) -> list[Path]:
    """What a source includes of this tree, in its order."""
    found = []
    for name in re.findall(r'^\s*#\s*include\s+["<]([^">]+)[">]', (ROOT / path).read_text(), re.M):
        for candidate in (INSTALLED.get(name, name), os.path.normpath(path.parent / name)):
            if (ROOT / candidate).is_file():
                found.append(Path(candidate))
                break
    return found


def read_rooms() -> dict[str, set[str]]:
    rooms = {}
    for line in (Path(__file__).parent / "rooms.txt").read_text().splitlines():
        if line and not line.startswith("#"):
            room, _, allowed = line.partition(":")
            rooms[room] = set(allowed.split())
    return rooms


def check_arrows() -> list[str]:
    rooms, errors, seen = read_rooms(), [], []
    for room, allowed in rooms.items():  # each may use only what stands above it: so there is no way round in a circle
        errors += [f"rooms.txt: {room} stands above {other}, which it may use" for other in allowed - {"*", *seen}]
        seen.append(room)
    arrows = []
    for path in files():
        room = room_of(path)
        if room not in rooms:
            errors.append(f"{path}: {room} is no room of rooms.txt")
            continue
        for target in includes(path):
            other = room_of(target)
            if other == room:
                continue
            arrows.append((room, other))
            if not rooms[room] & {other, "*"}:
                errors.append(f"{path} includes {target}: {room} may not use {other} (tests/rooms/rooms.txt)")
    if len(arrows) < 500:
        errors.append(f"only {len(arrows)} includes lead from room to room: the check does not see them")
    unused = {(room, other) for room, allowed in rooms.items() for other in allowed - {"*"}} - set(arrows)
    return errors + [f"rooms.txt: {room} may use {other}, and does not" for room, other in sorted(unused)]


def check_headers(compiler: list[str]) -> list[str]:
    """A header that some source includes first has been compiled alone by that source. Bindings need Python's."""
    sources = files()
    first = {includes(path)[0] for path in sources if path.suffix == ".cpp" and includes(path)}
    left = [
        p
        for p in sources
        if p.suffix == ".h"
        and p not in first
        and p.parts[0] not in ("tests", "bench")
        and p.parts[:2] != ("client", "python")
    ]
    if not left:
        return ["every header is the first of some source: the check sees none by itself"]

    def compile_alone(path: Path) -> str:
        done = subprocess.run(
            [*compiler, "-fsyntax-only", "-x", "c++", "-"],
            input=f'#include "{path}"\n',
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            cwd=ROOT,
        )
        return f"{path} does not compile alone:\n{done.stdout}" if done.returncode else ""

    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        return [error for error in pool.map(compile_alone, left) if error]


def main() -> None:
    errors = check_arrows() if sys.argv[1] == "arrows" else check_headers(sys.argv[2:])
    if errors:
        sys.exit("\n".join(errors))


if __name__ == "__main__":
    main()
