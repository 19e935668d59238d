"""try_arm.py PROGRAMS ROOT SCENE: a daemon and a command line for 64-bit ARM in qemu, compared with this engine.

PROGRAMS: the folder with clearanced, clearance and clearance-mesh-loader for ARM. ROOT: the root with their libraries.
SCENE: a scene file. The package clearance of this machine's processor must be importable.

The daemon reads the scene's meshes with its own loader. It is queried by its own command line over shared memory,
ZeroMQ and LCM, and by this machine's client over ZeroMQ, which also moves bodies. Every answer must have the same bits
as this machine's engine.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools"))

import clearance
from processes import Stage
from service import start_daemon

FIELDS = ("default", "points", "pair")
COLUMNS = {"lower_m": ("lower",), "upper_m": ("upper",)}
COLUMNS |= {
    axis + name: (column, i) for axis, column in (("a", "point_a"), ("b", "point_b")) for i, name in enumerate("xyz")
}


def same_bits(got, want, who):
    for name in want.columns:
        assert got.columns[name].tobytes() == want.columns[name].tobytes(), f"{who}: {name} differs"


def emulated(qemu, program, folder):
    """A script that the daemon can start instead of a program for ARM."""
    script = folder / program.name
    script.write_text(f'#!/bin/sh\nexec {" ".join(qemu)} {program} "$@"\n')
    script.chmod(0o755)
    return str(script)


def rows_of(qemu, programs, url):
    """Output of the command line for ARM: a dictionary for each pair, with all bits of the numbers."""
    command = [*qemu, programs / "clearance", "query", "--connect", url, "--timeout", "120", "--json"]
    command += ["--fields", "lower", "upper", "points"]
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    assert done.returncode == 0, (url, done.stderr)
    return json.loads(done.stdout)


def check_rows(rows, want, names, url):
    assert len(rows) == want.lower.size, (url, len(rows))
    pairs = {(row["a"], row["b"]): row for row in rows}
    for i, (a, b) in enumerate(want.pairs):
        row = pairs[names[a], names[b]]
        for key, (column, *axis) in COLUMNS.items():
            expected = want.columns[column].reshape(len(rows), -1)[i, axis[0] if axis else 0]
            assert np.float64(row[key]).tobytes() == np.float64(expected).tobytes(), (url, names[a], names[b], key)


def main():
    programs, root, scene = (Path(argument).resolve() for argument in sys.argv[1:])
    os.environ["CLEARANCE_CACHE"] = "off"
    engine = clearance.Engine(clearance.Scene.load(scene))  # of this machine's processor, with its own mesh loader
    names = [body.name for body in engine.bodies]
    rng = np.random.default_rng(18)
    with Stage() as stage:
        qemu = ["qemu-aarch64-static", "-L", str(root)]
        os.environ["CLEARANCE_MESH_LOADER"] = emulated(qemu, programs / "clearance-mesh-loader", stage.folder)
        daemon, urls, _ = start_daemon(stage, scene, qemu, program=programs / "clearanced", seconds=300)
        assert set(urls) == {"shm", "zmq", "lcm"}, f"without multicast there is no LCM: {urls}"
        with clearance.connect(urls["zmq"], timeout_s=120) as client:
            for turn in range(3):
                poses = {}
                for body in engine.bodies if turn else ():  # the first turn uses the poses of the scene
                    quaternion = rng.normal(size=4)
                    poses[body.name] = [*rng.uniform(-1, 1, 3), *(quaternion / np.linalg.norm(quaternion))]
                engine.set_poses(poses)
                client.set_poses(poses)
                want = engine.distances(fields=FIELDS)
                same_bits(client.distances(fields=FIELDS), want, "this machine's client")
                same_bits(
                    client.distances(fields=FIELDS, signed_distance=True),
                    engine.distances(fields=FIELDS, signed_distance=True),
                    "depths",
                )
                for url in urls.values():
                    check_rows(rows_of(qemu, programs, url), want, names, url)
        daemon.terminate()
        assert daemon.wait(60) == 0, stage.log("clearanced")
    print(f"ARM: {len(want.pairs)} pairs, 3 times, over {', '.join(urls)}: the bits of {os.uname().machine}")


main()
