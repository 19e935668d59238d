"""The examples' own checks, without which they could claim anything."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import clearance
from patience import PATIENCE_S

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "client/examples"))

from drive import BRAKE, HOLD, Drive  # noqa: E402
from exact_arm import ExactArm  # noqa: E402

BUILD = Path(os.environ.get("CLEARANCE_BUILD", ROOT / "build"))
ARM = ROOT / "scenes/cell/arm.urdf"
HEIGHT = 0.75


@pytest.fixture(scope="module")
def engine():
    scene = clearance.Scene()
    scene.add_robot("arm", ARM, base=[0, 0, HEIGHT, 1, 0, 0, 0], static=True, home={})
    scene.add_sphere("ball", 0.06, pose=[0, 0, 0, 1, 0, 0, 0])
    scene.add_half_space("floor", pose=[0, 0, HEIGHT, 1, 0, 0, 0])
    return clearance.Engine(scene)


@pytest.fixture(scope="module")
def exact_value(engine):
    base = np.eye(4)
    base[2, 3] = HEIGHT
    return ExactArm(ARM, [name.split("/")[1] for name in engine.joints("arm").names], base)


@pytest.fixture(scope="module")
def positions(engine):
    arm = engine.joints("arm")
    rows = arm.lower + (arm.upper - arm.lower) * np.random.default_rng(1).random((300, len(arm)))
    rows[:, -1] = 0.0  # the oracle has no mimic joints: the fingers are closed
    return rows


def test_the_judge_of_balls_lies_in_every_interval(engine, exact_value, positions):
    places = np.random.default_rng(2).uniform([-1, -1, 0], [1, 1, 2], (300, 3))
    poses = np.zeros((300, 1, 7))
    poses[:, 0, :3], poses[:, 0, 3] = places, 1.0
    r = engine.distances(
        pairs=("arm", "ball"), configurations=(positions, poses), bodies=["ball"], joints="arm", reduce="min"
    )
    true = exact_value.to_points(positions, places[:, None])[:, 0] - 0.06
    apart = true > 1e-9
    assert 200 < apart.sum() < 300, "some overlap, most do not"
    assert (r.lower - 1e-12 <= true)[apart].all() and (true <= r.upper + 1e-12)[apart].all()
    assert (r.lower[~apart] <= 1e-9).all()


def test_the_judge_of_the_floor_lies_in_every_interval(engine, exact_value, positions):
    r = engine.distances(pairs=("arm", "floor"), joints="arm", configurations=positions)
    floor = engine.body_id("floor")
    links = [engine.bodies[a if b == floor else b].name.split("/")[1] for a, b in r.pairs]
    assert {"forearm", "gripper", "wrist_2"} <= set(links)
    for k, link in enumerate(links):
        true = exact_value.lowest(positions, [link]) - HEIGHT
        apart = true > 1e-9
        assert apart.any() and (r.lower[:, k] - 1e-12 <= true)[apart].all(), link
        assert (true <= r.upper[:, k] + 1e-12)[apart].all(), link


class Samples(list):
    def sample(self, t, q):
        self.append((t, q[0]))


def test_a_drive_without_a_new_command_stops():
    log, drive, stop = Samples(), Drive([0.0]), 2.0 / BRAKE
    drive.start(10.0)
    assert drive.advance(10.5, log)[0] == 0.0
    drive.command([2.0], 10.5, log)
    assert drive.advance(10.5 + HOLD, log)[0] == pytest.approx(2.0 * HOLD)
    drive.advance(11.5, log)
    assert drive.q[0] == pytest.approx(2.0 * (HOLD + stop / 2)), "as far as the margin counts with"
    late = [q for t, q in log if t > 10.5 + HOLD + stop]
    assert len(late) > 100 and np.ptp(late) < 1e-12, "and it stands still from then on"
    assert (np.diff([t for t, _ in log]) <= 1e-3 + 1e-9).all(), "where it was meanwhile is known to a millisecond"


@pytest.mark.parametrize(("language", "where"), [("python", "engine"), ("python", "shm"), ("c++", "shm")])
def test_a_planner_of_prepared_motions_finds_a_proved_path(start_daemon, kinds, language, where):
    program = [sys.executable, "client/examples/rrt.py"] if language == "python" else [str(BUILD / "examples/rrt")]
    scene = ROOT / "scenes/cell/robot.yaml"
    if where not in ("engine", *kinds):
        pytest.skip(f"no {where} here")
    place = scene if where == "engine" else start_daemon(scene, [where]).urls[where]
    done = subprocess.run([*program, place, "arm"], cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.returncode == 0, done.stdout + done.stderr
    assert int(done.stdout.split()[0]) > 2, done.stdout
    absent = subprocess.run([*program, place, "absent"], cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE_S)
    assert absent.returncode != 0 and "absent" in absent.stderr
