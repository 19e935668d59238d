"""The calls that can be prepared: their inputs to configurations, and answers to their results."""

from __future__ import annotations

import math
from collections.abc import Generator, Mapping
from typing import Any, Callable, ClassVar, Optional

import numpy as np

from .._arguments import to_floats
from .._limits import LimitViolation, beyond_limits, curves_beyond_limits
from .._poses import as_pose7
from .._words import FIELD_MASKS, Field, Reduce, Status
from .check import Check
from .path import PathCheck
from .query import Query, Run
from .result import Result
from .trajectory import Trajectory

#: A query to answer: with its poses (K, M, 7) and positions (K, J), None for the kind that does not move.
Request = tuple[Run, Optional[np.ndarray], Optional[np.ndarray]]
Steps = Generator[Request, Any, Any]

_FIRST_MOTIONS, _MOST_MOTIONS = 8, 1024  # motions of a path in one query
_ANY, _BEYOND = int(Reduce.ANY), int(Status.BEYOND)  # numpy compares an enum's member as an object
_FREE = PathCheck(True, None, None, None, Status.BEYOND)
#: Columns of motions by default. Bounds, steps and first contact of a decision need a longer search.
_MOTION_FIELDS = ("default", "flags", "pair", "time", "first_contact", "steps")
_DECIDED_FIELDS = ("status", "verdict", "flags", "pair", "time")


class Call:
    """A call with a parsed query. A call of one query implements read() and result(), others steps()."""

    inputs: ClassVar[tuple[str, ...]] = ("configurations",)  #: parameters that each run gives
    fixed: ClassVar[dict[str, Any]] = {}  #: options of its queries

    def __init__(self, query: Query):
        self.query = query

    @classmethod
    def options(cls, arguments: Mapping[str, Any]) -> dict[str, Any]:
        """Converts the call's arguments to those of its queries."""
        return {**arguments, **cls.fixed}

    def read(self, *inputs: Any) -> Request:
        raise NotImplementedError

    def result(self, run: Run, answer: Any, positions: Optional[np.ndarray]) -> Any:
        return Result(answer, run.reduce, run)

    def steps(self, *inputs: Any) -> Steps:
        """Yields the queries, receives their answers, and returns the result."""
        run, poses, positions = self.read(*inputs)
        answer = yield run, poses, positions
        return self.result(run, answer, positions)


class Distances(Call):
    def read(self, configurations: Any = None) -> Request:
        query = self.query
        if configurations is None:
            if query.bodies is not None or query.joints is not None:
                what = "joints" if query.bodies is None else "bodies"
                raise ValueError(f"{what}: only together with configurations")
            return query.run(False, 1), None, None
        if query.bodies is None and query.joints is not None:  # the usual case of planners
            rows = _positions(configurations, query.joint_count, "configurations")
            return query.run(True, len(rows)), None, rows
        poses, positions = arrays_of(query, configurations, "configurations")
        return query.run(True, _count(poses, positions)), poses, positions


class Checks(Distances):
    fixed: ClassVar = {"reduce": "any", "fields": int(Field.VERDICT | Field.PAIR)}

    #: Violations of the scene's joints at the current poses.
    current_limits: Callable[[Any], Any]

    def result(self, run: Run, answer: Any, positions: Optional[np.ndarray]) -> Check:
        if answer.beyond_limits and positions is not None and self.query.joints is not None:
            return Check(answer, run, beyond_limits(positions, self.query.joints, "configurations"))
        if run.joints is None and run.bodies is None:
            return Check(answer, run, self.current_limits(answer))
        return Check(answer, run)


