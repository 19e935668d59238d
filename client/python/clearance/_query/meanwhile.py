"""Bodies that move, or grow, while joints move along a path."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Optional, Union

import numpy as np

from .._arguments import to_floats, to_number_from_0
from .._poses import as_pose7


class BodyPath:
    """How a body moves while joints move: a value of `meanwhile` in check_path() and motions()."""

    poses: np.ndarray  #: (P, 7) at `times`, or (K, D + 1, 7) Bezier control poses of each segment of the path
    times: Optional[np.ndarray]  #: (P,) seconds of the path; None for its beginning and end, or its waypoints
    radius: float  #: metres by which the body is grown at the path's beginning
    growth: float  #: metres per second by which it grows

    def __init__(self, poses: Any, times: Any = None, radius: float = 0.0, growth: float = 0.0):
        """The body moves straight from pose to pose and turns the shorter way; before and after `times` it stays.

        Seconds are those of a Trajectory. Other paths take a second for each motion, and in motions() each begins at 0.

        poses: one pose of a body that stays; or (P, 7) or (P, 4, 4); or (K, D + 1, 7) Bezier control poses.
        times: (P,) seconds, ascending; those between must be times at which segments of the path begin. By default,
            two poses are those at the beginning and the end of the path, and more are those at its waypoints.
        radius, growth: a ball around each point of the body, in metres, and by how much it grows in a second, such as
            the speed of a person.
        """
        given = as_pose7(poses, "poses")
        self.poses = given[None] if given.ndim == 1 else given
        if self.poses.ndim not in (2, 3) or 0 in self.poses.shape:
            raise ValueError(f"poses: expected shape (P, 7) or (K, D + 1, 7), got {given.shape}")
        self.times = None if times is None else to_floats(times, "times", "(P,) seconds")
        if self.times is not None and (self.poses.ndim == 3 or self.times.shape != self.poses.shape[:1]):
            raise ValueError(f"times: expected one for each of (P, 7) poses, got shape {self.times.shape}")
        if self.times is not None and not (np.diff(self.times) > 0).all():
            raise ValueError("times: expected them to ascend")
        self.radius = to_number_from_0(radius, "radius")
        self.growth = to_number_from_0(growth, "growth")

    @property
    def grows(self) -> bool:
        return self.radius > 0 or self.growth > 0

    def controls(self, knots: np.ndarray, points: int, what: str) -> np.ndarray:
        """Returns (K, points, 7) control poses of the segments between knots, in seconds. Each is rounded."""
        count = len(knots) - 1
        if self.poses.ndim == 3:
            if self.poses.shape[:2] != (count, points):
                raise ValueError(f"{what}: expected ({count}, {points}, 7) control poses, got {self.poses.shape}")
            return self.poses
        times = self._times(knots, what)
        at = np.array([self._at(times, t) for t in knots])
        if points == 2:
            return np.stack((at[:-1], at[1:]), axis=1)
        if not (self.poses[:, 3:] == self.poses[0, 3:]).all():
            raise ValueError(f"{what}: expected one rotation, since bodies do not turn along curves")
        controls = np.repeat(at[:-1, None], points, axis=1)
        share = np.linspace(0.0, 1.0, points)[:, None]
        controls[:, :, :3] += share * (at[1:] - at[:-1])[:, None, :3]
        return controls

    def of_segment(self, index: int, count: int, what: str) -> BodyPath:
        """Returns the path in one of `count` segments; only control poses differ."""
        if self.poses.ndim == 2:
            return self
        if len(self.poses) != count:
            raise ValueError(f"{what}: expected control poses for each of {count} motions, got {self.poses.shape}")
        return BodyPath(self.poses[index : index + 1], None, self.radius, self.growth)

    def growths(self, knots: np.ndarray, points: int) -> np.ndarray:
        """Returns (K, points) metres, likewise."""
        at = self.radius + self.growth * (knots - knots[0])
        return at[:-1, None] + np.linspace(0.0, 1.0, points) * (at[1:] - at[:-1])[:, None]

    def _times(self, knots: np.ndarray, what: str) -> np.ndarray:
        if self.times is None:
            if len(self.poses) > 2 and len(self.poses) != len(knots):
                raise ValueError(f"{what}: expected times, or a pose at each of {len(knots)} waypoints")
            return knots if len(self.poses) == len(knots) else knots[[0, -1]][: len(self.poses)]
        for t in self.times:
            if knots[0] < t < knots[-1] and not (knots == t).any():
                raise ValueError(f"{what}: changes its course at {t:g} s, within a segment of the path; split it there")
        return self.times

    def _at(self, times: np.ndarray, t: float) -> np.ndarray:
        """Returns the pose at a time, as a body moves between two poses."""
        i = int(np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(times) - 1))
        start = self.poses[i]
        if t <= times[i] or i + 1 == len(times):
            return start
        end = self.poses[i + 1]
        return pose_between(np.stack((start, end)), (t - times[i]) / (times[i + 1] - times[i]))


#: Poses or a BodyPath by body.
Meanwhile = Optional[Mapping[Union[str, int], Union[BodyPath, np.ndarray, Sequence[Any]]]]


def to_body_paths(meanwhile: Any) -> dict[Any, BodyPath]:
    """Converts the argument `meanwhile`."""
    if not isinstance(meanwhile, Mapping) or not meanwhile:
        raise TypeError(f"meanwhile: expected a dict of poses or a BodyPath by body, got {meanwhile!r}")
    return {
        body: value if isinstance(value, BodyPath) else BodyPath(as_pose7(value, f"meanwhile[{body!r}]"))
        for body, value in meanwhile.items()
    }


def meanwhile_of(
    paths: Mapping[Any, BodyPath], knots: np.ndarray, points: int
) -> tuple[np.ndarray, Optional[np.ndarray]]:
    """Returns (K, points, M, 7) control poses and (K, points, M) growths, None if no body grows."""
    controls = [path.controls(knots, points, f"meanwhile[{body!r}]") for body, path in paths.items()]
    poses = np.ascontiguousarray(np.stack(controls, axis=2))
    if not any(path.grows for path in paths.values()):
        return poses, None
    return poses, np.ascontiguousarray(np.stack([p.growths(knots, points) for p in paths.values()], axis=2))


def meanwhile_of_each(
    paths: Mapping[Any, BodyPath], count: int, points: int
) -> tuple[np.ndarray, Optional[np.ndarray]]:
    """Returns the same for `count` motions, each from 0 to 1 s: only control poses differ."""
    knots, differ = np.array([0.0, 1.0]), any(path.poses.ndim == 3 for path in paths.values())
    each = []
    for k in range(count if differ else 1):
        segments = {body: path.of_segment(k, count, f"meanwhile[{body!r}]") for body, path in paths.items()}
        each.append(meanwhile_of(segments, knots, points))
    repeats = 1 if differ else count
    poses = np.concatenate([row[0] for row in each] * repeats)
    growths = [row[1] for row in each if row[1] is not None]
    return poses, np.concatenate(growths * repeats) if growths else None


def pose_between(controls: np.ndarray, t: float) -> np.ndarray:
    """Returns the pose at a time, 0 to 1, of a body with (D + 1, 7) control poses, rounded."""
    points = controls[:, :3]
    while len(points) > 1:
        points = points[:-1] + t * (points[1:] - points[:-1])
    return np.concatenate((points[0], _between(controls[0, 3:], controls[-1, 3:], t)))


def _between(a: np.ndarray, b: np.ndarray, share: float) -> np.ndarray:
    """Returns the quaternion at a share of the shorter way from a to b."""
    if (a == b).all():
        return a
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    cosine = float(a @ b)
    if cosine < 0:
        b, cosine = -b, -cosine
    angle = math.acos(min(cosine, 1.0))
    if angle < 1e-8:
        return a + share * (b - a)
    return (math.sin((1 - share) * angle) * a + math.sin(share * angle) * b) / math.sin(angle)
