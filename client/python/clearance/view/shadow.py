"""Poses of links for hypothetical joint positions, which a daemon uses in queries but does not return.

An Engine of the same scene in this process copies the daemon's bodies and joints, and then moves the joints. It
provides only the poses of the picture: all numbers on the page are the daemon's.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Optional

import numpy as np

from .._front.engine import Engine
from .._front.front import BodyState, Front
from .._names import BodyInfo
from .._scene.scene import Scene
from .._words import Status
from .model import WhatIf


class Shadow:
    """Poses of all bodies for hypothetical joint positions."""

    def __init__(self, scene: Scene):
        self._engine = Engine(scene, threads=1)
        self._parents: dict[int, Optional[int]] = {body.id: body.parent for body in self._engine.bodies}

    def fits(self, front: Front) -> bool:
        """Whether the scene has the bodies of `front`, with the same ids, and its joints."""
        mine, others = ([body.name for body in each.bodies] for each in (self._engine, front))
        return mine == others and [s.name for s in front.joint_states()] == [
            s.name for s in self._engine.joint_states()
        ]

    def poses(self, front: Front, what_if: WhatIf) -> np.ndarray:
        """Returns (N, 7) X_wb with the joint positions of `what_if`, otherwise with the state of `front`."""
        bodies, states = front.bodies, front.body_states()  # type: ignore[attr-defined]
        joints = {s.name: s.position for s in front.joint_states() if s.status == Status.OK}
        joints.update(zip(what_if.joints.names, what_if.positions.tolist()))
        robots = {name.partition("/")[0] for name in joints}
        for body in bodies:
            if not body.is_static and body.name.partition("/")[0] not in robots:
                self._follow(body, states)
        self._engine.set_poses(
            {
                body.id: _within(states, body)
                for body in bodies
                if not body.is_static and "/" not in body.name and states[body.id].status == Status.OK
            }
        )
        self._engine.set_joints(joints)
        return np.array([state.pose for state in self._engine.body_states()])

    def _follow(self, body: BodyInfo, states: Sequence[BodyState]) -> None:
        """Attaches the engine's body to the parent of the daemon's body."""
        parent = states[body.id].parent
        if self._parents[body.id] != parent and states[body.id].status == Status.OK:
            self._engine.attach(body.id, parent, pose=_within(states, body))
            self._parents[body.id] = parent


def _within(states: Sequence[BodyState], body: BodyInfo) -> np.ndarray:
    """Returns (7,) X_parent_body for a body with a parent, otherwise X_wb."""
    state = states[body.id]
    if state.parent is None:
        return state.pose
    base = states[state.parent].pose
    turn = base[3:] / np.linalg.norm(base[3:]) * [1, -1, -1, -1]
    return np.concatenate([rotated(turn, state.pose[:3] - base[:3]), product(turn, state.pose[3:])])


def product(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Returns the quaternion p q, scalar first."""
    w = p[0] * q[0] - p[1:] @ q[1:]
    return np.concatenate([[w], p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])])


def rotated(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Returns (3,) v rotated by the unit quaternion q."""
    twice = 2 * np.cross(q[1:], v)
    return v + q[0] * twice + np.cross(q[1:], twice)
