"""The calls that can be prepared: their inputs to configurations, and answers to their results."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Callable, ClassVar, Optional

import numpy as np

from .._arguments import contiguous, to_floats
from .._words import Field, Status
from .arrays import arrays_of, count_of, curves_of, ends_of, interleave, is_curved, positions_of
from .call import ANY, BEYOND, DETAILS, Call, Request, Steps, stopped
from .check import Check
from .limits import LimitViolation, beyond_limits, curves_beyond_limits
from .meanwhile import meanwhile_of, meanwhile_of_each
from .path import PathCheck
from .query import Query, Run
from .result import Result
from .stop import Stops
from .trajectory import Trajectory

_FIRST_MOTIONS, _MOST_MOTIONS = 8, 1024  # motions of a path in one query
_FREE = PathCheck(True, None, None, None, Status.BEYOND)
#: Columns of motions by default. Bounds, steps and first contact of a decision need a longer search.
_MOTION_FIELDS = ("default", "flags", "pair", "time", "first_contact", "steps")
_DECIDED_FIELDS = ("status", "verdict", "flags", "pair", "time")


class Configurations(Call):
    def read(self, configurations: Any = None) -> Request:
        query = self.query
        if configurations is None:
            if query.bodies is not None or query.joints is not None:
                what = "joints" if query.bodies is None else "bodies"
                raise ValueError(f"{what}: only together with configurations")
            return query.run(False, 1), None, None
        if query.bodies is None and query.joints is not None:  # the usual case of planners
            rows = positions_of(configurations, query.joint_count, "configurations")
            return query.run(True, len(rows)), None, rows
        poses, positions = arrays_of(query, configurations, "configurations")
        return query.run(True, count_of(poses, positions)), poses, positions


class Distances(Configurations):
    inputs = ("configurations", "velocities", "twists")
    extra = ("speed_errors",)
    most_rows = 2

    def read(self, configurations: Any = None, velocities: Any = None, twists: Any = None) -> Request:
        run, poses, positions = super().read(configurations)
        if velocities is None and twists is None:
            return run, poses, positions
        speeds = _speeds(velocities, positions, "velocities", "joints", "(K, J)")
        moves = _speeds(twists, None if poses is None else poses[..., :6], "twists", "bodies", "(K, M, 6)")
        return run.at_speeds(speeds, moves), poses, positions


class Checks(Configurations):
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
    least_rows = most_rows = 2

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
        if query.meanwhile is not None:
            return self._read_meanwhile(start, end)
        if end is None and is_curved(query, start):
            points = curves_of(query, start, "start")
            return query.run(True, len(points), points.shape[1]), None, points.reshape(-1, points.shape[2])
        if query.bodies is None and query.joints is not None:  # the usual case of planners
            first = positions_of(start, query.joint_count, "start")
            last = positions_of(end, query.joint_count, "end")
            return query.run(True, len(first)), None, interleave(first, last)
        start_poses, start_positions = arrays_of(query, start, "start")
        end_poses, end_positions = arrays_of(query, end, "end")
        poses, positions = interleave(start_poses, end_poses), interleave(start_positions, end_positions)
        return query.run(True, count_of(poses, positions) // 2), poses, positions

    def _read_meanwhile(self, start: Any, end: Any) -> Request:
        """Bodies move over the time of a Trajectory, else over a second of each motion."""
        query = self.query
        assert query.meanwhile is not None
        if end is None and is_curved(query, start):
            curves = curves_of(query, start, "start")
        else:
            first = positions_of(start, query.joint_count, "start")
            ends = interleave(first, positions_of(end, query.joint_count, "end"))
            assert ends is not None
            curves = ends.reshape(-1, 2, query.joint_count)
        if isinstance(start, Trajectory):
            poses, growths = meanwhile_of(query.meanwhile, start.times, curves.shape[1])
        else:
            poses, growths = meanwhile_of_each(query.meanwhile, len(curves), curves.shape[1])
        run = query.run_growing(len(curves), curves.shape[1], growths)
        return run, poses.reshape(-1, *poses.shape[2:]), curves.reshape(-1, curves.shape[2])


class Paths(Call):
    inputs = ("path",)
    fixed: ClassVar = {"reduce": "any", "fields": "verdict"}

    def result(self, run: Run, answer: Any, positions: Optional[np.ndarray]) -> Optional[PathCheck]:
        """Returns the result for a path of one motion, or None if steps() must find it."""
        return _FREE if answer.all_free() and not answer.beyond_limits else None

    def steps(self, path: Any = None) -> Steps:
        points, count, each, growths = self._points(path)
        positions, are_curves = points[1], points[1] is not None and points[1].ndim == 3
        if count < 1:
            raise ValueError(f"path: expected two waypoints or more, got {count + 1}")
        violations: tuple[LimitViolation, ...] = ()
        is_short = count <= _FIRST_MOTIONS
        if positions is not None and not is_short:
            violations = self._violations(path, positions)
        first, room = 0, _FIRST_MOTIONS
        while first < count:
            last = min(first + room, count)
            poses, rows = (ends_of(p, first, last, are_curves) for p in points)
            run = self.query.run_growing(last - first, each, ends_of(growths, first, last, True))
            answer = yield run, poses, rows
            if is_short and positions is not None and answer.beyond_limits:  # of all waypoints
                violations = self._violations(path, positions)
            if answer.all_free():
                first, room = last, min(2 * room, _MOST_MOTIONS)
                continue
            first += int(np.argmax(Result(answer, ANY, run).verdict != BEYOND))
            poses, rows = (ends_of(p, first, first + 1, are_curves) for p in points)
            run = self.query.run_growing(1, each, ends_of(growths, first, first + 1, True), DETAILS)
            answer = yield run, poses, rows
            result = Result(answer, ANY, run)
            if result.status[0] != BEYOND:
                return stopped(result, first, violations)
            first += 1
        return PathCheck(True, None, None, None, Status.BEYOND, violations) if violations else _FREE

    def _points(
        self, path: Any
    ) -> tuple[tuple[Optional[np.ndarray], Optional[np.ndarray]], int, int, Optional[np.ndarray]]:
        """Returns waypoints or control points, the number of motions, of the control points of each, and growths."""
        query = self.query
        if isinstance(path, Trajectory):
            curves = curves_of(query, path, "path")
        elif query.meanwhile is None:
            points = arrays_of(query, path, "path")
            return points, count_of(*points) - 1, 2, None
        else:
            rows = positions_of(path, query.joint_count, "path")
            curves = np.stack((rows[:-1], rows[1:]), axis=1)
        poses = growths = None
        if query.meanwhile is not None and len(curves):
            knots = path.times if isinstance(path, Trajectory) else np.arange(len(curves) + 1.0)
            poses, growths = meanwhile_of(query.meanwhile, knots, curves.shape[1])
        return (poses, curves), len(curves), curves.shape[1], growths

    def _violations(self, path: Any, positions: np.ndarray) -> tuple[LimitViolation, ...]:
        joints = self.query.joints
        if joints is not None and isinstance(path, Trajectory):
            return curves_beyond_limits(positions, joints)
        waypoints = positions if positions.ndim == 2 else positions_of(path, self.query.joint_count, "path")
        beyond = None if joints is None else beyond_limits(waypoints, joints, "path")
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
        return self.query.run(True, count_of(poses, rows)), poses, rows

    def result(self, run: Run, answer: Any, positions: Optional[np.ndarray]) -> np.ndarray:
        return Result(answer, ANY, run).free_scale


CALLS: dict[str, type[Call]] = {
    "distances": Distances,
    "check": Checks,
    "motions": Motions,
    "check_path": Paths,
    "free_scale": Scales,
    "check_stop": Stops,
}


def _speeds(speeds: Any, like: Optional[np.ndarray], what: str, of: str, shape: str) -> Optional[np.ndarray]:
    """Returns a speed for each number of `like`, flat."""
    if speeds is None:
        return None
    if like is None:
        raise ValueError(f"{what}: only together with configurations of {of}")
    each = contiguous(to_floats(speeds, what, f"{shape} numbers"))
    if each.shape != like.shape:
        raise ValueError(f"{what}: expected shape {like.shape}, got {each.shape}")
    return each.reshape(-1)
