#!/usr/bin/env python3
"""Writes the tables of the pages in docs from docs/results. Exit code 1 if results contradict a page's claims.

    bench/write_pages.py [--draw NAME...]    also draws pictures: peers, proof, report, robots, tradeoff
    bench/write_pages.py --check             changes nothing; exit code 1 if pages differ from docs/results
"""

import argparse
import re
import sys

from harness import ROOT
from pages import accuracy, broad, gpu, latency, meshes, motions, peers, report, robots, tradeoff

DOCS = ROOT / "docs"
MODULES = (accuracy, broad, gpu, latency, meshes, motions, peers, report, robots, tradeoff)
PICTURES = {module.__name__.split(".")[-1]: module for module in MODULES if hasattr(module, "PICTURE")}
TABLE = re.compile(r"(?<=<!-- table )(.*?)( -->\n)(.*?)(?=<!-- end -->)", re.DOTALL)


def filled(pages):
    """The pages' texts with every table regenerated."""
    tables = {name: make for module in MODULES for name, make in module.TABLES.items()}
    shown = [match[0] for text in pages.values() for match in TABLE.findall(text)]
    if sorted(shown) != sorted(tables):
        sys.exit(f"tables on no page or on several, or not known: {', '.join(sorted({*tables} ^ {*shown}) or shown)}")
    made = {name: make() for name, make in tables.items()}
    return {page: TABLE.sub(lambda m: f"{m[1]}{m[2]}{made[m[1]]}\n", text) for page, text in pages.items()}


def broken_claims(pages):
    """Claims of the pages that the results contradict."""
    claims = {name: holds for module in MODULES if hasattr(module, "claims") for name, holds in module.claims().items()}
    made = {name for text in pages.values() for name in re.findall(r"<!-- claim (.*?) -->", text)}
    if made != set(claims):
        sys.exit(f"claims of the pages and of bench/pages differ: {', '.join(sorted(made ^ set(claims)))}")
    return [name for name, holds in claims.items() if not holds]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="change nothing")
    parser.add_argument("--draw", nargs="+", choices=PICTURES, default=[], metavar="NAME", help=", ".join(PICTURES))
    options = parser.parse_args()
    pages = {page: page.read_text() for page in sorted(DOCS.rglob("*.md"))}
    for page, text in filled(pages).items():
        if text == pages[page]:
            continue
        if options.check:
            sys.exit(f"{page.relative_to(ROOT)} does not show docs/results: run make bench SUITE=pages")
        page.write_text(text)
    for name in options.draw:
        PICTURES[name].draw(DOCS / PICTURES[name].PICTURE)
    if broken := broken_claims(pages):
        sys.exit(f"figures contradict what pages say (<!-- claim ... -->): {', '.join(broken)}. Rewrite the page, and "
                 "the claim in bench/pages")


if __name__ == "__main__":
    main()
