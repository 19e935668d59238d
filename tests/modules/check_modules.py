#!/usr/bin/env python3
"""Compares the tree's includes and folders with modules.txt, and compiles each header by itself.

check_modules.py arrows                      checks that every include is allowed, the order and size of modules, and
                                             that the names of the standard library that a source has are included
check_modules.py headers COMPILER FLAGS...   checks that every header compiles alone
"""

import collections
import concurrent.futures
import functools
import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SOURCES = (".h", ".cpp", ".cu", ".cuh")
FOLDERS = ("wire", "engine", "planner", "client", "server", "cli", "inspect", "bench", "tests")
MOST = 25  # sources in a folder

# Names of the standard library, and headers that have them. Precompiled headers hide that an include is missing.
STANDARD_NAMES = {
    r"std::array<": "array",
    r"std::atomic": "atomic",
    r"std::(from|to)_chars": "charconv",
    r"std::chrono": "chrono",
    r"std::(abs|ceil|cos|floor|hypot|isfinite|isnan|sin|sqrt)\(": "cmath",
    r"std::mem(cmp|cpy|set)\(": "cstring",
    r"std::deque<": "deque",
    r"std::filesystem": "filesystem",
    r"std::[io]?fstream": "fstream",
    r"std::function<": "functional",
    r"(EXPECT|ASSERT)_[A-Z]+\(": "gtest/gtest.h",
    r"std::numeric_limits": "limits",
    r"std::(unordered_)?map<": "map unordered_map",
    r"std::(make_shared|make_unique|shared_ptr|unique_ptr)": "memory",
    r"std::(lock_guard|mutex|scoped_lock|unique_lock)\b": "mutex",
    r"std::optional<": "optional",
    r"std::mt19937": "random",
    r"std::(multi)?set<": "set",
    r"std::span<": "span",
    r"std::[io]?stringstream": "sstream",
    r"std::(string|to_string)\b": "string",
    r"std::string_view": "string string_view",
    r"std::(thread|this_thread)": "thread",
    r"std::variant<": "variant",
    r"std::vector<": "vector",
}


class Modules:
    """modules.txt: the modules that each module may use, in order."""

    def __init__(self) -> None:
        self.allowed: dict[str, set[str]] = {}
        for line in (Path(__file__).parent / "modules.txt").read_text().splitlines():
            name, _, rest = line.partition(":")
            if line and not line.startswith("#"):
                self.allowed[name] = set(rest.split())

    def of(self, path: Path) -> str:
        """A folder of engine/ and server/ is a module; elsewhere a module includes its subfolders."""
        if path.parts[0] in ("engine", "server"):
            return str(path.parent)
        return path.parts[0]


def files() -> list[Path]:
    found = [
        p.relative_to(ROOT) for folder in FOLDERS for p in sorted((ROOT / folder).rglob("*")) if p.suffix in SOURCES
    ]
    if len(found) < 300:
        sys.exit(f"only {len(found)} sources under {ROOT}: the check looks in the wrong place")
    return found


def source_of(name: str) -> Path:
    """Returns the file of an include: <clearance/x.h> is installed from one of six folders."""
    if name.startswith("clearance/"):
        leaf = name.removeprefix("clearance/")
        folders = map(Path, ("wire", "wire/api", "client", "client/channel", "engine/api", "planner"))
        return next((folder / leaf for folder in folders if (ROOT / folder / leaf).is_file()), Path(name))
    return Path(name)


def included_names(path: Path) -> list[str]:
    return re.findall(r'^\s*#\s*include\s+["<]([^">]+)[">]', (ROOT / path).read_text(), re.M)


def includes(path: Path) -> list[Path]:
    """The headers of this tree that a source includes, in order."""
    return [source for name in included_names(path) if (ROOT / (source := source_of(name))).is_file()]


@functools.cache
def all_names(path: Path) -> "frozenset[str]":
    """The includes of a source, and those of the headers of this tree among them."""
    return frozenset(included_names(path)).union(*(all_names(target) for target in includes(path) if target != path))


