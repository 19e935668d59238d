"""The example's safety index behind a fake of SPARK's interface: its rows predict how phi changes."""

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "client/examples"))

from spark_safety_index import ClearanceSafetyIndex  # noqa: E402

LINKS, OBSTACLES = ["arm/fore", "arm/palm", "arm/flange"], ["cup"]


class RobotConfig:
    """Of SPARK: velocities as controls (order 1), or accelerations (order 2)."""

    def __init__(self, joints, order):
        self.DoFs = self.Control = range(joints)
        self.num_dof, self.order, self.num_state = joints, order, joints * order

    def decompose_state_to_dof_pos(self, state):
        return np.reshape(state, -1)[: self.num_dof]

    def decompose_state_to_dof_vel(self, state):
        return np.reshape(state, -1)[self.num_dof :] if self.order == 2 else np.zeros(self.num_dof)

    def dynamics_f(self, state):
        f = np.zeros((self.num_state, 1))
        if self.order == 2:
            f[: self.num_dof] = np.reshape(state, (-1, 1))[self.num_dof :]
            f[self.num_dof :] = -0.3 * np.reshape(state, (-1, 1))[self.num_dof :]  # friction
        return f

    def dynamics_g(self, state):
        return np.eye(self.num_state)[:, -self.num_dof :]

    def step(self, state, u, seconds):
        """The state after some seconds at constant acceleration, or velocity."""
        slope = self.dynamics_f(state).reshape(-1) + self.dynamics_g(state) @ u
        after = state + seconds * slope
        if self.order == 2:
            after[: self.num_dof] += 0.5 * seconds**2 * slope[self.num_dof :]
        return after


def task_at(seconds):
    frame = np.eye(4)
    velocity = np.array([0.1, -0.2, 0.05, 0.0, 0.0, 0.3])
    frame[:3, 3] = np.array([0.5, 0.4, 0.9]) + seconds * velocity[:3]
    return {"obstacle": {"num": 1, "frames_world": [frame], "velocity": [velocity]}, "robot_base_frame": np.eye(4)}


@pytest.mark.parametrize("order", [1, 2])
def test_phi_changes_as_its_rows_say(arm_engine, order):
    joints = len(arm_engine.joints("arm"))
    cfg = RobotConfig(joints, order)
    index = ClearanceSafetyIndex(
        SimpleNamespace(robot_cfg=cfg), arm_engine, "arm", LINKS, OBSTACLES, {"environment": 0.1, "self": 0.0},
        phi_n=2.0, phi_k=0.0 if order == 1 else 0.5,
    )  # fmt: skip
    assert index.num_constraint == len(LINKS) == index.phi_mask.sum()
    rng, checked = np.random.default_rng(order), 0
    for _ in range(40):
        x = rng.uniform(-0.6, 0.6, cfg.num_state)
        u = rng.uniform(-1, 1, joints)
        phi, Lg, Lf, phi0, _ = index.phi(x, task_at(0.0))
        assert Lg.shape == (len(LINKS), joints) and Lf.shape == (len(LINKS), 1)
        predicted = Lg @ u + Lf[:, 0]
        h = 1e-4
        after = index.phi(cfg.step(x, u, h), task_at(h))[0]
        before = index.phi(cfg.step(x, u, -h), task_at(-h))[0]
        smooth = phi0 < 0.099  # apart
        near = np.isclose((after - before) / (2 * h), predicted, rtol=1e-3, atol=1e-4)
        checked += int((near & smooth).sum())
        if order == 1:
            assert phi == pytest.approx(phi0)
    assert checked >= 0.85 * 40 * len(LINKS), "all but those that change their features meanwhile"
    decoded = index.decode_constraint_info(phi, "phi_safe")
    assert decoded["phi_safe_mat_env"].shape == (len(LINKS), 1)
    assert decoded["phi_safe_mat_self"].shape == (len(LINKS), len(LINKS))


def test_a_pair_without_derivatives_is_an_error(arm_engine):
    joints = len(arm_engine.joints("arm"))
    index = ClearanceSafetyIndex(
        SimpleNamespace(robot_cfg=RobotConfig(joints, 2)), arm_engine, "arm", LINKS, OBSTACLES, {"environment": 0.1},
        phi_k=0.5,
    )  # fmt: skip
    task, x = task_at(0.0), np.zeros(2 * joints)
    right = index.rows.run
    for column in ("gradient_joints", "rate", "curvature"):

        def spoiled(*inputs, column=column):
            r = right(*inputs)
            columns = {name: np.array(getattr(r, name)) for name in ("lower", "gradient_joints", "rate", "curvature")}
            columns[column][0, 2] = np.nan
            return SimpleNamespace(**columns)

        index.rows = SimpleNamespace(run=spoiled)
        with pytest.raises(RuntimeError, match=f"arm/flange and cup have no {column}"):
            index.phi(x, task)
    index.rows = SimpleNamespace(run=right)
    assert np.isfinite(index.phi(x, task)[2]).all()
    arm_engine.set_joints(x[:joints], joints="arm")
    palm = arm_engine.body_states()[arm_engine.body_id("arm/palm")].pose
    task["obstacle"]["frames_world"][0][:3, 3] = palm[:3]
    with pytest.raises(RuntimeError, match="arm/palm and cup have no curvature: they overlap"):
        index.phi(x, task)


def test_a_safe_control_keeps_the_index_from_rising(arm_engine):
    joints = len(arm_engine.joints("arm"))
    cfg = RobotConfig(joints, 1)
    index = ClearanceSafetyIndex(
        SimpleNamespace(robot_cfg=cfg), arm_engine, "arm", LINKS, OBSTACLES, {"environment": 0.4}, phi_k=0.0
    )
    x = np.zeros(joints)
    eta, risen = 0.2, 0
    for _ in range(20):  # the least control for the worst row, as SSA's QP with one row
        phi, Lg, Lf, _, _ = index.phi(x, task_at(0.0))
        worst = int(np.argmax(phi))
        row, drift = Lg[worst], float(Lf[worst, 0])
        u = -row * max(drift + eta, 0.0) / max(row @ row, 1e-9)
        after = index.phi(cfg.step(x, u, 1e-3), task_at(1e-3))[0]
        risen += after[worst] > phi[worst] - 0.5 * eta * 1e-3
        x = x + 0.05 * u
    assert risen <= 1
    with pytest.raises(ValueError, match="expected 1 obstacles, got 2"):
        index.phi(x, {"obstacle": {**task_at(0.0)["obstacle"], "num": 2}})
