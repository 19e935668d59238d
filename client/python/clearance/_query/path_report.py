"""Where a path is closest to an obstacle, and why it is not free."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Optional

import numpy as np

from .._joints import JointsRef
from .._names import Margin, Pairs
from .._words import NONE
from .meanwhile import BodyPath, Meanwhile, meanwhile_of, pose_between, to_body_paths
from .path import PathCheck
from .result import Result
from .trajectory import Trajectory

_POINT_FIELDS = ("default", "points", "pair")
_MOTION_FIELDS = (*_POINT_FIELDS, "time", "first_contact")
_MOST_MOTIONS = 1024  # of a path in one query
_STATES = 33  # of a motion, among which the deepest is searched


@dataclass(frozen=True)
class PathPoint:
    """A state of a path with one of its pairs. The bounds hold at `positions`, which are rounded."""

    index: int  #: the motion, from waypoint `index` to the next
    t: float  #: 0 to 1 in that motion
    positions: np.ndarray  #: (J,) radians and metres
    pair: tuple[int, int]  #: ids of the bodies
    pair_names: tuple[str, str]
    #: Metres: certified bounds of the pair's distance, below zero for a penetration depth. 0 for overlaps with a cloud,
    #: which has no depth.
    lower: float
    upper: float
    segment: np.ndarray  #: (2, 3) witness points on the bodies without growth, metres, world, or NaN


@dataclass(frozen=True)
class PathReport:
    """What explain_path() returns. As a bool, as its check."""

    check: PathCheck  #: the verdict, as check_path() returns it
    proved_until: Optional[tuple[int, float]]  #: motion, and time in it, until which it is free; None if it is free
    contact: Optional[PathPoint]  #: the first state found within the margin; None without one
    #: Free path: the state where the distance is least. Otherwise the deepest of 33 states of the motion from the
    #: contact on, or without a proved contact the state of the least distance.
    nearest: PathPoint
    least: Optional[tuple[float, float]]  #: metres: certified bounds of the path's least distance; None after a contact

    def __bool__(self) -> bool:
        return bool(self.check)


def explain_path(
    front: Any, path: Any, joints: JointsRef, pairs: Pairs, margin: Margin, max_evaluations: int, meanwhile: Meanwhile
) -> PathReport:
    """Implements Front.explain_path(), of `front`."""
    if joints is None:
        raise ValueError("joints: expected some, that move")
    bodies = None if meanwhile is None else to_body_paths(meanwhile)
    common: dict[str, Any] = {"joints": joints, "pairs": pairs, "margin": margin}
    check = front.check_path(path, max_evaluations=max_evaluations, meanwhile=meanwhile, **common)
    if isinstance(path, Trajectory):
        curves, knots = path.columns(front.joints(joints).names, "path"), path.times
    else:
        rows = np.asarray(path, dtype=np.float64)
        curves, knots = np.stack((rows[:-1], rows[1:]), axis=1), np.arange(float(len(rows)))
    motions = _Motions(curves, bodies, knots, front.joints(joints).names)
    common["max_evaluations"] = max_evaluations
    if check.index is not None and check.hit:
        return _of_hit(front, motions, check, check.index, common)
    nearest, least = _nearest(front, motions, common)
    until = None if check.index is None else (check.index, _contact_times(front, motions, check.index, common)[0])
    return PathReport(check, until, None, nearest, least)


class _Motions:
    """The motions of a path: of joints, and of bodies meanwhile."""

    def __init__(self, curves: np.ndarray, bodies: Optional[dict[Any, BodyPath]], knots: np.ndarray, names: Any):
        self.curves, self.bodies, self.knots, self.names = curves, bodies, knots, names
        self.poses: Optional[np.ndarray] = None
        self.growths: Optional[np.ndarray] = None
        if bodies is not None:
            self.poses, self.growths = meanwhile_of(bodies, knots, curves.shape[1])

    def of(self, first: int, last: int) -> dict[str, Any]:
        """Returns arguments of motions() for some of them."""
        part = Trajectory(self.curves[first:last], self.knots[first : last + 1], self.names)
        if self.bodies is None or self.poses is None:
            return {"start": part}
        seconds = self.knots[first] - self.knots[0]
        meanwhile = {
            body: BodyPath(self.poses[first:last, :, i], None, path.radius + path.growth * seconds, path.growth)
            for i, (body, path) in enumerate(self.bodies.items())
        }
        return {"start": part, "meanwhile": meanwhile}

    def at(self, index: int, times: Sequence[float]) -> dict[str, Any]:
        """Returns arguments of distances() for states of one of them, rounded."""
        rows = np.array([_at(self.curves[index], t) for t in times])
        if self.bodies is None or self.poses is None:
            return {"configurations": rows}
        return {"configurations": (rows, self._poses(index, times)), "bodies": list(self.bodies)}

    def check_at(self, front: Any, index: int, t: float, common: dict[str, Any]) -> PathCheck:
        """Decides a state, as a motion that stays there: bodies grow in motions alone."""
        state, meanwhile = _at(self.curves[index], t), None
        if self.bodies is not None:
            poses, sizes = self._poses(index, [t])[0], self._sizes(index, t)
            meanwhile = {body: BodyPath(poses[i], radius=sizes[i]) for i, body in enumerate(self.bodies)}
        check: PathCheck = front.check_path([state, state], meanwhile=meanwhile, **common)
        return check

    def grown(self, r: Result, index: int, times: Sequence[float]) -> Optional[np.ndarray]:
        """Returns (len(times), P) how much the bodies of each row's pair are grown together, or None."""
        if self.bodies is None or self.growths is None:
            return None
        ids = [r.names.index(body) if isinstance(body, str) else body for body in self.bodies]
        sizes = np.zeros((len(times), len(r.names)))
        sizes[:, ids] = [self._sizes(index, t) for t in times]
        found: np.ndarray = np.take_along_axis(sizes[:, None], r.pair, axis=2).sum(axis=2)
        return found

    def _poses(self, index: int, times: Sequence[float]) -> np.ndarray:
        assert self.poses is not None
        controls = self.poses[index]
        return np.array([[pose_between(controls[:, i], t) for i in range(controls.shape[1])] for t in times])

    def _sizes(self, index: int, t: float) -> np.ndarray:
        if self.growths is None:
            return np.zeros(len(self.bodies or {}))
        return _at(self.growths[index], t)


