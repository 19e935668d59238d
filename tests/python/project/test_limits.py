"""No test can hang: tests of ctest and of pytest have time limits."""

import json
import os
import shutil
import subprocess
import sys

import pytest

from conftest import BUILD, INSTALLED
from patience import PATIENCE_S

CONFTEST = "import limits\nfrom limits import *\nlimits.LIMIT_S = 0.1\n"
HANGING = """
import threading, pytest

def hangs():
    started.set()
    threading.Event().wait()

started = threading.Event()
threading.Thread(target=hangs, daemon=True).start()
started.wait()  # before the clock of any test runs

@pytest.mark.limit_s(1000)
def test_that_ends():
    pass

def test_that_hangs():
    threading.Event().wait()
"""


def test_a_test_that_hangs_ends_the_run_and_is_shown(root, tmp_path):
    (tmp_path / "conftest.py").write_text(CONFTEST)
    (tmp_path / "test_hanging.py").write_text(HANGING)
    environment = {**os.environ, "PYTHONPATH": str(root / "tests" / "python")}
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-v", "-p", "no:cacheprovider", "test_hanging.py"],
        cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=PATIENCE_S,
    )  # fmt: skip
    assert done.returncode == 1
    assert "test_that_ends PASSED" in done.stdout and "test_that_hangs PASSED" not in done.stdout, done.stdout
    assert "Timeout (0:00:00.1" in done.stderr and 'test_hanging.py", line 6 in hangs' in done.stderr, done.stderr


@pytest.mark.skipif(INSTALLED or not shutil.which("ctest"), reason="there is no build")
def test_every_test_of_ctest_has_a_limit(tmp_path):
    # From a folder of its own: ctest writes a log even here, in place of that of the run that this test is a part of.
    (tmp_path / "CTestTestfile.cmake").write_text(f'subdirs("{BUILD}")')
    listed = subprocess.run(
        ["ctest", "--test-dir", tmp_path, "--show-only=json-v1"], capture_output=True, text=True, check=True
    )
    tests = json.loads(listed.stdout)["tests"]
    assert len(tests) > 100
    for test in tests:
        limits = [p["value"] for p in test.get("properties", []) if p["name"] == "TIMEOUT"]
        assert test["name"].endswith("_NOT_BUILT") or (limits and limits[0] > PATIENCE_S), test["name"]
