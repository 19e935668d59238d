#!/usr/bin/env python3
"""Names that a release promises (docs/versions.md), as the lists in tests/golden/names record them.

.venv/bin/python tests/golden/names.py        writes the lists from the sources and the build
"""

import os
import re
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LISTS = Path(__file__).with_suffix("")
RENEW = f".venv/bin/python {Path(__file__).relative_to(ROOT)}"

if __name__ == "__main__":
    sys.path.insert(0, str(Path(os.environ.get("CLEARANCE_BUILD", ROOT / "build")) / "python"))

import help_texts  # noqa: E402
from cpp_names import cpp_names  # noqa: E402
from python_names import python_names  # noqa: E402

import clearance  # noqa: E402
from clearance import _client, _words, wire  # noqa: E402

#: Beginnings of scene files, each of which a key follows that no map has; the error lists the keys of the map.
MAPS = {
    "scene": "",
    "body": "bodies:\n  - ",
    "robot's place": "bodies:\n  - robot: arm\n    ",
    "uv_sphere": "bodies:\n  - name: a\n    uv_sphere:\n      ",
    "uncertainty": "bodies:\n  - name: a\n    sphere: 1\n    uncertainty:\n      ",
    "random": "random:\n  ",
    "shape of random": "random:\n  count: 1\n  box: [1, 1, 1]\n  shape:\n    ",
    "group": "bodies:\n  - {name: a, sphere: 1}\ngroups:\n  some:\n    ",
    "robot": "robots:\n  - ",
}


def scene_names() -> "list[str]":
    """`MAP: KEY` of scene files, and the words of their values."""
    names = []
    for title, begin in MAPS.items():
        with tempfile.NamedTemporaryFile("w", suffix=".yaml") as file:
            file.write(begin + "zzzzzzzzzzzzzzzz: 1\n")
            file.flush()
            try:
                clearance.Scene.load(file.name)
            except clearance.SceneError as error:
                known = re.search(r"unknown key \"z+\"; known: (.*)", str(error))
                if not known:
                    raise
                names += [f"{title}: {key}" for key in known[1].split(", ")]
    return names + [f"mesh_as = {word}" for word in _words.MESH_AS]


def wire_names() -> "list[str]":
    """Values of the wire's enums, places of its structs' members, and the options of a query."""
    names = [f"{name} = {getattr(wire, name)}" for name in ("MAGIC", "VERSION", "COLUMN_ALIGNMENT", "RECORD_REQUIRED")]
    names += [f"{name} = {getattr(_words, name)}" for name in ("EVERY_BODY", "NONE", "GROUP_BIT", "MAX_NAME_BYTES")]
    enums = (wire.FrameType, wire.QueryRecord, wire.UpdateRecord, wire.ReplyRecord, wire.CommonRecord, wire.ErrorCode)
    for kind in (*enums, _words.Status, _words.Flag, _words.Precision, _words.Reduce, _words.Field, _words.MeshAs):
        names += [f"{kind.__name__}.{member.name} = {int(member)}" for member in kind]
    for name, column in _words.COLUMNS.items():
        names.append(f"column {name}: {column.dtype.str[1:]} {column.shape}")
    for struct in sorted(wire.RECORDS):
        dtype = wire.RECORDS[struct]
        for member in dtype.names:
            part, at = dtype.fields[member][:2]
            names.append(f"{struct}.{member}: {part.base.str[1:]} {part.shape} at {at}")
        names.append(f"{struct}: {dtype.itemsize} bytes")
    for option, (tag, takes, default, words, *_) in _client.OPTIONS.items():
        names.append(f"option {option}: {f'record {tag}' if tag else 'header'}, {words or takes}, default {default}")
    return names


def lcm_names() -> "list[str]":
    """Members of the LCM types in order, their constants, and the channels."""
    names = []
    for path in sorted((ROOT / "lcmtypes").glob("*.lcm")):
        for line in re.sub(r"//.*", "", path.read_text()).splitlines():
            kind, _, rest = line.strip().rstrip(";").removeprefix("const ").partition(" ")
            if line.startswith("  const "):
                names += [f"{path.stem}: const {kind} {constant}" for constant in rest.split(", ")]
            elif line.startswith("  "):
                names.append(f"{path.stem}: {kind} {rest.strip()}")
    table = (ROOT / "lcmtypes/README.md").read_text()
    for channels, kind in re.findall(r"^\| (`CLEARANCE_.*?) \| `(\w+)` \|", table, re.M):
        names += [f"{channel}: {kind}" for channel in re.findall(r"\w+", channels)]
    return names


def command_names() -> "list[str]":
    """Commands, their options and positionals, exit codes, and environment variables, from the recorded help texts."""
    names, variables = [], set()
    for command, text in sorted(help_texts.recorded().items()):
        names.append(command)
        listed = re.findall(r"^ {2,}(-.*?)(?: {2,}|$)", text, re.M)
        options = [re.split(r" (?:Excludes|Needs):| \(Env", first)[0] for first in listed]
        names += [f"{command} {option}" for first in options for option in re.findall(r"--?[a-z][\w-]*", first)]
        positionals = re.search(r"^positional\w*(?: arguments)?:\n(.*?)\n\n", text, re.M | re.S | re.I)
        names += [f"{command} {name}" for name in re.findall(r"^  (\w+)", positionals[1] if positionals else "", re.M)]
        codes = text.partition("Exit codes")[2]
        meanings = re.findall(r"\b\d+ [a-zA-Z].*?(?= {3,}\d|$)", codes, re.M)
        names += [f"{command} exits with {found}" for found in meanings]
        variables |= set(re.findall(r"\bCLEARANCE_[A-Z_]+\b", text))
    return [*names, *sorted(variables)]


KINDS = {
    "commands": command_names,
    "cpp": cpp_names,
    "lcm": lcm_names,
    "python": python_names,
    "scene": scene_names,
    "wire": wire_names,
}


def recorded(kind: str) -> "list[str]":
    return (LISTS / f"{kind}.txt").read_text().splitlines()


def current(kind: str) -> "list[str]":
    """The names of a kind, in order and each once."""
    return list(dict.fromkeys(KINDS[kind]()))


if __name__ == "__main__":
    LISTS.mkdir(exist_ok=True)
    for kind in KINDS:
        (LISTS / f"{kind}.txt").write_text("".join(f"{name}\n" for name in current(kind)))
