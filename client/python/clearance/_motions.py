"""Queries of whole motions for Engine and Client: arguments in, results out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, Optional, Protocol, Union

import numpy as np

from ._arguments import to_floats
from ._joints import Joints, JointsRef, JointTable
from ._limits import LimitViolation, beyond_limits
from ._poses import as_pose7
from ._result import Result
from ._words import Status

MotionReduceWord = Literal["none", "min", "any"]
MOTION_FIELDS = ("default", "flags", "pair", "time", "first_contact", "steps")
_FIRST_MOTIONS, _MOST_MOTIONS = 8, 1024  # motions of a path in one query


@dataclass(frozen=True)
class PathCheck:
    """Whether a whole path is free, or the first motion that is not proved free."""

    free: bool  #: whether every pair is proved farther than its margin on every motion
    index: Optional[int]  #: the first motion that is not free, from waypoint `index` to the next; None if free
    t: Optional[float]  #: 0 to 1 in that motion: time at which `pair` is within its margin, or at which the proof ends
    pair: Optional[tuple[int, int]]  #: ids of the bodies that are not proved free
    status: Status  #: BEYOND if free. OK, CONTACT, OVERLAP: `pair` is proved within its margin at `t`. Others: no proof
    #: First waypoint at which each joint is beyond its limits, in the order of joints. Independent of `free`.
    limit_violations: tuple[LimitViolation, ...] = ()

    @property
    def beyond_limits(self) -> bool:
        """Whether a joint exceeds its limits. Checked at the waypoints, since motions are straight between them."""
        return bool(self.limit_violations)

    @property
    def ok(self) -> bool:
        """Whether the whole path is free and within the joints' limits; also the result as a bool."""
        return self.free and not self.limit_violations

    def __bool__(self) -> bool:
        return self.ok

    @property
    def hit(self) -> bool:
        """Whether the path is proved not to be free. If neither free nor hit, nothing is proved."""
        return self.status <= Status.CONTACT


class HasJoints(Protocol):
    """The members of an Engine or a Client that motion_arguments() uses."""

    @property
    def _joint_table(self) -> JointTable: ...


class Answers(HasJoints, Protocol):
    """The members of Front that MotionQueries uses."""

    def distances(self, *args: Any, **more: Any) -> Result: ...


class MotionQueries:
    """The methods of Front for motions: queries of (start, end) pairs of configurations."""

    def motions(
        self: Answers,
        joints: Optional[JointsRef] = None,
        start: Any = None,
        end: Any = None,
        pairs: Any = None,
        margin: Any = 0.0,
        max_distance: float = math.inf,
        abs_tol: Optional[float] = None,
        rel_tol: Optional[float] = None,
        reduce: MotionReduceWord = "min",
        max_evaluations: int = 256,
        bodies: Optional[Sequence[Union[str, int]]] = None,
        fields: Union[str, Sequence[str], None] = None,
        **more: Any,
    ) -> Result:
        """Returns the least distances of bodies along whole continuous motions, with certified bounds, not samples.

        joints: the moving joints, as in distances(); they move linearly from `start` to `end`. A continuous joint
            does not wrap: from 3.1 to -3.1, it turns by 6.2 radians.
        start, end: (K, J) radians and metres for K motions. Without `joints`, (K, M, 7) or (K, M, 4, 4) poses of
            `bodies`, which move linearly and turn at a constant speed in the shorter direction (flag HALF_TURN if both
            are nearly equal). With joints and bodies, a pair (positions, poses) each.
        pairs, max_distance, fields, more: as in distances(). The columns `time`, `first_contact` and `steps` exist for
            motions only, and are returned by default; `gradient` and signed distances are not available.
        margin: the margin of `first_contact` and reduce="any", as in check().
        abs_tol, rel_tol: metres, ratio: the tolerance of upper - lower. The defaults are 1 mm and 0 for distances; 0
            and 1e-6 for reduce="any", which decide nearly every motion.
        reduce: "min" for a row per motion, the minimum of all pairs; "none" for a row per motion and pair; "any" for a
            row per motion, BEYOND if every pair is proved farther than its margin throughout, otherwise another pair.
        max_evaluations: maximum evaluations per motion. Beyond it the status is UNCONVERGED; the bounds remain valid.

        Columns begin with (K,), or (K, P) for reduce="none". [lower, upper] contains the least distance of the whole
        motion, both ends included. `time`, 0 to 1, is the time of the witness points. `first_contact` (..., 2) is the
        time until which all pairs are proved farther than the margin, and a time at which a pair is proved within it;
        inf if there is none.

        Raises as distances() does.
        """
        more |= {
            "margin": margin,
            "abs_tol": abs_tol,
            "rel_tol": rel_tol,
            "reduce": reduce,
            "max_evaluations": max_evaluations,
        }
        return self.distances(
            pairs, max_distance=max_distance, **motion_arguments(self, joints, start, end, bodies, fields, **more)
        )

    def check_path(
        self: Answers,
        path: Any,
        joints: Optional[JointsRef] = None,
        margin: Any = 0.0,
        pairs: Any = None,
        bodies: Optional[Sequence[Union[str, int]]] = None,
        max_evaluations: int = 256,
        **more: Any,
    ) -> PathCheck:
        """Returns whether a path is free: every pair is proved farther than its margin along the whole path.

        path: (N, J) positions of `joints`, (N, M, 7) poses of `bodies`, or a pair of both, for N - 1 motions in a row.
        The other arguments are those of motions(). Stops at the first motion that is not proved free. `ok` of the
        result includes the joints' limits, `free` does not. Warns (JointLimitWarning) of positions that look like
        degrees.

        Raises ValueError for fewer than two waypoints, and as motions() does.
        """
        joints = _joints_of(self, joints)
        points = _ends(path, joints, bodies, "path")
        count = len(next(each for each in points if each is not None))
        if count < 2:
            raise ValueError(f"path: expected two waypoints or more, got {count}")
        beyond = None if joints is None or points[0] is None else beyond_limits(points[0], joints, "path")
        violations = () if beyond is None else beyond.first_of_each_joint()
        first, room = 0, _FIRST_MOTIONS
        while first < count - 1:
            last = min(first + room, count - 1)
            between = [None if p is None else _interleave(p[first:last], p[first + 1 : last + 1]) for p in points]
            r = self.distances(
                pairs, between[1], bodies, reduce="any", joints=joints, positions=between[0], margin=margin,
                max_evaluations=max_evaluations, fields=("status", "pair", "time", "first_contact"), **more,
            )  # fmt: skip
            bad = np.flatnonzero(r.status != Status.BEYOND)
            if len(bad):
                return _stopped(r, int(bad[0]), first, violations)
            first, room = last, min(2 * room, _MOST_MOTIONS)
        return PathCheck(True, None, None, None, Status.BEYOND, violations)