def _of_hit(front: Any, motions: _Motions, check: PathCheck, index: int, common: dict[str, Any]) -> PathReport:
    """Reports a path with a proved contact in motion `index`."""
    proved, within = _contact_times(front, motions, index, common)
    if math.isinf(within):
        within = check.t or 0.0  # the search for the first one ended before
    if proved == 0.0 and motions.check_at(front, index, 0.0, common).hit:
        within = 0.0
    times = np.linspace(within, 1.0, _STATES).tolist()
    deepest = _deepest(front, motions, index, times, common)
    found = motions.check_at(front, index, within, common)
    pair = check.pair if found.free else found.pair
    contact = _deepest(front, motions, index, times[:1], {**common, "pairs": [pair]})
    return PathReport(check, (index, proved), contact, deepest, None)


def _deepest(front: Any, motions: _Motions, index: int, times: list[float], common: dict[str, Any]) -> PathPoint:
    """Returns the deepest of some states of a motion, or the nearest if none is an overlap."""
    states, joints = motions.at(index, times), common["joints"]
    found = []
    for pairs, has_depths in _pairs_by_depth(front, motions, common):
        of = {"pairs": pairs, "joints": joints, "signed_distance": has_depths, "fields": _POINT_FIELDS}
        r = front.distances(**states, reduce="none" if motions.growths is not None else "min", **of)
        if (r.pair != NONE).any():
            found.append(_deepest_of(r, motions, index, times))
    if not found:
        raise RuntimeError("explain_path: the path has no pairs in this scene")
    return min(found, key=lambda point: math.inf if math.isnan(point.upper) else point.upper)


def _pairs_by_depth(front: Any, motions: _Motions, common: dict[str, Any]) -> list[tuple[Pairs, bool]]:
    """Returns pairs of a path, and whether they have depths: pairs of a cloud have none."""
    names, pairs = front._names, common["pairs"]
    clouds = [body.id for body in names.bodies if body.is_cloud]
    if not clouds:
        return [(pairs, True)]
    table = front._table(
        None if pairs is None else names.pairs_array(pairs),
        None if motions.bodies is None else names.bodies_array(list(motions.bodies), "meanwhile"),
        front.joints(common["joints"]).ids,
    )
    is_of_cloud = np.isin(table, clouds).any(axis=1)
    return [(part, has) for part, has in ((table[~is_of_cloud], True), (table[is_of_cloud], False)) if len(part)]


def _deepest_of(r: Result, motions: _Motions, index: int, times: list[float]) -> PathPoint:
    """Returns the deepest row of an answer for some states of a motion, or the first if all bounds are NaN."""
    grown = motions.grown(r, index, times)
    uppers = r.upper if grown is None else r.upper - grown
    k = np.unravel_index(np.argmin(np.where(np.isnan(uppers), math.inf, uppers)), uppers.shape)
    t = times[k[0]]
    point = _point(r, k, index, t, _at(motions.curves[index], t))
    if grown is None or grown[k] == 0:
        return point
    lower, upper = np.nextafter(point.lower - grown[k], -math.inf), np.nextafter(point.upper - grown[k], math.inf)
    if lower < 0 <= point.lower:  # growth alone proves no upper bound on a depth: grown bodies may fill holes
        lower = -math.inf
    return replace(point, lower=float(lower), upper=float(upper))


def _at(curve: np.ndarray, t: float) -> np.ndarray:
    """Returns the positions at a time of a motion with (D + 1, J) control points."""
    while len(curve) > 1:
        curve = curve[:-1] + t * (curve[1:] - curve[:-1])
    return curve[0]


def _contact_times(front: Any, motions: _Motions, index: int, common: dict[str, Any]) -> tuple[float, float]:
    """Returns the times of a motion until which it is proved free, and at which a pair is within its margin."""
    r = front.motions(**motions.of(index, index + 1), fields=_MOTION_FIELDS, **common)
    proved, within = r.first_contact[0].tolist()
    return (0.0 if math.isinf(proved) else proved), within


def _nearest(front: Any, motions: _Motions, common: dict[str, Any]) -> tuple[PathPoint, tuple[float, float]]:
    """Returns the state of the least distance of all motions, and its bounds."""
    lower, nearest = math.inf, None
    for first in range(0, len(motions.curves), _MOST_MOTIONS):
        r = front.motions(**motions.of(first, first + _MOST_MOTIONS), fields=_MOTION_FIELDS, **common)
        lower = min(lower, float(r.lower.min()))
        k = int(np.argmin(r.upper))
        if nearest is None or r.upper[k] < nearest.upper:
            time = float(r.time[k])
            nearest = _point(r, k, first + k, time, _at(motions.curves[first + k], time))
    assert nearest is not None  # a path has a motion
    return nearest, (lower, nearest.upper)


def _point(r: Result, k: Any, index: int, t: float, positions: np.ndarray) -> PathPoint:
    a, b = r.pair[k].tolist()
    segment = np.stack((r.point_a[k], r.point_b[k]))
    names = (r.names[a], r.names[b])
    return PathPoint(index, t, positions, (a, b), names, float(r.lower[k]), float(r.upper[k]), segment)
