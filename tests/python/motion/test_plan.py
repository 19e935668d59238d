"""plan() of an engine and a client: paths that are proved free, and the reasons why there are none."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import clearance
from conftest import Daemon
from patience import PATIENCE_S

CELL = Path(__file__).resolve().parents[3] / "scenes/cell/robot.yaml"
MARGIN = 0.02


@pytest.fixture(scope="module", params=["engine", "shm"])
def engine(request, tmp_path_factory):
    made: Any
    daemon = None
    if request.param == "engine":
        made = clearance.Engine(clearance.Scene.load(CELL), threads=1)
    else:
        daemon = Daemon(tmp_path_factory.mktemp("plan"), CELL, [request.param])
        made = clearance.connect(daemon.urls[request.param], timeout_s=PATIENCE_S)
    made.allow("arm/wrist_1", "arm/flange")  # never farther apart than 18 mm
    yield made
    assert daemon is None or daemon.stop() == 0, daemon.log()


@pytest.fixture(scope="module")
def joints(engine):
    return [name for name in engine.joints("arm").names if name != "arm/grip"]


@pytest.fixture(scope="module")
def start(engine, joints):
    return np.array([state.position for state in engine.joint_states() if state.name in joints])


def turned(start, angle):
    return np.r_[angle, start[1:]]


@pytest.mark.parametrize("seed", range(5))
def test_every_motion_is_proved_free(engine, joints, start, seed):
    goal = turned(start, 1.5)
    assert not engine.check_path([start, goal], joints=joints, margin=MARGIN)
    plan = engine.plan(start, goal, joints, margin=MARGIN, seed=seed)
    assert plan and plan.reason == "" and plan.iterations > 0 and plan.motions >= len(plan.path) - 1
    assert (plan.path[0] == start).all() and (plan.path[-1] == goal).all()
    assert engine.check_path(plan.path, joints=joints, margin=MARGIN).ok
    least = engine.motions(plan.path[:-1], plan.path[1:], joints=joints, reduce="min")
    assert plan.clearance == (least.lower.min(), least.upper.min())
    assert MARGIN < plan.clearance[1]
    again = engine.plan(start, goal, joints, margin=MARGIN, seed=seed, clearance=False)
    assert (again.path == plan.path).all() and again.clearance is None


def test_a_certificate_proves_every_motion(engine, joints, start):
    plan = engine.plan(start, turned(start, 1.5), joints, margin=MARGIN, certificate=True)
    rows = plan.certificate.document["rows"]
    assert len(rows) == len(plan.path) - 1 and all(row["proved"] for row in rows)


def test_a_failure_says_why(engine, joints, start):
    blocked = engine.plan(start, turned(start, 0.75), joints, margin=MARGIN)
    assert not blocked and blocked.path is None
    assert blocked.reason == "the goal is not free: the pair cup, shelf is within its margin"
    assert blocked.check.free.tolist() == [True, False]
    assert "the start is not free" in engine.plan(turned(start, 0.75), start, joints, margin=MARGIN).reason
    with pytest.warns(clearance.JointLimitWarning):
        beyond = engine.plan(start, turned(start, 9), joints, margin=MARGIN)
    assert beyond.reason.startswith("the goal is beyond the limits of a joint: arm/turn at 9")
    few = engine.plan(start, turned(start, 1.5), joints, margin=MARGIN, max_iterations=1)
    assert few.reason.startswith("no path after 1 iterations") and few.iterations == 1


@pytest.mark.parametrize(
    "change, text",
    [
        ({"goal": [1.0]}, r"goal: expected shape \(6,\), one number for each joint, got \(1,\)"),
        ({"goal": [np.nan] * 6}, "goal: expected finite numbers"),
        ({"range": 0}, "range: expected a number above 0"),
        ({"max_iterations": -1}, "max_iterations"),
        ({"joints": ["arm/no"]}, "joints"),
    ],
)
def test_bad_arguments_are_named(engine, joints, start, change, text):
    arguments = {"start": start, "goal": start, "joints": joints, **change}
    with pytest.raises(ValueError, match=text):
        engine.plan(**arguments)


def test_a_changed_scene_is_planned_in(engine, joints, start):
    goal = turned(start, 1.5)
    engine.add_body("box", box=[0.1, 0.1, 0.1], pose=[0.6, 0.6, 0.2, 1, 0, 0, 0], static=True)
    try:
        plan = engine.plan(start, goal, joints, margin=MARGIN)
        assert plan and engine.check_path(plan.path, joints=joints, margin=MARGIN).ok
    finally:
        engine.remove_body("box")