def motion_arguments(
    answers: HasJoints,
    joints: Optional[JointsRef] = None,
    start: Any = None,
    end: Any = None,
    bodies: Optional[Sequence[Union[str, int]]] = None,
    fields: Union[str, Sequence[str], None] = None,
    **more: Any,
) -> dict[str, Any]:
    """Converts arguments of motions() to those of distances(), with the defaults of motions(). Raises as it does."""
    joints = _joints_of(answers, joints)
    ends = _ends(start, joints, bodies, "start"), _ends(end, joints, bodies, "end")
    positions, configurations = (_interleave(*each) for each in zip(*ends))
    requested: dict[str, Any] = {"reduce": "min", "max_evaluations": 256, "bodies": bodies, "joints": joints}
    requested |= {"positions": positions, "configurations": configurations}
    requested |= {"fields": MOTION_FIELDS if fields is None else fields, **more}
    if requested["reduce"] == "any":  # wider tolerances leave motions undecided
        defaults: dict[str, Any] = {"abs_tol": 0.0, "rel_tol": None}
    else:
        defaults = {"abs_tol": 1e-3, "rel_tol": 0.0}
    for name, value in defaults.items():
        if requested.get(name) is None:
            requested[name] = value
    return requested


def _joints_of(answers: HasJoints, joints: Optional[JointsRef]) -> Optional[Joints]:
    table = answers._joint_table
    return None if joints is None else table.joints(table.ids_of(joints, "joints"))


def _stopped(r: Result, row: int, first: int, violations: tuple[LimitViolation, ...]) -> PathCheck:
    time = float(r.time[row])
    if math.isnan(time):
        time = float(r.first_contact[row, 0])
    a, b = r.pair[row].tolist()
    return PathCheck(False, first + row, time, (a, b), Status(int(r.status[row])), violations)


def _ends(value: Any, joints: Any, bodies: Any, what: str) -> tuple[Optional[np.ndarray], Optional[np.ndarray]]:
    """Returns (K, J) positions and (K, M, 7) poses of one end of motions, None for the kind that does not move."""
    if value is None:
        raise ValueError(f"{what}: expected positions of joints, or poses of bodies, got none")
    if joints is None:
        return None, _poses(value, what)
    if bodies is None:
        return _positions(value, what), None
    if not isinstance(value, (tuple, list)) or len(value) != 2:
        raise TypeError(f"{what}: expected a pair (positions, poses), since joints and bodies move")
    return _positions(value[0], f"{what}[0]"), _poses(value[1], f"{what}[1]")


def _positions(value: Any, what: str) -> np.ndarray:
    rows = to_floats(value, what, "(K, J) numbers")
    if rows.ndim != 2:
        raise ValueError(f"{what}: expected shape (K, J), got {rows.shape}")
    return rows


def _poses(value: Any, what: str) -> np.ndarray:
    poses = as_pose7(value, what)
    if poses.ndim != 3:
        raise ValueError(f"{what}: expected shape (K, M, 7) or (K, M, 4, 4), got {np.shape(value)}")
    return poses


def _interleave(start: Optional[np.ndarray], end: Optional[np.ndarray]) -> Optional[np.ndarray]:
    """Interleaves the ends of motions as a query expects them: first start, first end, second start, ..."""
    if start is None or end is None:
        return None
    if start.shape != end.shape:
        raise ValueError(f"end: expected shape {start.shape}, as start has, got {end.shape}")
    return np.stack((start, end), axis=1).reshape(-1, *start.shape[1:])
