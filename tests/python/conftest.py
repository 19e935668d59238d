"""Fixtures of the Python tests.

The package under test is the one in the build folder: build/, or CLEARANCE_BUILD; with CLEARANCE_INSTALLED=1 it is the
installed one and the daemon is the one on PATH.
"""

import os
import pathlib
import shutil
import sys

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = pathlib.Path(os.environ.get("CLEARANCE_BUILD", ROOT / "build"))
INSTALLED = os.environ.get("CLEARANCE_INSTALLED") == "1"

if not INSTALLED:
    sys.path.insert(0, str(BUILD / "python"))
    os.environ["PYTHONPATH"] = os.pathsep.join([str(BUILD / "python"), os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep)


@pytest.fixture(scope="session")
def root() -> pathlib.Path:
    """The repository."""
    return ROOT