def check_standard_names() -> list[str]:
    errors, uses = [], 0
    for path in files():
        text = re.sub(r"//.*", "", (ROOT / path).read_text())
        for pattern, headers in STANDARD_NAMES.items():
            if used := re.search(pattern, text):
                uses += 1
                if not all_names(path) & {*headers.split()}:
                    errors.append(
                        f"{path} has {used[0].rstrip('<(')}, and neither it nor a header of ours includes <{headers}>"
                    )
    if uses < 3000:
        errors.append(f"only {uses} uses of the standard library were found: the check does not see them")
    return errors


def check_arrows() -> list[str]:
    modules, errors, seen, arrows = Modules(), [], [], []
    for module, allowed in modules.allowed.items():  # each may use only those above it, so there is no cycle
        errors += [f"modules.txt: {module} stands above {other}, which it may use" for other in allowed - {"*", *seen}]
        seen.append(module)
    for path in files():
        module = modules.of(path)
        if module not in modules.allowed:
            errors.append(f"{path}: {module} is no module of tests/modules/modules.txt")
            continue
        for name in included_names(path):
            if (ROOT / path.parent / name).is_file() and not (ROOT / name).is_file():
                errors.append(f"{path} includes {name}: write the path from the root")
        for target in includes(path):
            other = modules.of(target)
            if other == module:
                continue
            arrows.append((module, other))
            if not modules.allowed[module] & {other, "*"}:
                errors.append(f"{path} includes {target}: {module} may not use {other} (tests/modules/modules.txt)")
    if len(arrows) < 500:
        errors.append(f"only {len(arrows)} includes lead from module to module: the check does not see them")
    unused = {(m, other) for m, allowed in modules.allowed.items() for other in allowed - {"*"}} - set(arrows)
    errors += [f"modules.txt: {module} may use {other}, and does not" for module, other in sorted(unused)]
    return errors + check_sizes()


def check_sizes() -> list[str]:
    listed = subprocess.run(
        ["git", "ls-files", "--", *FOLDERS], cwd=ROOT, text=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    ).stdout.splitlines()  # without git (an unpacked archive): all files
    paths = [Path(name) for name in listed] or [p.relative_to(ROOT) for f in FOLDERS for p in (ROOT / f).rglob("*")]
    sizes = collections.Counter(str(p.parent) for p in paths if p.suffix in (*SOURCES, ".py") and (ROOT / p).is_file())
    return [f"{folder} has {n} sources, more than {MOST}: divide it" for folder, n in sorted(sizes.items()) if n > MOST]


def chains_of(headers: list[Path]) -> list[list[Path]]:
    """Divides headers into the fewest lists in which each one includes the header before it, directly or not.

    Compiled in this order, a header sees nothing that it does not include itself. (A maximum matching by augmenting
    paths.)
    """
    included = {header: {source_of(name) for name in all_names(header)} - {header} for header in headers}
    before: dict[Path, Path] = {}

    def put_before_another(header: Path, tried: set[Path]) -> bool:
        for other in headers:
            if header in included[other] and other not in tried:
                tried.add(other)
                if other not in before or put_before_another(before[other], tried):
                    before[other] = header
                    return True
        return False

    for header in headers:
        put_before_another(header, set())
    after = {first: other for other, first in before.items()}
    chains = []
    for header in headers:
        if header not in before:
            chain = [header]
            while chain[-1] in after:
                chain.append(after[chain[-1]])
            chains.append(chain)
    return chains


def check_headers(compiler: list[str]) -> list[str]:
    """A header that some source includes first was compiled alone by that source. Bindings need Python's headers."""
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

    def compile_chain(chain: list[Path]) -> str:
        done = subprocess.run(
            [*compiler, "-fsyntax-only", "-x", "c++", "-"],
            input="".join(f'#include "{path}"\n' for path in chain),
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            cwd=ROOT,
        )
        return f"one of {', '.join(map(str, chain))} does not compile alone:\n{done.stdout}" if done.returncode else ""

    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        return [error for error in pool.map(compile_chain, chains_of(left)) if error]


def main() -> None:
    errors = check_arrows() + check_standard_names() if sys.argv[1] == "arrows" else check_headers(sys.argv[2:])
    if errors:
        sys.exit("\n".join(errors))


if __name__ == "__main__":
    main()
