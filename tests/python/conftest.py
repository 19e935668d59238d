"""Fixtures of the Python tests.

The package under test is the one in the build folder: build/, or CLEARANCE_BUILD; with CLEARANCE_INSTALLED=1 it is the
installed one and the daemon is the one on PATH. With CLEARANCE_CLIENT=python its client is the one in Python alone.
"""

import importlib
import importlib.util
import os
import pathlib
import random
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import types

import pytest

from limits import pytest_configure, pytest_runtest_protocol  # noqa: F401
from patience import PATIENCE_S

# A background runner may ignore SIGINT, which the programs started by tests would inherit.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Tests use no stored meshes; those of the cache name one.
os.environ["CLEARANCE_CACHE"] = "off"

ROOT = pathlib.Path(__file__).resolve().parents[2]
ROS_PACKAGE = ROOT / "ros" / "clearance_ros"
ROS_MESSAGES = ROOT / "ros" / "clearance_msgs"
BUILD = pathlib.Path(os.environ.get("CLEARANCE_BUILD", ROOT / "build"))
INSTALLED = os.environ.get("CLEARANCE_INSTALLED") == "1"
CLEARANCE = shutil.which("clearance") if INSTALLED else str(BUILD / "bin" / "clearance")

if not INSTALLED:
    sys.path.insert(0, str(BUILD / "python"))
    os.environ["PYTHONPATH"] = os.pathsep.join([str(BUILD / "python"), os.environ.get("PYTHONPATH", "")]).rstrip(
        os.pathsep
    )

PYTHON_CLIENT = os.environ.get("CLEARANCE_CLIENT") == "python"


