#!/usr/bin/env python3
"""Writes the man page of a program from the --help of the program and of each of its commands.

    man_page.py PROGRAM SECTION FILE.gz

A page has nothing that --help has not. The build runs this (cli/CMakeLists.txt, server/CMakeLists.txt).
"""

import gzip
import os
import re
import subprocess
import sys
from pathlib import Path


def help_of(program: str, *commands: str) -> str:
    """The text of --help without traces of the user who builds."""
    environment = {key: value for key, value in os.environ.items() if key not in ("XDG_RUNTIME_DIR", "CLEARANCE_URL")}
    done = subprocess.run([program, *commands, "--help"], capture_output=True, text=True, check=True, env=environment)
    return re.sub(r"/tmp/clearance-\d+/", "/tmp/clearance-UID/", done.stdout)


def commands_of(text: str) -> list:
    listed = re.search(r"^SUBCOMMANDS:\n(.*?)(?:\n\n|\Z)", text, re.DOTALL | re.MULTILINE | re.IGNORECASE)
    return re.findall(r"^  ([a-z][a-z-]*)", listed[1], re.MULTILINE) if listed else []


def roff(text: str) -> str:
    """Text escaped for roff."""
    text = text.replace("\\", "\\e").replace("-", "\\-")
    return re.sub(r"^(?=[.'])", r"\\&", text, flags=re.MULTILINE)


def as_it_is(text: str) -> str:
    """Text with its line breaks."""
    return f".nf\n{roff(text.strip(chr(10)))}\n.fi\n"


def page(program: str, section: str) -> str:
    name = Path(program).name
    text = help_of(program)
    version = subprocess.run([program, "--version"], capture_output=True, text=True, check=True).stdout.split()[-1]
    what, rest = text.split("Usage: ", 1)
    usage, rest = rest.split("\n", 1)
    what = " ".join(what.split())
    summary = what.split(". ")[0].rstrip(".")
    out = [f'.TH {name.upper()} {section} "" "clearance {version}"\n']
    out += [f".SH NAME\n{roff(name)} \\- {roff(summary[0].lower() + summary[1:])}\n", f".SH SYNOPSIS\n{roff(usage)}\n"]
    out += [f".SH DESCRIPTION\n{roff(what)}\n.PP\n", as_it_is(rest)]
    return "".join(out) + sections(program, [], text)


def sections(program: str, path: list, text: str) -> str:
    """A section for each command below a path of commands, whose --help is `text`."""
    out = ""
    for command in commands_of(text):
        below = [*path, command]
        try:
            text = help_of(program, *below)
        except subprocess.CalledProcessError:  # a program of its own, which this build is without
            continue
        out += f".SH {roff(' '.join([Path(program).name, *below])).upper()}\n{as_it_is(text)}"
        out += sections(program, below, text)
    return out


def main() -> None:
    program, section, file = sys.argv[1:]
    with open(file, "wb") as raw, gzip.GzipFile("", "wb", 9, raw, mtime=0) as packed:
        packed.write(page(program, section).encode())


if __name__ == "__main__":
    main()
