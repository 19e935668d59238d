#!/usr/bin/env python3
"""Counts private words and phrases in comments, docstrings and pages, and fails where a count rises.

vocabulary.py            compares the counts with tools/vocabulary_budget.txt, and prints the rates
vocabulary.py FILE...    lists each use in these files, with its replacement
vocabulary.py --write    lowers the budget to the counts; it never raises one
"""
from __future__ import annotations

import argparse
import ast
import functools
import io
import re
import subprocess
import sys
import tokenize
from bisect import bisect
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple, Optional

ROOT = Path(__file__).resolve().parents[1]
BUDGET = ROOT / "tools" / "vocabulary_budget.txt"
TITLE = "# Uses of each habit of tools/vocabulary.py. Counts only fall: `tools/vocabulary.py --write` lowers them."
CPP = (".cpp", ".h", ".cu", ".cuh")
SUFFIXES = (*CPP, ".py", ".md")
CODE = "\0"  # in place of a line's code: no phrase matches across it


class Habit(NamedTuple):
    """A pattern to avoid: a regular expression on lower-case text, in which a space is any white space."""

    name: str
    pattern: str
    replacement: str
    highest: Optional[float] = None  #: uses per 1,000 words of comments, in the highest of eight model codebases


HABITS = (
    Habit("ask", r"\bask(?:s|ed|ing)?\b", "query, request, requested", 0.08),
    Habit("what is", r"\bwhat(?:ever)? (?:is|it|they|are|was|were|a|an|the|has)\b", "a noun phrase", 0.11),
    Habit("say", r"\b(?:say|says|said)\b", "return, state, specify, describe", 0.05),
    Habit("whoever", r"\b(?:whoever|nobody|somebody|someone|strangers?)\b", "caller, unauthenticated peer", 0.03),
    Habit("look at", r"\blook(?:s|ed|ing)? at\b", "test, read, visit", 0.06),
    Habit("beside", r"\b(?:beside|anew)\b", "next to, in addition to; again", 0.03),
    Habit("doubt", r"\b(?:doubts?|not known)\b", "uncertainty, unknown", 0.03),
    Habit("he", r"\b(?:he|him|his)\b", "the caller, the client"),
    Habit("tell", r"\b(?:tell|tells|told)\b", "return, report, distinguish"),
    Habit("none:", r"(?<!\w)(?:none|null|nullptr|empty|0|true|false): (?=[a-z])", "a clause: if null, ...; 0 if ..."),
    Habit(r"\param", r"(?<=[^\s\0])[\t\x20]+[\\@]param\b", "on a line of its own"),
    Habit("stand for", r"\b(?:stands?|stood|standing) for\b|\bstand-ins?\b", "proxy; represent"),
    Habit("piece", r"\bpieces?\b", "convex part"),
    Habit("truth", r"\btruths?\b", "exact geometry"),
    Habit("settle", r"\bsettle[sd]?\b", "converge, decide"),
    Habit("dear", r"\bdear(?:er|est)?\b", "expensive"),
    Habit("refuse", r"\brefus(?:e|es|ed|ing|als?)\b", "reject, rejected"),
    Habit("judge", r"\b(?:judge[sd]?|campaigns?)\b", "oracle, check"),
    Habit("knock", r"\bknock(?:s|ed|ing)?\b|\bdoorm[ae]n\b", "connect; unauthenticated peer"),
    Habit("complain", r"\bcomplain(?:s|ed|ing|ts?)?\b", "log, report"),
    Habit("figures", r"\bfigures\b", "metrics, measurements"),
    Habit("room", r"\brooms?\b", "module; scratch, space"),
    Habit("the CPU's text", r"\b(?:cpu|gpu|code)'s (?:text|words?)\b", "same source as the CPU"),
)  # fmt: skip
COMPILED = [(habit, re.compile(habit.pattern.replace(" ", r"\s+"))) for habit in HABITS]

CPP_TOKEN = re.compile(
    r'R"(?P<end>[^(\s]*)\(.*?\)(?P=end)"'
    r'|"(?:\\.|[^"\\\n])*"'
    r"|(?<![0-9a-fA-F])'(?:\\.|[^'\\\n])+'"  # no digit separator
    r"|(?P<comment>//[^\n]*|/\*.*?\*/)",
    re.S,
)
MARKS = re.compile(r"^[ \t]*(?://[/!]?<?|/\*+!?|\*(?!/)|#[:!]?)|\*/|`[^`\n]*`", re.M)
NOT_PROSE = re.compile(r"^ *```.*?^ *```|<!--.*?-->|`[^`]*`|\]\([^)\s]*\)|https?://\S+", re.M | re.S)


class Use(NamedTuple):
    """One use of a habit."""

    line: int
    text: str
    habit: Habit


@functools.lru_cache(maxsize=1)
def prose(text: str, suffix: str) -> str:
    """The comments and docstrings of code, or the sentences of a page, on their lines and in lower case."""
    if suffix == ".md":
        return NOT_PROSE.sub(lambda found: lines_of_code(found[0]), text).lower()
    parts, end = [], 0
    for start, stop in sorted(cpp_comments(text) if suffix in CPP else python_comments(text)):
        parts += [lines_of_code(text[end:start]), MARKS.sub(" ", text[start:stop])]
        end = stop
    return "".join(parts).lower()


