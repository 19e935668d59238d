"""Whether a robot stops in time: its braking path, and the reach of those who move meanwhile."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Optional

import numpy as np

from .._arguments import to_bool, to_floats, to_items, to_number_from_0
from .._names import BodyRef, NameTable
from .._words import EVERY_BODY, GROUP_BIT, MARGIN_DTYPE, Field, Status
from .call import ANY, BEYOND, DETAILS, Call, Steps, stopped
from .limits import curves_beyond_limits
from .movers import Movers
from .path import PathCheck
from .query import Query, Run
from .result import Result

_HALVINGS = 8  # of the search for the greatest speed
_UP = 1 + 2.0**-50  # covers the rounding of a few sums and products above 0

#: Greatest speeds by body or group, metres per second.
Others = Optional[Mapping[BodyRef, float]]


@dataclass(frozen=True)
class StopCheck:
    """Whether a robot stops in time. As a bool, as its check: free, and within the joints' limits."""

    check: PathCheck  #: the braking path at full speed, as check_path() describes a path
    #: Greatest proved share of the velocities, 0 to 1, which the robot may be commanded. 0 if no speed is proved: rest
    #: may be proved or not.
    speed_scale: float
    seconds: float  #: from now to standstill at full speed
    #: (K, D + 1, J) Bezier control points of the braking path at full speed, rounded: that path was checked.
    path: np.ndarray

    def __bool__(self) -> bool:
        return bool(self.check)


@dataclass(frozen=True)
class Braking:
    """How a robot brakes, and who moves meanwhile."""

    deceleration: np.ndarray  #: (J,) or () rad/s^2 and m/s^2, above 0
    reaction_s: float
    others: tuple[tuple[BodyRef, float], ...]
    together: bool

    @classmethod
    def of(cls, deceleration: Any, reaction_s: Any, others: Others, together: Any) -> Braking:
        """Converts arguments of check_stop()."""
        limits = to_floats(deceleration, "deceleration", "a number, or (J,) numbers")
        if limits.ndim > 1 or not ((limits > 0) & np.isfinite(limits)).all():
            raise ValueError(f"deceleration: expected finite numbers above 0, a number or (J,), got {deceleration!r}")
        reaction = to_number_from_0(reaction_s, "reaction_s")
        if math.isinf(reaction):
            raise ValueError("reaction_s: expected a finite number, got inf")
        speeds = []
        for body, speed in to_items({} if others is None else others, "others", "a dict of speeds by body or group"):
            number = to_number_from_0(speed, f"others[{body!r}]")
            if math.isinf(number):
                raise ValueError(f"others[{body!r}]: expected a finite number, got inf")
            speeds.append((body, number))
        return cls(limits.copy(), reaction, tuple(speeds), to_bool(together, "together"))

    def path(self, q: np.ndarray, velocities: np.ndarray, scale: float) -> tuple[np.ndarray, float]:
        """Returns control points of the braking path from a share of the velocities, and the seconds to standstill."""
        v = scale * velocities
        stops = np.abs(v) / self.deceleration
        last = float(stops.max())
        seconds = (self.reaction_s + last) * _UP
        if self.together:
            return np.stack((q, q + v * ((self.reaction_s + 0.5 * last) * _UP)))[None], seconds
        times = np.unique(np.r_[0.0, self.reaction_s, self.reaction_s + stops])
        if len(times) == 1:
            return np.stack((q, q))[None], seconds
        braked = np.minimum(np.maximum(times[:, None] - self.reaction_s, 0.0), stops)
        slow = np.sign(v) * self.deceleration
        at = q + v * (np.minimum(times, self.reaction_s)[:, None] + braked) - 0.5 * slow * braked**2
        speed = np.where(braked < stops, v - slow * braked, 0.0)
        middle = at[:-1] + 0.5 * speed[:-1] * np.diff(times)[:, None]
        return np.stack((at[:-1], middle, at[1:]), axis=1), seconds


