#!/usr/bin/env python3
"""Checks the proof of docs/trust/proof.md: extracts the bounds' expressions from the source, and has Coq check
every file.

    proof/prove.py [--source ROOT] [--build out/proof]

Fails if the source computes something else, if a proof fails, or if it rests on an axiom that is not listed
in AXIOMS.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

from cpp import Unknown
from extract import write
from passages import Source

HERE = Path(__file__).resolve().parent
ORDER = "Arithmetic Model Source Tie Vectors Rounding Bounds Lower Point Upper Pair Claim"
FILES = ORDER.split()
THEOREMS = ["run_contains_distance", "certify_contains_distance"]
AXIOMS = {
    "ClassicalDedekindReals.sig_not_dec",  # Coq's reals
    "ClassicalDedekindReals.sig_forall_dec",  # Coq's reals
    "FunctionalExtensionality.functional_extensionality_dep",  # Coq's reals
    "Classical_Prop.classic",  # excluded middle: Flocq
}


def coqc(build: Path, name: str) -> subprocess.CompletedProcess[str]:
    command = ["coqc", "-q", "-Q", ".", "Clearance", f"{name}.v"]
    return subprocess.run(command, cwd=build, capture_output=True, text=True, timeout=900)


def compile_all(build: Path, names: list[str]) -> str:
    """Compiles files in order. Returns the first error, or nothing."""
    for name in names:
        begin = time.monotonic()
        done = coqc(build, name)
        if done.returncode != 0:
            return f"{name}.v: {done.stdout}{done.stderr}".strip()
        print(f"  {name}.v  {time.monotonic() - begin:.0f} s", flush=True)
    return ""


def assumptions(build: Path, theorem: str) -> set[str]:
    (build / "Assumptions.v").write_text(f"From Clearance Require Import Claim.\nPrint Assumptions {theorem}.\n")
    done = coqc(build, "Assumptions")
    if done.returncode != 0:
        raise SystemExit(f"error: {done.stderr}")
    if "Closed under the global context" in done.stdout:
        return set()
    head, _, rest = done.stdout.partition("Axioms:\n")
    if head or not rest:
        raise SystemExit(f"error: cannot read the axioms of {theorem}: {done.stdout}")
    return set(re.findall(r"^(\S+)", rest, re.MULTILINE))


def prepare(build: Path, source: Source) -> None:
    shutil.rmtree(build, ignore_errors=True)
    build.mkdir(parents=True)
    for file in HERE.glob("*.v"):
        shutil.copy(file, build)
    (build / "Source.v").write_text(write(source))


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--source", type=Path, default=HERE.parent, help="root of the C++ source")
    parser.add_argument("--build", type=Path, default=HERE.parent / "out" / "proof", help="folder for compiled files")
    options = parser.parse_args()
    if not shutil.which("coqc"):
        sys.exit("error: there is no coqc: install the packages coq and libcoq-flocq, or run make prove")
    try:
        prepare(options.build, Source(options.source))
    except Unknown as unknown:
        sys.exit(f"error: the proof does not cover the source as it is now: {unknown}")
    error = compile_all(options.build, FILES)
    if error:
        sys.exit(f"error: not proved: {error}")
    for theorem in THEOREMS:
        found = assumptions(options.build, theorem)
        print(f"{theorem} rests on {', '.join(sorted(found))}")
        if not found <= AXIOMS:
            sys.exit(f"error: axioms that are not allowed: {', '.join(sorted(found - AXIOMS))}")
    print("Proved: the computed interval contains the exact distance.")


if __name__ == "__main__":
    main()
