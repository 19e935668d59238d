"""Checks that object files compiled for one instruction set define no function that others could be linked to.

usage: check_lane_symbols.py OBJECT... (all objects of the engine; only those named lanes_SET are tested)
"""

import pathlib
import subprocess
import sys

looked_at = 0
failures = []
for path in map(pathlib.Path, sys.argv[1:]):
    name = path.name.split(".")[0]
    if not name.startswith("lanes_"):
        continue
    looked_at += 1
    symbols = subprocess.run(["nm", "-C", "--defined-only", path], check=True, capture_output=True, text=True).stdout
    for line in symbols.splitlines():
        _, kind, symbol = line.split(maxsplit=2)
        if kind in "WVuT" and name not in symbol and not symbol.startswith("DW.ref."):
            failures.append(f"{path.name} {kind} {symbol}")
print("\n".join(failures) or f"{looked_at} object files, no symbol that others could share")
sys.exit(bool(failures) or looked_at == 0)
