"""Public declarations of the installed C++ headers, one line each, as names.py records them."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
#: Recorded with the wire: structs with the places of their members, and the options of a query.
OF_THE_WIRE = {"wire/protocol.h", "wire/payloads.h", "wire/query_options.h"}
#: Nested classes that only the library implements.
OF_THE_LIBRARY = {"Request", "Runner"}
SCOPE = re.compile(r"(?:template <.*?> )?(namespace|class|struct|enum)(?: class)?(?: CLEARANCE_API)? ([\w:]+)")
ACCESS = re.compile(r"(public|private|protected):")
NOT_OF_THE_NAME = re.compile(r"CLEARANCE_QUERY_OPTIONS\(\w+\) |CLEARANCE_API |\[\[[^]]*\]\] |\b(?:inline|explicit) ")


def installed_headers() -> "list[str]":
    """Paths of the headers that are installed into include/clearance, as CMake lists them."""
    lists = [(ROOT / "cmake/ClearanceLibraries.cmake").read_text().split("TRANSFORM")[0]]
    for folder in ("client", "engine"):
        text = (ROOT / folder / "CMakeLists.txt").read_text()
        lists += re.findall(r"clearance_install_library\(.*?\bHEADERS(.*?)\bLIBS", text, re.S)
    return sorted(header for part in lists for header in re.findall(r"[\w/]+\.h\b", part))


def cpp_names() -> "list[str]":
    """`HEADER SCOPE: DECLARATION` of each public name of the installed headers."""
    headers = [header for header in installed_headers() if header not in OF_THE_WIRE]
    return [f"{Path(header).name} {name}" for header in headers for name in declarations((ROOT / header).read_text())]


def declarations(text: str) -> "list[str]":
    """Declarations of a header's namespaces clearance and clearance::eigen, without comments, bodies and macros."""
    text = re.sub(r"//[^\n]*", "", text)
    text = re.sub(r"^ *#(?:[^\n]*\\\n)*[^\n]*$", "", text, flags=re.M)
    found: list[str] = []
    _scan(text, 0, "", True, found)
    return found


def _scan(text: str, at: int, scope: str, is_public: bool, found: "list[str]", is_reachable: bool = True) -> int:
    """Adds the public declarations from `at` to the end of a scope. Returns the place behind its brace."""
    begin = at
    while at < len(text) and text[at] != "}":
        access = ACCESS.match(text, at)
        if access:
            is_public, begin = is_reachable and access[1] == "public", access.end()
        elif text[at] == ";":
            _add(text[begin:at], scope, is_public, found)
            begin = at + 1
        elif text[at] == "{":
            head = " ".join(text[begin:at].split())
            opened = SCOPE.match(head)
            if opened and "(" not in head:
                at = begin = _open(text, at + 1, head, opened, scope, is_public, found)
            elif "(" in head and not head.endswith("="):
                _add(re.sub(r"\) : \w.*", ")", head), scope, is_public, found)
                at = begin = _behind_body(text, at)
            else:  # an initialiser, which a semicolon follows
                at = _behind(text, at)
            continue
        at = max(at + 1, begin)
    return at + 1


def _open(text, at, head, opened, scope, is_public, found):
    """Scans a namespace, a class or an enum, whose brace is before `at`."""
    kind, name = opened[1], opened[2].removeprefix("clearance::")
    if kind == "namespace":
        name = "" if name == "clearance" else name
        return _scan(text, at, name, name in ("", "eigen"), found, name in ("", "eigen"))
    is_public = is_public and name not in OF_THE_LIBRARY
    _add(head, scope, is_public, found)
    inside = f"{scope}::{name}" if scope else name
    if kind != "enum":
        return _scan(text, at, inside, is_public and kind == "struct", found, is_public)
    end, value = text.index("}", at), -1
    for member in text[at:end].split(","):
        key, given, number = (part.strip() for part in member.partition("="))
        value = int(number, 0) if number.isdigit() else value + 1
        _add(f"{key} = {number if given else value}" if key else "", inside, is_public, found)
    return end + 1


def _behind_body(text: str, at: int) -> int:
    """The place behind a function's body, and behind the braces of a constructor's initialisers before it."""
    at = _behind(text, at)
    while more := re.compile(r"\s*(?:,[^{;]*)?\{").match(text, at):
        at = _behind(text, more.end() - 1)
    return at


def _behind(text: str, at: int) -> int:
    """The place behind the brace that closes the one at `at`."""
    depth = 0
    for mark in re.compile(r"[{}]").finditer(text, at):
        depth += 1 if mark[0] == "{" else -1
        if not depth:
            return mark.end()
    raise ValueError("a brace is never closed")


def _add(declaration: str, scope: str, is_public: bool, found: "list[str]") -> None:
    line = NOT_OF_THE_NAME.sub("", " ".join(declaration.split()) + " ").strip()
    if "constexpr" in line:  # the value of a constant may change
        line = re.sub(r" = .*", "", line) if "(" not in line else line
    if line and is_public and not line.startswith(("friend", "static_assert")):
        found.append(f"{scope}: {line}" if scope else line)
