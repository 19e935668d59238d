"""Positions beyond the limits of their joints, which distances do not depend on."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Optional

import numpy as np

from .._errors import JointLimitWarning, warn
from .._joints import Joints


@dataclass(frozen=True)
class LimitViolation:
    """A joint beyond its limits. Radians or metres."""

    configuration: int  #: row of the positions, waypoint of a path, or segment of a trajectory
    joint: str
    position: float
    lower: float  #: -inf without a limit
    upper: float  #: +inf without a limit

    @property
    def excess(self) -> float:
        """Distance beyond the limit, above 0."""
        return max(self.lower - self.position, self.position - self.upper)

    def __str__(self) -> str:
        limits = f"{self.lower:g} to {self.upper:g}"
        return f"{self.joint} at {self.position:g} is {self.excess:g} beyond its limits, {limits}"


class Beyond:
    """The positions beyond joint limits among some configurations, at least one."""

    def __init__(self, rows: np.ndarray, mask: np.ndarray, joints: Joints):
        self.configurations: np.ndarray = np.any(mask, axis=1)  #: (K,) bool
        self._rows = rows.copy()
        self._mask = mask
        self._joints = joints

    def violations(self) -> tuple[LimitViolation, ...]:
        """Returns all violations in the order of configurations."""
        return tuple(self._violation(int(k), int(j)) for k, j in np.argwhere(self._mask))

    def first(self) -> LimitViolation:
        k = int(self.configurations.argmax())
        return self._violation(k, int(self._mask[k].argmax()))

    def first_of_each_joint(self) -> tuple[LimitViolation, ...]:
        """Returns the first violation of each joint, in the order of joints."""
        joints = np.flatnonzero(self._mask.any(axis=0))
        return tuple(self._violation(int(self._mask[:, j].argmax()), int(j)) for j in joints)

    def _violation(self, k: int, j: int) -> LimitViolation:
        joints = self._joints
        limits = float(joints.lower[j]), float(joints.upper[j])
        return LimitViolation(k, joints.names[j], float(self._rows[k, j]), *limits)

    def look_like_degrees(self) -> bool:
        """Whether a position exceeds a full turn, and most configurations would be within limits as degrees."""
        rows, mask = self._rows[self.configurations], self._mask[self.configurations]
        if not (np.abs(rows) > 2 * math.pi)[mask].any():
            return False
        radians = np.radians(rows)
        within = (radians >= self._joints.lower) & (radians <= self._joints.upper)
        return bool(2 * np.count_nonzero((within | ~mask).all(axis=1)) > len(rows))


def beyond_limits(rows: np.ndarray, joints: Joints, what: str) -> Optional[Beyond]:
    """Returns the violations among (K, J) positions, or None. NaN is an invalid position, not a violation.

    Warns of positions that look like degrees.
    """
    mask = (rows < joints.lower) | (rows > joints.upper)
    if not mask.any():
        return None
    beyond = Beyond(rows, mask, joints)
    if beyond.look_like_degrees():
        text = f"{what}: {beyond.first()}; in degrees they would be within: positions are in radians"
        warn(text, JointLimitWarning)
    return beyond


_MOST_HALVINGS = 14  # of a curve near a limit


def curves_beyond_limits(points: np.ndarray, joints: Joints) -> tuple[LimitViolation, ...]:
    """Returns the first violation of each joint among (K, D + 1, J) Bezier control points, in the order of joints.

    A curve is within limits if its control points are, at some level of subdivision. Exact apart from rounding.
    """
    mask = np.any((points < joints.lower) | (points > joints.upper), axis=1)
    violations = []
    for j in np.flatnonzero(mask.any(axis=0)).tolist():
        limits = float(joints.lower[j]), float(joints.upper[j])
        for k in np.flatnonzero(mask[:, j]).tolist():
            position = _beyond(points[k, :, j], *limits, _MOST_HALVINGS)
            if position is not None:
                violations.append(LimitViolation(k, joints.names[j], position, *limits))
                break
    return tuple(violations)


def _beyond(points: np.ndarray, lower: float, upper: float, halvings: int) -> Optional[float]:
    """Returns a position of a curve that is not shown to be within limits, or None."""
    outside = (points < lower) | (points > upper)
    if not outside.any():
        return None
    if outside[0] or outside[-1]:
        return float(points[0] if outside[0] else points[-1])
    if halvings == 0:
        return float(points[outside.argmax()])
    before, after = [points[0]], [points[-1]]
    while len(points) > 1:
        points = points[:-1] + 0.5 * (points[1:] - points[:-1])
        before.append(points[0])
        after.append(points[-1])
    found = _beyond(np.array(before), lower, upper, halvings - 1)
    return _beyond(np.array(after[::-1]), lower, upper, halvings - 1) if found is None else found