class Stops(Call):
    """check_stop(): decisions about braking paths, whose margins contain the reach of others until standstill."""

    inputs = ("positions", "velocities")
    fixed: ClassVar = {"reduce": "any", "fields": int(Field.VERDICT), "max_evaluations": 256}

    def __init__(self, query: Query):
        super().__init__(query)
        if query.joints is None:
            raise ValueError("joints: expected some, that move")
        if query.has_margins:
            raise TypeError("margin: expected a number, since others move")
        self.law: Braking = query.braking
        if self.law.deceleration.ndim and len(self.law.deceleration) != query.joint_count:
            raise ValueError(f"deceleration: expected ({query.joint_count},), got {self.law.deceleration.shape}")
        self._speeds: tuple[Optional[NameTable], dict[int, float]] = (None, {})
        if self.law.others:
            query.watch(np.array([(body, body, 0.0) for body in self.speeds()], MARGIN_DTYPE))

    @classmethod
    def options(cls, arguments: Mapping[str, Any]) -> dict[str, Any]:
        given = dict(arguments)
        law = Braking.of(*(given.pop(name) for name in ("deceleration", "reaction_s", "others", "together")))
        return {**given, **cls.fixed, "braking": law}

    def steps(self, positions: Any = None, velocities: Any = None) -> Steps:
        q, v = (self.row(value, what) for value, what in ((positions, "positions"), (velocities, "velocities")))
        if not np.isfinite(v).all():
            raise ValueError(f"velocities: expected finite numbers, got {v.tolist()}")
        path, seconds = self.law.path(q, v, 1.0)
        reach, joints = _Reach(self), self.query.joints
        assert joints is not None
        check = PathCheck(True, None, None, None, Status.BEYOND, curves_beyond_limits(path, joints))
        run = self._run(path, reach, seconds, self.query.mask or 0)
        answer = yield run, None, _rows(path)
        if answer.all_free():
            return StopCheck(check, 1.0, seconds, path)
        for motion in np.flatnonzero(Result(answer, ANY, run).verdict != BEYOND).tolist():
            details = self._run(path, reach, seconds, DETAILS)
            result = Result((yield details, None, _rows(path[motion : motion + 1])), ANY, details)
            if result.status[0] != BEYOND:
                check = stopped(result, motion, check.limit_violations)
                break
        proved = yield from self._greatest(q, v, reach, 1.0 if check.free else 0.0)
        return StopCheck(check, proved, seconds, path)

    def _greatest(self, q: np.ndarray, v: np.ndarray, reach: _Reach, proved: float) -> Steps:
        """Returns the greatest share of the velocities that is proved, by bisection with a proof at each step."""
        beyond = 1.0
        scale = 0.0  # at rest, when others have reached as far as they do before a reaction
        for _ in range(_HALVINGS + 1):
            if proved == beyond:
                break
            path, seconds = self.law.path(q, v, scale)
            answer = yield self._run(path, reach, seconds, self.query.mask or 0), None, _rows(path)
            if answer.all_free():
                proved = scale
            elif scale == 0.0:
                break
            else:
                beyond = scale
            scale = 0.5 * (proved + beyond)
        return proved

    def row(self, value: Any, what: str) -> np.ndarray:
        if value is None:
            raise ValueError(f"{what}: expected (J,) numbers, got none")
        row = to_floats(value, what, "(J,) numbers")
        if row.shape != (self.query.joint_count,):
            raise ValueError(
                f"{what}: expected shape ({self.query.joint_count},), a number for each joint, got {row.shape}"
            )
        return row

    def _run(self, path: np.ndarray, reach: _Reach, seconds: float, mask: int) -> Run:
        points = path.shape[1]
        if not self.law.others:
            return self.query.run_of(True, mask, points)
        return self.query.widened(mask, points, lambda: reach.movers().margins(seconds, self.query.margin))

    def movers(self) -> Movers:
        """Returns who moves and what follows them now."""
        return Movers(self.speeds(), self.query.source.body_states(), self.query.names)

    def speeds(self) -> dict[int, float]:
        """Returns the greatest speed of each of the others, by id."""
        names = self.query.names
        if self._speeds[0] is not names:
            speeds: dict[int, float] = {}
            for body, speed in self.law.others:
                speeds.update((i, max(speed, speeds.get(i, 0.0))) for i in _ids(names, body))
            self._speeds = names, speeds
        return self._speeds[1]


class _Reach:
    """The movers of one call: found once, and again if the scene changes meanwhile."""

    def __init__(self, stops: Stops):
        self._stops = stops
        self._found: tuple[Optional[NameTable], Optional[Movers]] = (None, None)

    def movers(self) -> Movers:
        names, movers = self._found
        if movers is None or names is not self._stops.query.names:
            movers = self._stops.movers()
            self._found = self._stops.query.names, movers
        return movers


def _ids(names: NameTable, body: BodyRef) -> list[int]:
    """Returns the id of a body, or those of a group."""
    selector = names.selector(body, "others")
    if selector == EVERY_BODY:
        raise ValueError("others: expected bodies and groups, got '*'")
    if selector & GROUP_BIT:
        return list(names.groups[names.group_names[selector & ~GROUP_BIT]].tolist())
    if selector >= len(names.bodies):
        raise ValueError(f"others: no body has the id {selector}")
    return [selector]


def _rows(path: np.ndarray) -> np.ndarray:
    return path.reshape(-1, path.shape[2])