class Motions(Call):
    inputs = ("start", "end")

    @classmethod
    def options(cls, arguments: Mapping[str, Any]) -> dict[str, Any]:
        requested = dict(arguments)
        wide = requested.get("reduce") != "any"
        if requested.get("fields") is None:
            requested["fields"] = _MOTION_FIELDS if wide else _DECIDED_FIELDS
        # Wider tolerances would leave decisions open.
        for name, value in (("abs_tol", 1e-3 if wide else 0.0), ("rel_tol", 0.0 if wide else None)):
            if requested.get(name) is None:
                requested[name] = value
        return requested

    def read(self, start: Any = None, end: Any = None) -> Request:
        query = self.query
        if end is None and _is_curved(query, start):
            points = _curves(query, start, "start")
            return query.run(True, len(points), points.shape[1]), None, points.reshape(-1, points.shape[2])
        if query.bodies is None and query.joints is not None:  # the usual case of planners
            first = _positions(start, query.joint_count, "start")
            last = _positions(end, query.joint_count, "end")
            return query.run(True, len(first)), None, _interleave(first, last)
        start_poses, start_positions = arrays_of(query, start, "start")
        end_poses, end_positions = arrays_of(query, end, "end")
        poses, positions = _interleave(start_poses, end_poses), _interleave(start_positions, end_positions)
        return query.run(True, _count(poses, positions) // 2), poses, positions


class Paths(Call):
    inputs = ("path",)
    fixed: ClassVar = {"reduce": "any", "fields": "verdict"}
    #: Columns of the first motion without a proof. They cost more than the verdict, above all `first_contact`.
    details: ClassVar = sum(FIELD_MASKS[name] for name in ("status", "pair", "time", "first_contact"))

    def steps(self, path: Any = None) -> Steps:
        points, count, each = self._points(path)
        positions, is_curved = points[1], isinstance(path, Trajectory)
        if count < 1:
            raise ValueError(f"path: expected two waypoints or more, got {count + 1}")
        violations: tuple[LimitViolation, ...] = ()
        is_short = count <= _FIRST_MOTIONS
        if positions is not None and not is_short:
            violations = self._violations(positions)
        first, room = 0, _FIRST_MOTIONS
        while first < count:
            last = min(first + room, count)
            poses, rows = (_ends(p, first, last, is_curved) for p in points)
            run = self.query.run(True, last - first, each)
            answer = yield run, poses, rows
            if is_short and positions is not None and answer.beyond_limits:  # of all waypoints
                violations = self._violations(positions)
            if answer.all_free():
                first, room = last, min(2 * room, _MOST_MOTIONS)
                continue
            first += int(np.argmax(Result(answer, _ANY, run).verdict != _BEYOND))
            poses, rows = (_ends(p, first, first + 1, is_curved) for p in points)
            run = self.query.run_of(True, self.details, each)
            answer = yield run, poses, rows
            result = Result(answer, _ANY, run)
            if result.status[0] != _BEYOND:
                return _stopped(result, first, violations)
            first += 1
        return PathCheck(True, None, None, None, Status.BEYOND, violations) if violations else _FREE

    def _points(self, path: Any) -> tuple[tuple[Optional[np.ndarray], Optional[np.ndarray]], int, int]:
        """Returns waypoints or control points, the number of motions, and of the control points of each."""
        if isinstance(path, Trajectory):
            curves = _curves(self.query, path, "path")
            return (None, curves), len(curves), curves.shape[1]
        points = arrays_of(self.query, path, "path")
        return points, _count(*points) - 1, 2

    def _violations(self, positions: np.ndarray) -> tuple[LimitViolation, ...]:
        joints = self.query.joints
        if joints is not None and positions.ndim == 3:
            return curves_beyond_limits(positions, joints)
        beyond = None if joints is None else beyond_limits(positions, joints, "path")
        return () if beyond is None else beyond.first_of_each_joint()


class Scales(Call):
    inputs = ("positions",)
    fixed: ClassVar = {"reduce": "any", "fields": "free_scale"}

    def __init__(self, query: Query):
        super().__init__(query)
        if query.joints is None:
            raise ValueError("joints: expected some, that move")
        if query.bodies is not None:
            raise ValueError("bodies: expected none")
        if query.weights is None:
            query.weights = np.ones(query.joint_count)

    def read(self, positions: Any = None) -> Request:
        poses, rows = arrays_of(self.query, positions, "positions")
        return self.query.run(True, _count(poses, rows)), poses, rows

    def result(self, run: Run, answer: Any, positions: Optional[np.ndarray]) -> np.ndarray:
        return Result(answer, _ANY, run).free_scale


CALLS: dict[str, type[Call]] = {
    "distances": Distances,
    "check": Checks,
    "motions": Motions,
    "check_path": Paths,
    "free_scale": Scales,
}


def arrays_of(query: Query, value: Any, what: str) -> tuple[Optional[np.ndarray], Optional[np.ndarray]]:
    """Returns (K, M, 7) poses and (K, J) positions of configurations, None for the kind that does not move."""
    if query.joints is None:
        return _poses(query, value, what), None
    if query.bodies is None:
        return None, _positions(value, query.joint_count, what)
    if not isinstance(value, (tuple, list)) or len(value) != 2:
        raise TypeError(f"{what}: expected a pair (positions, poses), since joints and bodies move")
    positions = _positions(value[0], query.joint_count, f"{what}[0]")
    poses = _poses(query, value[1], f"{what}[1]")
    if len(poses) != len(positions):
        raise ValueError(f"{what}: expected K = {len(positions)} poses as of positions, got {len(poses)}")
    return poses, positions


def _count(poses: Optional[np.ndarray], positions: Optional[np.ndarray]) -> int:
    return len(poses) if poses is not None else 0 if positions is None else len(positions)


def _positions(value: Any, joints: int, what: str) -> np.ndarray:
    if value is None:
        raise ValueError(f"{what}: expected (K, J) positions of joints, got none")
    rows = to_floats(value, what, "(K, J) numbers")
    shape = rows.shape
    if len(shape) != 2 or shape[1] != joints:
        hint = f"; write {what}[None] for one row" if shape == (joints,) else ""
        raise ValueError(f"{what}: expected shape (K, {joints}), one column for each joint, got {shape}{hint}")
    if not shape[0]:
        raise ValueError(f"{what}: expected at least one row, got shape {shape}")
    return rows


def _poses(query: Query, value: Any, what: str) -> np.ndarray:
    if value is None:
        raise ValueError(f"{what}: expected (K, M, 7) poses of bodies, got none")
    poses = as_pose7(value, what)
    if poses.ndim != 3:
        raise ValueError(f"{what}: expected shape (K, M, 7) or (K, M, 4, 4), got {np.shape(value)}")
    bodies, _ = query.moved(True)
    count = 0 if bodies is None else len(bodies)
    if poses.shape[1] != count:
        whose = "every movable body" if query.bodies is None else "bodies"
        raise ValueError(f"{what}: expected M = {count} poses each ({whose}), got shape {np.shape(value)}")
    if not len(poses):
        raise ValueError(f"{what}: expected at least one, got shape {np.shape(value)}")
    return poses


def _is_curved(query: Query, start: Any) -> bool:
    """Whether the motions have control points instead of two ends."""
    if isinstance(start, Trajectory):
        return True
    if start is None or query.joints is None or query.bodies is not None:
        return False
    return to_floats(start, "start", "(K, J) numbers").ndim == 3


def _curves(query: Query, value: Any, what: str) -> np.ndarray:
    """Returns (K, D + 1, J) control points of motions of joints."""
    if query.joints is None or query.bodies is not None:
        raise ValueError(f"{what}: expected poses, since bodies move: only joints move along a Trajectory")
    trajectory = value if isinstance(value, Trajectory) else Trajectory(value)
    return trajectory.columns(query.joints.names, what)


def _interleave(start: Optional[np.ndarray], end: Optional[np.ndarray]) -> Optional[np.ndarray]:
    """Interleaves the ends of motions as a query expects them: first start, first end, second start, ..."""
    if start is None or end is None:
        return None
    if start.shape != end.shape:
        raise ValueError(f"end: expected shape {start.shape}, as start has, got {end.shape}")
    if len(start) == 1:
        return np.concatenate((start, end))
    return np.stack((start, end), axis=1).reshape(-1, *start.shape[1:])


def _ends(waypoints: Optional[np.ndarray], first: int, last: int, are_curves: bool) -> Optional[np.ndarray]:
    """Returns the ends of the motions from waypoint `first` to `last`, in turn: every waypoint twice, except those.

    are_curves: of curves instead, their control points.
    """
    if are_curves:
        return None if waypoints is None else waypoints[first:last].reshape(-1, waypoints.shape[2])
    if waypoints is None or len(waypoints) == 2:
        return waypoints
    return np.repeat(waypoints[first : last + 1], 2, axis=0)[1:-1]


def _stopped(r: Result, motion: int, violations: tuple[LimitViolation, ...]) -> PathCheck:
    time = float(r.time[0])
    if math.isnan(time):
        time = float(r.first_contact[0, 0])
    a, b = r.pair[0].tolist()
    return PathCheck(False, motion, time, (a, b), Status(int(r.status[0])), violations, (r.names[a], r.names[b]))
