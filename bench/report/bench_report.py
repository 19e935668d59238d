#!/usr/bin/env python3
"""The 2023 report's experiments on this machine: its systems, ours, and Coal where it can be installed.

    bench/run.py report [OPTION...]    further options are those of clearance-report
"""

import subprocess
import sys

import bench_peers
from harness import ROOT


def main():
    coal = []
    try:
        bench_peers.set_up(("coal",))
        coal = ["--coal", str(bench_peers.CONTENDERS["Coal"])]
    except (StopIteration, SystemExit, subprocess.CalledProcessError) as error:
        print(f"{error}\nCoal cannot be had here: it is left out", file=sys.stderr)
    (ROOT / "out").mkdir(exist_ok=True)
    command = [ROOT / "build/bin/clearance-report", "--scratch", "out", *coal, *sys.argv[1:]]
    return subprocess.run(command, cwd=ROOT).returncode


if __name__ == "__main__":
    sys.exit(main())
