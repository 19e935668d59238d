"""Trajectories as robots execute them: piecewise polynomials of joints, as Bezier curves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import comb
from typing import Any, Optional

import numpy as np

from .._arguments import to_floats, to_integer

MOST_POINTS = 8  #: control points of a segment
_UNIT = 2.0**-53


class Trajectory:
    """Segments in a row, each a polynomial of degree 1 to 7 in time. For motions() and check_path().

    The control points are the trajectory: proofs hold for them exactly. Constructors that convert other forms round
    each control point, and report a bound in `rounding`.
    """

    points: np.ndarray  #: (K, D + 1, J) Bezier control points, radians and metres
    times: np.ndarray  #: (K + 1,) seconds, at which segments begin and end
    joint_names: Optional[tuple[str, ...]]  #: of the J columns, if known
    rounding: np.ndarray  #: (J,) bound on the distance of the given trajectory, radians and metres

    def __init__(
        self,
        points: Any,
        times: Any = None,
        joint_names: Optional[Sequence[str]] = None,
        rounding: Any = 0.0,
    ):
        """points: (K, D + 1, J). times: (K + 1,) seconds, ascending. Default: a second for each segment."""
        self.points = np.ascontiguousarray(to_floats(points, "points", "(K, D + 1, J) control points"))
        if self.points.ndim != 3 or 0 in self.points.shape:
            raise ValueError(f"points: expected shape (K, D + 1, J), got {self.points.shape}")
        if not 2 <= self.points.shape[1] <= MOST_POINTS:
            raise ValueError(f"points: expected 2 to {MOST_POINTS} for each segment, got {self.points.shape[1]}")
        count, _, joints = self.points.shape
        self.times = np.arange(count + 1.0) if times is None else _times(times)
        if len(self.times) != count + 1:
            raise ValueError(f"times: expected {count + 1}, for {count} segments, got {len(self.times)}")
        self.joint_names = None if joint_names is None else tuple(joint_names)
        if self.joint_names is not None and len(self.joint_names) != joints:
            raise ValueError(f"joint_names: expected {joints}, got {len(self.joint_names)}")
        if self.joint_names is not None and len(set(self.joint_names)) != joints:
            raise ValueError(f"joint_names: expected each once, got {', '.join(self.joint_names)}")
        self.rounding = np.broadcast_to(np.asarray(rounding, dtype=np.float64), (joints,))

    @classmethod
    def from_bezier(cls, points: Any, times: Any = None, joint_names: Optional[Sequence[str]] = None) -> Trajectory:
        """Takes (K, D + 1, J) control points as they are."""
        return cls(points, times, joint_names)

    @classmethod
    def from_bspline(
        cls, points: Any, knots: Any, degree: int, joint_names: Optional[Sequence[str]] = None
    ) -> Trajectory:
        """Converts a B-spline by its blossoms.

        points: (M, J). knots: (M + degree + 1,) seconds, not descending. The trajectory lasts from knots[degree] to
            knots[M].
        """
        d = to_integer(degree, "degree")
        if not 1 <= d < MOST_POINTS:
            raise ValueError(f"degree: expected 1 to {MOST_POINTS - 1}, got {d}")
        rows, u = _rows(points, "points"), to_floats(knots, "knots", "(M + degree + 1,) seconds")
        if u.shape != (len(rows) + d + 1,) or not (np.diff(u) >= 0).all():
            raise ValueError(f"knots: expected {len(rows) + d + 1} that do not descend, got shape {u.shape}")
        spans = [k for k in range(d, len(rows)) if u[k] < u[k + 1]]
        if not spans:
            raise ValueError("knots: expected some time between knots[degree] and knots[M]")
        curves = [[_blossom(rows, u, k, d, i) for i in range(d + 1)] for k in spans]
        times = [u[k] for k in spans] + [u[spans[-1] + 1]]
        return cls(curves, times, joint_names, 8 * d * _UNIT * np.abs(rows).max(axis=0))

    @classmethod
    def linear(cls, times: Any, positions: Any, joint_names: Optional[Sequence[str]] = None) -> Trajectory:
        """Moves straight from each of (N, J) positions to the next. Exact."""
        rows = _rows(positions, "positions")
        return cls(np.stack((rows[:-1], rows[1:]), axis=1), times, joint_names)

    @classmethod
    def cubic(
        cls, times: Any, positions: Any, velocities: Any, joint_names: Optional[Sequence[str]] = None
    ) -> Trajectory:
        """Interpolates (N, J) positions and velocities at (N,) times by polynomials of degree 3."""
        t, (p, v) = _knots(times, positions=positions, velocities=velocities)
        h = np.diff(t)[:, None]
        step = v / 3
        points = np.stack((p[:-1], p[:-1] + h * step[:-1], p[1:] - h * step[1:], p[1:]), axis=1)
        return cls(points, t, joint_names, 8 * _UNIT * _size(p, np.abs(v).max(axis=0) * h.max()))

    @classmethod
    def quintic(
        cls,
        times: Any,
        positions: Any,
        velocities: Any = None,
        accelerations: Any = None,
        joint_names: Optional[Sequence[str]] = None,
    ) -> Trajectory:
        """Interpolates (N, J) positions, velocities and accelerations by polynomials of degree 5.

        velocities, accelerations: zero by default, at rest at each time.
        """
        zero = np.zeros_like(_rows(positions, "positions"))
        velocities = zero if velocities is None else velocities
        accelerations = zero if accelerations is None else accelerations
        t, (p, v, a) = _knots(times, positions=positions, velocities=velocities, accelerations=accelerations)
        h = np.diff(t)[:, None]
        first, second = v / 5, a / 20
        points = (
            p[:-1],
            p[:-1] + h * first[:-1],
            p[:-1] + h * (2 * first[:-1] + h * second[:-1]),
            p[1:] - h * (2 * first[1:] - h * second[1:]),
            p[1:] - h * first[1:],
            p[1:],
        )
        most = np.abs(v).max(axis=0) * h.max() + np.abs(a).max(axis=0) * h.max() ** 2
        return cls(np.stack(points, axis=1), t, joint_names, 16 * _UNIT * _size(p, most))

    @classmethod
    def trapezoidal(
        cls,
        positions: Any,
        max_velocity: Any,
        max_acceleration: Any,
        joint_names: Optional[Sequence[str]] = None,
    ) -> Trajectory:
        """Moves straight between (N, J) positions, and stops at each, as fast as the limits allow.

        max_velocity, max_acceleration: (J,) or a number, above 0. All joints of a motion begin and end together.

        `rounding` is for equal shares of each part's time; `times` are rounded as well, by less than 2^-48 of a motion.
        """
        rows = _rows(positions, "positions")
        limits = []
        for value, what in ((max_velocity, "max_velocity"), (max_acceleration, "max_acceleration")):
            each = np.broadcast_to(np.asarray(value, dtype=np.float64), rows.shape[1:])
            if not (each > 0).all():
                raise ValueError(f"{what}: expected numbers above 0, got {value!r}")
            limits.append(each)
        points: list[np.ndarray] = []
        times = [0.0]
        for start, end in zip(rows[:-1], rows[1:]):
            change = end - start
            if not change.any():
                continue
            velocity, acceleration = (float((each[change != 0] / np.abs(change[change != 0])).min()) for each in limits)
            until, cruise, share = acceleration**-0.5, 0.0, 0.5  # the latter of the change, while it accelerates
            if velocity / acceleration < until:
                until = velocity / acceleration
                share = 0.5 * velocity * until
                cruise = (1 - 2 * share) / velocity
            a, b = start + share * change, end - share * change
            parts = [((start, start, a), until), ((a, 0.5 * (a + b), b), cruise), ((b, end, end), until)]
            for curve, duration in parts:
                if duration > 0:
                    points.append(np.stack(curve))
                    times.append(times[-1] + duration)
        if not points:
            raise ValueError("positions: expected some that differ")
        # Roundings of `share`: 2 of each limit per change, 1 of their quotient, 3 of its product; 3 until the point.
        return cls(points, times, joint_names, 12 * _UNIT * np.abs(rows).max(axis=0))

    @classmethod
    def from_ros(cls, message: Any) -> Trajectory:
        """Converts a trajectory_msgs/JointTrajectory, or a dict of the same form, as ros2_controllers interpolate it.

        Points with accelerations and velocities give polynomials of degree 5, with velocities of degree 3, and with
        positions alone straight lines. time_from_start is a Duration, or seconds.
        """
        points = _item(message, "points")
        if len(points) < 2:
            raise ValueError(f"points: expected two or more, got {len(points)}")
        columns = {}
        for name in ("positions", "velocities", "accelerations"):
            given = [list(_item(point, name, ())) for point in points]
            if all(given):
                columns[name] = given
            elif any(given) or name == "positions":
                missing = next(i for i, row in enumerate(given) if not row)
                raise ValueError(f"points[{missing}]: expected {name}, as other points have")
        times = [_seconds(_item(point, "time_from_start")) for point in points]
        names = tuple(_item(message, "joint_names", ())) or None
        if "velocities" not in columns:
            return cls.linear(times, columns["positions"], names)
        if "accelerations" not in columns:
            return cls.cubic(times, columns["positions"], columns["velocities"], names)
        return cls.quintic(times, **columns, joint_names=names)

    @classmethod
    def from_drake(cls, breaks: Any, coefficients: Any, joint_names: Optional[Sequence[str]] = None) -> Trajectory:
        """Converts a PiecewisePolynomial.

        breaks: (K + 1,) seconds. coefficients: (K, D + 1, J) of the powers of the time since a segment's break, the
            constants first.
        """
        t, c = _times(breaks), to_floats(coefficients, "coefficients", "(K, D + 1, J) numbers")
        if c.ndim != 3 or len(c) != len(t) - 1:
            raise ValueError(f"coefficients: expected shape ({len(t) - 1}, D + 1, J), got {c.shape}")
        if c.shape[1] == 1:
            c = np.concatenate((c, np.zeros_like(c)), axis=1)
        n = c.shape[1] - 1
        if n >= MOST_POINTS:
            raise ValueError(f"coefficients: expected degree 1 to {MOST_POINTS - 1}, got {n}")
        scaled = c * (np.diff(t)[:, None] ** np.arange(n + 1))[:, :, None]
        share = np.array([[comb(i, k) / comb(n, k) for k in range(n + 1)] for i in range(n + 1)])
        points = np.einsum("ik,skj->sij", share, scaled)
        return cls(points, t, joint_names, 4 * (n + 2) * _UNIT * np.abs(scaled).sum(axis=1).max(axis=0))

    def __len__(self) -> int:
        """K, the number of segments."""
        return len(self.points)

    def __repr__(self) -> str:
        count, points, joints = self.points.shape
        return f"<clearance.Trajectory: {count} segments of degree {points - 1}, {joints} joints>"

    def at(self, time: float) -> np.ndarray:
        """Returns the (J,) positions at a time in seconds, rounded."""
        k = int(np.clip(np.searchsorted(self.times, time, side="right") - 1, 0, len(self) - 1))
        share = (time - self.times[k]) / (self.times[k + 1] - self.times[k])
        points = self.points[k]
        while len(points) > 1:
            points = points[:-1] + share * (points[1:] - points[:-1])
        return points[0]

    def time(self, index: int, t: float) -> float:
        """Returns the time in seconds of a time t, 0 to 1, of a segment, as PathCheck.index and PathCheck.t."""
        return float(self.times[index] + t * (self.times[index + 1] - self.times[index]))

    def columns(self, names: Sequence[str], what: str) -> np.ndarray:
        """Returns (K, D + 1, J) control points for joints in another order, by the last parts of their names."""
        if self.points.shape[2] != len(names):
            raise ValueError(f"{what}: expected {len(names)} joints, got {self.points.shape[2]}")
        if self.joint_names is None:
            return self.points
        short = {name: i for i, name in enumerate(self.joint_names)}
        known = [name if name in short else name.rsplit("/", 1)[-1] for name in names]
        for name, given in zip(known, names):
            if name not in short:
                raise ValueError(f"{what}: no joint is named {given!r}; it has {', '.join(self.joint_names)}")
        order = [short[name] for name in known]
        if len(set(order)) != len(order):
            raise ValueError(f"{what}: {', '.join(names)} share names in the trajectory: {', '.join(self.joint_names)}")
        return self.points if order == list(range(len(order))) else np.ascontiguousarray(self.points[:, :, order])


def _times(value: Any) -> np.ndarray:
    times = to_floats(value, "times", "(K + 1,) seconds")
    if times.ndim != 1 or len(times) < 2 or not (np.diff(times) > 0).all():
        raise ValueError("times: expected two or more, ascending")
    return times


def _rows(value: Any, what: str) -> np.ndarray:
    rows = to_floats(value, what, "(N, J) numbers")
    if rows.ndim != 2 or len(rows) < 2 or not rows.shape[1]:
        raise ValueError(f"{what}: expected shape (N, J) with N of at least 2, got {rows.shape}")
    return rows


def _knots(times: Any, **columns: Any) -> tuple[np.ndarray, list[np.ndarray]]:
    t = _times(times)
    rows = [_rows(value, what) for what, value in columns.items()]
    for what, row in zip(columns, rows):
        if row.shape != (len(t), rows[0].shape[1]):
            raise ValueError(f"{what}: expected shape ({len(t)}, {rows[0].shape[1]}), got {row.shape}")
    return t, rows


def _size(positions: np.ndarray, more: np.ndarray) -> np.ndarray:
    return np.abs(positions).max(axis=0) + more


def _blossom(rows: np.ndarray, knots: np.ndarray, k: int, degree: int, at_end: int) -> np.ndarray:
    """Returns a control point in the span from knot k: the blossom for `at_end` times its end, otherwise its start."""
    points = rows[k - degree : k + 1]
    for r in range(1, degree + 1):
        t = knots[k + 1] if r <= at_end else knots[k]
        low, high = knots[k - degree + r : k + 1], knots[k + 1 : k + 1 + degree - r + 1]
        share = ((t - low) / (high - low))[:, None]
        points = points[:-1] + share * (points[1:] - points[:-1])
    return points[0]


def _item(message: Any, name: str, default: Any = None) -> Any:
    value = message.get(name, default) if isinstance(message, Mapping) else getattr(message, name, default)
    if value is None:
        raise ValueError(f"{name}: expected a JointTrajectory, which has some")
    return value


def _seconds(duration: Any) -> float:
    if isinstance(duration, (int, float, np.number)):
        return float(duration)
    nanoseconds = _item(duration, "nanosec", _item(duration, "nsec", 0))
    return float(_item(duration, "sec", _item(duration, "secs", 0))) + 1e-9 * float(nanoseconds)
