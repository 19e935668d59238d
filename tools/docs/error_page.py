#!/usr/bin/env python3
"""Writes docs/errors.md: every status, flag, error code, exception and exit code, from the code.

    tools/docs/error_page.py            # writes it
    tools/docs/error_page.py --check    # exit code 1 if the page differs from the result

Lines are the comments of the enumerators, the docstrings of the exceptions and the texts of --help.
"""

import ast
import inspect
import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BUILD = Path(os.environ.get("CLEARANCE_BUILD", ROOT / "build"))
PACKAGE = ROOT / "client/python/clearance"
PAGE = ROOT / "docs/errors.md"
PROGRAMS = [
    "clearance",
    "clearanced",
    "clearance inspect",
    "clearance robot",
    "clearance cache",
    "clearance selftest",
]

HEAD = """\
# Statuses, flags, errors
<!-- Made by tools/docs/error_page.py from the code; a test compares. -->
There are three kinds of failure, [each with its own report](concepts.md#status):

- at set-up an exception or an exit code, with a text that names cause and place;
- of a request an error with a code;
- of a row a status, while other rows are answered.
"""
SECTIONS = {
    "status": """
## Statuses of a row
`clearance.Status`, in C++ `clearance::Status`.
Treat an unknown status as no answer: newer daemons may have more.
In decisions only `BEYOND` is free: there `OK`, `OVERLAP` and `CONTACT` mean that a pair is proved within its margin.

""",
    "flag": """
## Flags of a row
`clearance.Flag`, in C++ `clearance::Flag`: bits of the column `flags`.

""",
    "code": """
## Error codes of a request
`QueryError.code` and `RequestError.code`, values of `clearance.wire.ErrorCode`; in C++ `clearance::wire::ErrorCode`.
The text of an error may change; its code does not.

""",
    "exception": """
## Exceptions in Python
A wrong argument is a `TypeError` or `ValueError` that names it.
All other exceptions are a `clearance.ClearanceError`.

""",
    "exit": """
## Exit codes of programs
""",
}


def enumerators(file: str, name: str) -> "list[tuple[str, str, str]]":
    """(name, value, line) of each member of an enum of the package."""
    source = (PACKAGE / file).read_text()
    found = next(node for node in ast.parse(source).body if isinstance(node, ast.ClassDef) and node.name == name)
    rows = []
    for line in source.splitlines()[found.lineno : found.end_lineno]:
        member = re.match(r"    ([A-Z][A-Z0-9_]*) = ([^#]+?)(?:  #: (.*))?$", line)
        if member:
            if not member[3]:
                raise SystemExit(f"{file}: {name}.{member[1]} has no line with its meaning")
            rows.append((member[1], str(ast_value(member[2])), member[3]))
    return rows


def ast_value(text: str) -> int:
    return int(eval(compile(ast.parse(text, mode="eval"), text, "eval"), {"__builtins__": {}}))


def exceptions() -> "list[tuple[str, str, str]]":
    """(name, base classes, first paragraph) of each exception and warning."""
    rows = []
    for node in ast.parse((PACKAGE / "_errors.py").read_text()).body:
        if isinstance(node, ast.ClassDef):
            paragraph = inspect.cleandoc(ast.get_docstring(node) or "").split("\n\n")[0].replace("\n", " ")
            rows.append((node.name, ", ".join(f"`{ast.unparse(base)}`" for base in node.bases), paragraph))
    return rows


def exit_codes(program: str) -> "list[tuple[str, str]]":
    """(code, meaning) from a program's --help, by code."""
    name, *command = program.split()
    arguments = [BUILD / "bin" / name, *command, "--help"]
    text = subprocess.run(arguments, capture_output=True, text=True, check=True).stdout
    listed = text.split("Exit codes", 1)[1]
    return sorted(re.findall(r"(\d) (\S.*?)(?= {3,}\d |$)", listed, re.MULTILINE))


def table(header: "list[str]", rows) -> str:
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows]) + "\n"


def coded(rows):
    return [(f"`{name}`", value, line) for name, value, line in rows]


def page() -> str:
    out = [HEAD]
    out += [SECTIONS["status"], table(["status", "value", "means"], coded(enumerators("_words.py", "Status")))]
    out += [SECTIONS["flag"], table(["flag", "bit", "means"], coded(enumerators("_words.py", "Flag")))]
    out += [SECTIONS["code"], table(["code", "value", "means"], coded(enumerators("wire.py", "ErrorCode")))]
    kinds = [(f"`{name}`", base, line) for name, base, line in exceptions()]
    out += [SECTIONS["exception"], table(["exception", "is a", "means"], kinds), SECTIONS["exit"]]
    rows = [(f"`{program}`", code, meaning) for program in PROGRAMS for code, meaning in exit_codes(program)]
    out.append(table(["program", "code", "means"], rows))
    return "".join(out)


def main() -> int:
    if sys.argv[1:] == ["--check"]:
        same = PAGE.read_text() == page()
        print(f"{PAGE.relative_to(ROOT)}: {'up to date' if same else 'not what tools/docs/error_page.py writes'}")
        return int(not same)
    PAGE.write_text(page())
    return 0


if __name__ == "__main__":
    sys.exit(main())
