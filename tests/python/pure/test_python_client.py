"""The client in Python alone: the tests of the native client, and its rejections."""

import os
import re
import subprocess
import sys

import pytest

import clearance
from conftest import BUILD, INSTALLED
from patience import PATIENCE_S

TESTS = [
    "client/test_client.py", "client/test_client_errors.py", "client/test_client_scene.py", "engine/test_prepare.py",
    "engine/test_prepare_memory.py", "engine/test_prepare_scene.py", "engine/test_future.py", "engine/test_poses.py",
    "engine/test_remote_plan.py", "engine/test_velocities.py", "scene/test_joints.py",
]  # fmt: skip


@pytest.mark.skipif(INSTALLED, reason="the build's")
@pytest.mark.limit_s(12 * PATIENCE_S)
def test_it_does_what_the_native_client_does(root):
    environment = {**os.environ, "CLEARANCE_CLIENT": "python"}
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *TESTS],
        cwd=root / "tests" / "python", env=environment, capture_output=True, text=True, timeout=10 * PATIENCE_S,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-8000:]
    assert int(re.search(r"(\d+) passed", done.stdout).group(1)) > 150, done.stdout


@pytest.mark.skipif(INSTALLED, reason="the build's")
@pytest.mark.parametrize("code, why", [
    ("connect('udpm://239.255.76.67:7667?ttl=0')", "ConnectionError.*not support LCM; install .*clearance-.*whl"),
    ("Engine", "ImportError.*clearance_client.Engine is not there: this is a client-only install"),
    ("DevicePlan", "ImportError.*clearance_client.DevicePlan is not there: this is a client-only install"),
    ("from_pinocchio", "ImportError.*clearance_client.from_pinocchio is not there: this is a client-only install"),
    ("connect('http://x')", "ValueError.*is not a url of a daemon"),
])  # fmt: skip
def test_what_it_does_not_do_is_refused_by_name(code, why):
    done = subprocess.run(
        [sys.executable, "-c", f"import clearance_client; clearance_client.{code}"],
        env={**os.environ, "PYTHONPATH": str(BUILD / "python")}, capture_output=True, text=True, timeout=PATIENCE_S,
    )  # fmt: skip
    assert done.returncode == 1 and re.search(why, done.stderr), done.stderr


@pytest.mark.skipif(INSTALLED, reason="the build's")
def test_a_star_takes_all_that_there_is():
    code = "from clearance_client import *; connect, Status, from_coal; import clearance_client as c; print(*c.__all__)"
    done = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, "PYTHONPATH": str(BUILD / "python")}, capture_output=True,
        text=True, timeout=PATIENCE_S,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    absent = {"DeviceArray", "DevicePlan", "DeviceRows", "Engine", "Scene"}
    absent |= {"MujocoWorld", "PinocchioWorld", "from_mujoco", "from_pinocchio"}
    assert set(clearance.__all__) - set(done.stdout.split()) == absent


#: The reply and request sizes of the client in Python alone, without a daemon.
_SIZES = """
import types
import numpy as np
from clearance_client import _words, wire
from clearance_client._client import answers, frames, query_requests

def reply(joints, rows):
    header = np.zeros(1, wire._wire.ReplyHeader)
    header["rows"], header["fields"], header["backend"] = rows, _words.Field.HESSIAN_JOINTS, b"cpu"
    records = frames.record(2, joints.to_bytes(4, "little"))
    payload = header.tobytes() + records
    return frames.Frame(frames.header_bytes(1, 1, len(payload), records=len(records)), payload, "url")

assert answers.answer_of(reply(1 << 13, 0), True, "url").joints == 1 << 13
for joints in (1 << 14, 1 << 31, (1 << 32) - 1):
    try:
        answers.answer_of(reply(joints, 0), True, "url")
    except Exception as error:
        assert "more than a frame may have" in str(error), error
    else:
        raise AssertionError(joints)

scene = types.SimpleNamespace(bodies=range(9), pair_count=36)
requests = types.SimpleNamespace(_scene=scene)
def expected(k, pairs=None):
    q = wire.query_header(reduce=_words.Reduce.NEAREST, fields=int(_words.Field.LOWER), configuration_count=4)
    return query_requests.QueryRequests._expected_reply_bytes(requests, q, pairs, 0, k)
assert expected(36) == expected(60000) > expected(9) == expected(0) > expected(2)
listed = np.array([[0, 1]] * 9, np.uint32)
assert expected(60000, listed) == expected(9)
scene, requests._scene = None, None
assert expected(60000) == 0
"""


@pytest.mark.skipif(INSTALLED, reason="the build's")
def test_sizes_of_replies():
    done = subprocess.run(
        [sys.executable, "-c", _SIZES], env={**os.environ, "PYTHONPATH": str(BUILD / "python")}, capture_output=True,
        text=True, timeout=PATIENCE_S,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
