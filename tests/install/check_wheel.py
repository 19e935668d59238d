"""check_wheel.py NAME SCENES [PROGRAM]: checks an installed wheel; run by the Python in which it is installed."""

import importlib
import importlib.metadata
import json
import os
import pathlib
import socket
import subprocess
import sys
import tempfile

import numpy as np

BIN = pathlib.Path(sys.executable).parent
FIELDS = ("default", "points", "normal", "pair")


def same_bits(a, b):
    for name in a.columns:
        assert a.columns[name].tobytes() == b.columns[name].tobytes(), f"{name} differs"


ROBOT = """<robot name="crane">
  <link name="base"/>
  <link name="hook"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <joint name="turn" type="revolute">
    <parent link="base"/><child link="hook"/><origin xyz="0 0 1" rpy="0 0 0"/>
    <axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="1" velocity="1"/>
  </joint>
</robot>
"""


def free_tcp_port():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        return taken.getsockname()[1]


def start_daemon(program, scene, folder):
    read, write = os.pipe()
    daemon = subprocess.Popen(
        [program, "--scene", scene, "--log-level", "warn", "--ready-fd", str(write),
         "--shm", f"{folder}/clearance.sock", "--zmq", f"ipc://{folder}/clearance.ipc",
         "--zmq", f"tcp://127.0.0.1:{free_tcp_port()}"],
        pass_fds=[write],
    )  # fmt: skip
    os.close(write)
    with os.fdopen(read) as ready:
        urls = ready.read().split()
    assert [url.split(":")[0] for url in urls] == ["shm", "ipc", "tcp"], urls  # TCP by way of a gateway process
    return daemon, urls


def check_robot(folder):
    """Poses of a robot's links for given joints, from the command line."""
    urdf = pathlib.Path(folder) / "crane.urdf"
    urdf.write_text(ROBOT)
    robot = [BIN / "clearance", "robot"]
    assert "2 links, 1 joints, 1 positions" in subprocess.check_output([*robot, "inspect", urdf], text=True)
    links = json.loads(subprocess.check_output([*robot, "fk", urdf, "--set", f"turn={np.pi / 2}", "--json"], text=True))
    (hook,) = [link for link in links if link["link"] == "hook"]
    assert hook["z"] == 1 and abs(hook["qz"] - np.sqrt(0.5)) < 1e-12 and 0 <= hook["error"] < 1e-12, hook


def check_view():
    """The only Python command reports its requirements, which are not part of the wheel."""
    done = subprocess.run([BIN / "clearance", "view", "scene.yaml"], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (
        1,
        'clearance view: the page needs viser: pip install "WHEEL[view]", where WHEEL is the file clearance-*.whl\n',
    ), done


def nearest(clearance, url, poses):
    with clearance.connect(url, timeout_s=60) as client:
        client.set_poses(poses)
        return client.distances(reduce="nearest", fields=FIELDS)


def some_poses(bodies):
    rng = np.random.default_rng(5)
    return {b.name: [*rng.uniform(-1, 1, 3), 1, 0, 0, 0] for b in bodies if not b.is_static}


def check_whole(clearance, scene):
    """The demo's queries: each body's nearest neighbour, in this process and through both transports."""
    engine = clearance.Engine(clearance.Scene.load(scene))  # its meshes are read by the wheel's own loader
    assert len(engine.bodies) == 19
    poses = some_poses(engine.bodies)
    engine.set_poses(poses)
    here = engine.distances(reduce="nearest", fields=FIELDS)
    assert (here.status <= clearance.Status.CONTACT).all() and np.isfinite(here.lower).all()
    with tempfile.TemporaryDirectory() as folder:
        daemon, urls = start_daemon(BIN / "clearanced", scene, folder)
        for url in urls:
            same_bits(nearest(clearance, url, poses), here)
        for arguments in (
            ["query", "--connect", urls[0], "--reduce", "min"],
            ["inspect", scene],
            ["selftest"],
            ["--version"],
        ):
            done = subprocess.run([BIN / "clearance", *arguments], capture_output=True, text=True)
            assert done.returncode == 0 and done.stdout, (arguments, done)
        assert done.stdout.split() == ["clearance", clearance.__version__]
        assert subprocess.check_output([sys.executable, "-m", "clearance", "--version"], text=True) == done.stdout
        check_robot(folder)
        check_view()
        daemon.terminate()
        assert daemon.wait(60) == 0


def check_answers_of(clearance, program, scene):
    """The same for a client alone, with a daemon from elsewhere."""
    with tempfile.TemporaryDirectory() as folder:
        daemon, urls = start_daemon(program, scene, folder)
        with clearance.connect(urls[0], timeout_s=60) as client:
            poses = some_poses(client.bodies)
        assert len(poses) == 19
        answers = [nearest(clearance, url, poses) for url in urls]
        assert (answers[0].status <= clearance.Status.CONTACT).all() and np.isfinite(answers[0].lower).all()
        for answer in answers[1:]:
            same_bits(answer, answers[0])
        daemon.terminate()
        assert daemon.wait(60) == 0


def check_rejections(clearance, folder):
    """Without a daemon: errors name their cause, and missing programs are reported by name."""
    for url, why in (
        (f"ipc://{folder}/none", "no such socket"),
        (f"shm://{folder}/none", "no socket"),
        ("udpm://239.255.76.67:7667?ttl=0", "does not support LCM"),
    ):
        try:
            clearance.connect(url, timeout_s=1)
        except clearance.ConnectionError as error:
            assert why in str(error), error
        else:
            raise AssertionError(f"{url}: connected to nobody")
    try:
        clearance.Engine
    except ImportError as error:
        assert "client-only" in str(error), error
    else:
        raise AssertionError("a client alone has an engine")


def main():
    name, scenes, *program = sys.argv[1:]
    clearance = importlib.import_module(name.replace("-", "_"))
    assert clearance.__version__ == importlib.metadata.version(name)
    assert (pathlib.Path(clearance.__file__).parent / "py.typed").exists()
    exec(f"from {clearance.__name__} import *", star := {})
    assert set(clearance.__all__) <= set(star) and ("Engine" in star) == (name == "clearance"), sorted(star)
    os.environ["CLEARANCE_CACHE"] = "off"
    scene = pathlib.Path(scenes) / "nineteen" / "scene.yaml"
    if name == "clearance":
        check_whole(clearance, scene)
        return
    with tempfile.TemporaryDirectory() as folder:
        check_rejections(clearance, folder)
    if program:
        check_answers_of(clearance, program[0], scene)


main()
