"""A fixture of tests for both front ends."""

import pytest

import clearance
from patience import PATIENCE_S
from robots import arm_scene


@pytest.fixture(params=["engine", "shm", "ipc"])
def front(request, urdf, arm_daemon):
    """An engine of the arm in robots.py, or a client of a daemon with it."""
    if request.param == "engine":
        yield clearance.Engine(arm_scene(urdf), backend="cpu", threads=1)
        return
    if request.param not in arm_daemon.urls:
        pytest.skip(f"no {request.param}")
    with clearance.connect(arm_daemon.urls[request.param], timeout_s=PATIENCE_S) as client:
        yield client
