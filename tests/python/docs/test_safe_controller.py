"""The speeds that the example's controller commands with and without a proof of a stop."""

import importlib
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "client/examples"))

from drive import RELAXED, Drive, permitted  # noqa: E402

SPEEDS = np.array([0.5, -0.2])
AWAY, NEARER = [0.1, 0.0], [0.0, 0.1]  # metres per radian


@pytest.mark.parametrize("scale", [1.0, 0.5, 2.0**-8])
def test_a_proved_share_is_commanded(scale):
    assert np.array_equal(permitted(SPEEDS, scale, np.array([NEARER]), 1.0), scale * SPEEDS)


def test_without_a_proof_only_what_leads_away_is_commanded():
    assert np.array_equal(permitted(SPEEDS, 0.0, np.array([AWAY, AWAY]), 0.1 * RELAXED), SPEEDS)
    for slopes, given_up in (
        ([AWAY, NEARER], 0.0),
        ([AWAY], 2 * RELAXED),
        ([AWAY], np.nan),
        ([AWAY, [np.nan, np.nan]], 0.0),
        (np.empty((0, 2)), 0.0),
    ):
        assert not permitted(SPEEDS, 0.0, np.array(slopes), given_up).any(), (slopes, given_up)


@pytest.mark.parametrize("scale, slope, moves", [(0.5, NEARER, True), (0.0, NEARER, False), (0.0, AWAY, True)])
def test_a_tick_commands_them(monkeypatch, scale, slope, moves):
    pytest.importorskip("lcm")
    monkeypatch.setitem(sys.modules, "proxsuite", SimpleNamespace(proxqp=None))  # the QP's answer is given
    safe_controller = importlib.import_module("safe_controller")
    now, commands = time.monotonic() + 100.0, []  # never late
    near = SimpleNamespace(
        lower=np.array([0.1]), upper=np.array([0.1]), rate=np.zeros(1), pair=np.array([[0, 1]]),
        gradient_joints=np.array([[*slope, 0, 0, 0, 0]]), snapshot_stamp_ns=time.time_ns() + 10**11, pose_age_ns=0,
    )  # fmt: skip
    speeds = np.r_[SPEEDS, 0, 0, 0, 0]
    controller = object.__new__(safe_controller.Controller)
    controller.log = SimpleNamespace(tick=lambda *_: None, sample=lambda *_: None)
    controller.drive = Drive(safe_controller.HOME)
    controller.drive.start(now)
    controller.drive.command = lambda dq, *_: commands.append(dq)
    controller.balls, controller.margin = np.ones(2, bool), 0.05
    controller.query = SimpleNamespace(run=lambda *_: near)
    controller.safe = lambda *_: (speeds, 0.0)
    controller.stop = SimpleNamespace(run=lambda *_: SimpleNamespace(speed_scale=scale))
    controller.tick(now, now)
    assert np.array_equal(commands, [(scale or 1.0) * speeds * moves])