def lines_of_code(text: str) -> str:
    return re.sub(r"\S[^\n]*", CODE, text)


def cpp_comments(text: str) -> Iterator[tuple[int, int]]:
    return (found.span() for found in CPP_TOKEN.finditer(text) if found["comment"])


def python_comments(text: str) -> Iterator[tuple[int, int]]:
    starts = [0]
    for line in text.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            yield starts[token.start[0] - 1] + token.start[1], starts[token.end[0] - 1] + token.end[1]
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)):
            first = node.body[0] if node.body else None
            if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant) and type(first.value.value) is str:
                yield starts[first.lineno - 1] + first.col_offset, starts[first.end_lineno - 1] + first.end_col_offset


def uses_in(text: str, suffix: str) -> list[Use]:
    """All uses of habits in a file's comments, docstrings or sentences, by line."""
    masked = prose(text, suffix)
    breaks = [found.start() for found in re.finditer("\n", masked)]
    return sorted(
        Use(1 + bisect(breaks, found.start()), " ".join(found[0].split()), habit)
        for habit, pattern in COMPILED
        for found in pattern.finditer(masked)
    )


def words_in(text: str, suffix: str) -> int:
    return len(re.findall(r"[A-Za-z][A-Za-z'-]*", prose(text, suffix)))


def over_budget(counts: dict[str, int], budget: dict[str, int]) -> list[str]:
    """Habits with more uses than the budget has, or without a budget."""
    return [name for name, count in counts.items() if count > budget.get(name, -1)]


def lowered(counts: dict[str, int], budget: dict[str, int]) -> dict[str, int]:
    return {name: min(count, budget.get(name, count)) for name, count in counts.items()}


def read_budget(text: str) -> dict[str, int]:
    rows = (line.split(maxsplit=1) for line in text.splitlines() if line and not line.startswith("#"))
    return {name: int(count) for count, name in rows}


def budget_text(budget: dict[str, int]) -> str:
    return "".join(f"{line}\n" for line in (TITLE, *(f"{count:5} {name}" for name, count in budget.items())))


def git_files(*command: str) -> list[str]:
    done = subprocess.run(["git", *command], cwd=ROOT, capture_output=True, text=True)
    return [name for name in done.stdout.splitlines() if name.endswith(SUFFIXES) and (ROOT / name).is_file()]


def is_checked(name: str) -> bool:
    """All code; of the Markdown the pages, not the records of releases, measurements and old names."""
    return not name.endswith(".md") or name in ("README.md", "CONTRIBUTING.md") or (
        name.startswith("docs/") and not name.startswith(("docs/results/", "docs/notes/renamed.md"))
    )  # fmt: skip


def show(name: str, text: str, habits: list[str]) -> None:
    for line, found, habit in uses_in(text, Path(name).suffix):
        if habit.name in habits:
            print(f"{name}:{line}: {found} -> {habit.replacement}")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", nargs="*")
    parser.add_argument("--write", action="store_true")
    given = parser.parse_args()
    if given.file:
        for name in given.file:
            show(name, Path(name).read_text(), [habit.name for habit in HABITS])
        return 0

    counts = {habit.name: 0 for habit in HABITS}
    in_comments, words = dict(counts), 0
    texts = {name: (ROOT / name).read_text() for name in git_files("ls-files") if is_checked(name)}
    for name, text in texts.items():
        for use in uses_in(text, Path(name).suffix):
            counts[use.habit.name] += 1
            in_comments[use.habit.name] += not name.endswith(".md")
        words += 0 if name.endswith(".md") else words_in(text, Path(name).suffix)

    budget = read_budget(BUDGET.read_text()) if BUDGET.is_file() else {}
    if given.write:
        budget = lowered(counts, budget)
        BUDGET.write_text(budget_text(budget))
    print(f"{'habit':<16} {'uses':>6} {'budget':>6}   per 1,000 words of {words:,} in comments, and target")
    for habit in HABITS:
        rate = f"{1000 * in_comments[habit.name] / words:8.2f}"
        target = "" if habit.highest is None else f"{3 * habit.highest:8.2f}"
        print(f"{habit.name:<16} {counts[habit.name]:6} {budget.get(habit.name, 0):6}   {rate} {target}".rstrip())

    over = over_budget(counts, budget)
    if over:
        changed = git_files("diff", "--name-only", "HEAD~1") or git_files("diff", "--name-only", "HEAD")
        for name in filter(texts.__contains__, changed):
            show(name, texts[name], over)
        print("vocabulary: these counts rose; above are their uses in the files that changed last. FILE lists others.")
        for name in over:
            print(f"  {name}: {counts[name]} uses, budget {budget.get(name, 'missing (--write adds it)')}")
    return 1 if over else 0


if __name__ == "__main__":
    sys.exit(main())
