"""Clouds that bodies on a link carry: their covers, or empty clouds without one, must not disturb those of others."""

from pathlib import Path

import numpy as np
import pytest

import clearance

CELL = Path(__file__).resolve().parents[3] / "scenes/cell/robot.yaml"


@pytest.mark.parametrize("count", [100, 0])
def test_motions_of_an_arm_with_a_camera(count):
    scene = clearance.Scene.load(CELL)
    scene.add_box("camera", [0.05, 0.05, 0.05], parent="arm/forearm", pose=[0, 0, 0.3, 1, 0, 0, 0])
    cloud = np.random.default_rng(3).random((count, 3)) * 0.1
    scene.add_points("seen", cloud, radius=0.01, parent="camera", pose=[0.2, 0, 0, 1, 0, 0, 0])
    engine = clearance.Engine(scene, threads=1)
    assert engine.wait_covers(60)
    joints = engine.joints("arm")
    home = np.array([state.position for state in engine.joint_states() if state.name in joints.names])
    ends = home + np.random.default_rng(4).uniform(-0.5, 0.5, (64, len(joints)))
    pairs = [("shelf", "arm/forearm"), ("shelf", "camera")]
    start = np.tile(home, (64, 1))
    r = engine.motions(start, ends, joints=joints, pairs=pairs, reduce="any", fields="verdict")
    exact = engine.motions(start, ends, joints=joints, pairs=pairs, reduce="any", fields=["verdict", "steps"])
    assert (r.verdict == exact.verdict).all() and (r.verdict == clearance.Status.BEYOND).any()
