"""Shared by the examples: a clearanced of their own, and the folders of a package that is not installed.

Import it before `clearance` and `clearance_lcm`; with an installed Clearance it changes nothing.
"""

from __future__ import annotations

import contextlib
import ctypes
import importlib.util
import os
import pathlib
import random
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = pathlib.Path(os.environ.get("CLEARANCE_BUILD", ROOT / "build"))
ARM = ROOT / "scenes/cell/arm.urdf"

if importlib.util.find_spec("clearance") is None:
    sys.path.append(str(BUILD / "python"))


def die_with_parent() -> None:
    """In a child: ends it with its parent, however the parent ends."""
    ctypes.CDLL(None).prctl(1, signal.SIGTERM)  # PR_SET_PDEATHSIG


@contextlib.contextmanager
def daemon(scene, options: Sequence[str] = ()) -> Iterator[dict[str, str]]:
    """A clearanced that serves a clearance.Scene over shared memory and LCM while the block runs.

    Yields its URLs by kind, {"shm": ..., "udpm": ...}. Raises RuntimeError with its output if it does not serve.
    """
    program = shutil.which("clearanced") or str(BUILD / "bin/clearanced")
    port = random.SystemRandom().randrange(20000, 60000)
    with tempfile.TemporaryDirectory(prefix="clearance-example-") as folder:
        scene.save(f"{folder}/scene")
        read_end, write_end = os.pipe()
        command = [program, "--scene", f"{folder}/scene/scene.yaml", "--shm", f"{folder}/sock", "--log-level", "warn"]
        command += ["--lcm", f"udpm://239.255.76.67:{port}?ttl=0", "--ready-fd", str(write_end), *options]
        process = subprocess.Popen(command, pass_fds=[write_end], stderr=subprocess.PIPE, preexec_fn=die_with_parent)
        os.close(write_end)
        try:
            with os.fdopen(read_end) as ready:
                urls = ready.read().split()
            if len(urls) != 2:
                process.kill()
                raise RuntimeError(f"clearanced does not serve: {process.communicate()[1].decode()}")
            yield {url.partition(":")[0]: url for url in urls}
        finally:
            process.terminate()
            process.communicate()