def use_python_client() -> None:
    """Puts the client in Python alone in place of the extension module."""
    import clearance

    name, file = "clearance._client", BUILD / "python" / "clearance_client" / "_client" / "__init__.py"
    spec = importlib.util.spec_from_file_location(name, file, submodule_search_locations=[str(file.parent)])
    clearance._client = sys.modules[name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(clearance._client)


if PYTHON_CLIENT:
    use_python_client()


@pytest.fixture(scope="session")
def root() -> pathlib.Path:
    """The repository."""
    return ROOT


class Daemon:
    """A clearanced for tests: on sockets in a folder, a free TCP port and a private LCM port."""

    def __init__(self, folder: pathlib.Path, scene: pathlib.Path, kinds, *options: str):
        program = shutil.which("clearanced") if INSTALLED else str(BUILD / "bin" / "clearanced")
        arguments = [program, "--scene", str(scene), "--log-level", "warn", *options]
        group, port = "239.255.76.67", random.SystemRandom().randrange(20000, 60000)
        for kind in kinds:
            arguments += {
                "shm": ["--shm", str(folder / "clearance.sock")],
                "ipc": ["--zmq", f"ipc://{folder}/clearance.ipc"],
                "tcp": ["--zmq", f"tcp://127.0.0.1:{free_tcp_port()}"],
                "udpm": ["--lcm", f"udpm://{group}:{port}?ttl=0"],
            }[kind]
        read, write = os.pipe()
        with open(folder / "log", "w") as log:
            self.process = subprocess.Popen([*arguments, "--ready-fd", str(write)], stderr=log, pass_fds=[write])
        os.close(write)
        with os.fdopen(read) as ready:
            urls = ready.read().split()  # until the daemon closes it, because it is ready or has ended
        self.log = (folder / "log").read_text
        self.urls = {url.partition(":")[0]: url for url in urls}
        if set(self.urls) != set(kinds):
            self.process.kill()
            self.process.wait()
            raise RuntimeError(f"the daemon serves {urls}, not {kinds}: {self.log()}")

    def stop(self) -> int:
        """Ends it as an administrator would. Returns the exit code."""
        self.process.send_signal(signal.SIGCONT)
        self.process.terminate()
        try:
            return self.process.wait(timeout=PATIENCE_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            raise


def free_tcp_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def missing(kind: str) -> "str | None":
    """The reason why this machine or build cannot serve a transport, or None if it can."""
    if kind == "udpm" and PYTHON_CLIENT:
        return "the client in Python alone speaks no LCM"
    with tempfile.TemporaryDirectory() as folder:
        scene = pathlib.Path(folder) / "scene.yaml"
        scene.write_text("bodies:\n  - {name: ball, sphere: 1}\n")
        try:
            Daemon(pathlib.Path(folder), scene, [kind]).stop()
            return None
        except RuntimeError as error:
            text = str(error)
    if "built without" in text or "no multicast route" in text:
        return text
    raise AssertionError(text)


KINDS = ["shm", "ipc", "tcp", "udpm"]


@pytest.fixture(scope="session")
def kinds():
    """The transports of this machine and build, and the reasons why others are missing."""
    return {kind: missing(kind) for kind in KINDS}


@pytest.fixture(scope="session", params=KINDS)
def kind(request, kinds):
    """Each transport."""
    if kinds[request.param]:
        pytest.skip(kinds[request.param])
    return request.param


# Those of another client leave out the engine, which they share.
FRONTS = ["shm", "ipc"] if PYTHON_CLIENT else ["engine", "shm", "ipc", "udpm"]


@pytest.fixture(params=FRONTS)
def front(request, scene, start_daemon, kinds):
    """An engine for the file of the test's own fixture `scene`, or a client of a daemon over a transport."""
    import clearance

    if request.param == "engine":
        return clearance.Engine(clearance.Scene.load(scene))
    if kinds[request.param]:
        pytest.skip(kinds[request.param])  # no LCM in this build, or no multicast route on this machine
    return clearance.connect(start_daemon(scene, [request.param]).urls[request.param], timeout_s=PATIENCE_S)


@pytest.fixture(scope="session")
def urdf(root):
    """The arm of robots.py."""
    return str(root / "tests" / "engine" / "robot" / "arm.urdf")


@pytest.fixture
def arm_engine(urdf):
    import clearance
    from robots import arm_scene

    return clearance.Engine(arm_scene(urdf), threads=1, covers="off")


@pytest.fixture(scope="module")
def arm_daemon(urdf, tmp_path_factory, kinds):
    """The same scene behind every transport."""
    from robots import ARM_YAML

    folder = tmp_path_factory.mktemp("arm")
    shutil.copy(urdf, folder / "arm.urdf")
    (folder / "scene.yaml").write_text(ARM_YAML)
    daemon = Daemon(folder, folder / "scene.yaml", [kind for kind, why in kinds.items() if not why])
    yield daemon
    assert daemon.stop() == 0, daemon.log()


@pytest.fixture(params=[front for front in FRONTS if front != "udpm"])
def arm_front(request, urdf, arm_daemon):
    """An engine of that scene, or a client of that daemon."""
    import clearance
    from robots import arm_scene

    if request.param == "engine":
        yield clearance.Engine(arm_scene(urdf), backend="cpu", threads=1, covers="off")
        return
    if request.param not in arm_daemon.urls:
        pytest.skip(f"no {request.param}")
    with clearance.connect(arm_daemon.urls[request.param], timeout_s=PATIENCE_S) as client:
        yield client


@pytest.fixture
def start_daemon(tmp_path_factory):
    """start_daemon(scene, kinds, *options) -> Daemon, stopped at the end of the test."""
    daemons = []

    def start(scene, kinds, *options):
        daemons.append(Daemon(tmp_path_factory.mktemp("daemon"), scene, kinds, *options))
        return daemons[-1]

    yield start
    for daemon in daemons:
        if daemon.process.poll() is None:
            daemon.stop()


@pytest.fixture(scope="module")
def cell(root):
    return root / "scenes" / "cell" / "scene.yaml"


@pytest.fixture
def ipc(start_daemon, cell):
    """A daemon for one test alone."""
    return start_daemon(cell, ["ipc"])


# Engines in this process. The package and its dependencies are imported once its path is known.


@pytest.fixture
def engine():
    import clearance
    from scenes import ARM_POSES, arm

    engine = clearance.Engine(arm(), covers="off")
    engine.set_poses(ARM_POSES)
    return engine


@pytest.fixture(scope="module")
def crowd():
    import numpy as np

    import clearance
    from scenes import random_hulls, random_poses

    scene, poses = random_hulls(40, seed=9)
    engine = clearance.Engine(scene, covers="off")
    engine.set_poses(poses)
    rng = np.random.default_rng(10)
    return engine, np.stack([random_poses(rng, 40, 2.5) for _ in range(3)])


@pytest.fixture(scope="module")
def daemon(cell, kinds, tmp_path_factory):
    """One daemon on every available transport, for the tests that do not change its scene."""
    daemon = Daemon(tmp_path_factory.mktemp("daemon"), cell, [kind for kind, why in kinds.items() if why is None])
    yield daemon
    assert daemon.stop() == 0, daemon.log()


@pytest.fixture(scope="session")
def checker(root):
    """tools/check_certificate.py, and the oracle in C++ if it is built."""
    from certificates import Judges

    spec = importlib.util.spec_from_file_location("check_certificate", root / "tools" / "check_certificate.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    program = BUILD / "bin" / "clearance-check-certificate"
    return Judges(module, program if program.exists() and not INSTALLED else None)


@pytest.fixture
def ros(monkeypatch):
    """Modules of the ROS 2 package that need no ROS."""
    monkeypatch.syspath_prepend(str(ROS_PACKAGE))
    names = ["bridge", "planning_scene", "trajectory"]
    yield types.SimpleNamespace(**{name: importlib.import_module(f"clearance_ros.{name}") for name in names})
    for name in [name for name in sys.modules if name.partition(".")[0] == "clearance_ros"]:
        del sys.modules[name]


@pytest.fixture
def bridge(ros, start_daemon, urdf, tmp_path):
    """A bridge of the ROS 2 package to a daemon with an arm, a cup and a cloud."""
    import clearance
    from robots import ARM_YAML

    scan = "  - {name: scan, points: [], radius: 0.01, pose: [0, 0, 0, 1, 0, 0, 0]}\n"
    shutil.copy(urdf, tmp_path / "arm.urdf")
    (tmp_path / "scene.yaml").write_text(ARM_YAML.replace("robots:", scan + "robots:"))
    daemon = start_daemon(tmp_path / "scene.yaml", ["ipc"])
    bridge = ros.bridge.Bridge(clearance.connect(daemon.urls["ipc"]), "arm")
    bridge.daemon = daemon
    yield bridge
    bridge.client.close()
