"""Checks that shipped binaries have no fused multiply-add: bounds are proved for products and sums that are rounded one
by one, and answers have the same bits on every instruction set.

usage: check_no_fused.py BINARY...
"""

import re
import subprocess
import sys

FUSED = re.compile(r"\s(vfn?m(?:add|sub)\w*|fn?m(?:add|sub)\s|fml[as]\s)")  # x86-64; ARM
PRODUCT = re.compile(r"\s(v?mulp[sd]|fmul)\s")

failures = []
for path in sys.argv[1:]:
    objdump = ["objdump", "-d", "--no-show-raw-insn", path]
    code = subprocess.run(objdump, check=True, capture_output=True, text=True).stdout
    fused: dict[str, int] = {}
    products = 0
    function = "?"
    for line in code.splitlines():
        if line.endswith(">:"):
            function = line
        elif FUSED.search(line):
            fused[function] = fused.get(function, 0) + 1
        elif PRODUCT.search(line):
            products += 1
    failures += [f"{path}: {count} fused operations in {name}" for name, count in fused.items()]
    if products < 100:
        failures.append(f"{path}: only {products} packed products seen; is it the engine?")
    print(f"{path}: {products} packed products, {sum(fused.values())} fused operations")
print("\n".join(failures))
sys.exit(bool(failures) or len(sys.argv) < 2)
