"""Whether a robot stops in time: its braking path, and the reach of those who move meanwhile."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Optional

import numpy as np

from .._arguments import to_bool, to_floats, to_items, to_number_from_0
from .._limits import curves_beyond_limits
from .._names import BodyRef, NameTable
from .._words import EVERY_BODY, GROUP_BIT, MARGIN_DTYPE, Field, Status
from .call import ANY, BEYOND, DETAILS, Call, Steps, stopped
from .path import PathCheck
from .query import Query, Run
from .result import Result

_HALVINGS = 8  # of the search for the greatest speed
_UP = 1 + 2.0**-50  # covers the rounding of a few sums and products above 0
_MOST_MOVING = 90  # bodies; a query has 4096 margins, one for each of their pairs

#: Greatest speeds by body or group, metres per second.
Others = Optional[Mapping[BodyRef, float]]
#: A pair of selectors, and the movers that bring it nearer with their speeds.
Moving = tuple[int, int, list[tuple[int, float]]]


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
        if limits.ndim > 1 or not (limits > 0).all():
            raise ValueError(f"deceleration: expected numbers above 0, a number or (J,), got {deceleration!r}")
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
        self._moving: tuple[Optional[NameTable], list[Moving]] = (None, [])
        if self.law.others:
            query.watch(self.margins(0.0, None))

    @classmethod
    def options(cls, arguments: Mapping[str, Any]) -> dict[str, Any]:
        given = dict(arguments)
        law = Braking.of(*(given.pop(name) for name in ("deceleration", "reaction_s", "others", "together")))
        return {**given, **cls.fixed, "braking": law}

    def steps(self, positions: Any = None, velocities: Any = None) -> Steps:
        q, v = (self.row(value, what) for value, what in ((positions, "positions"), (velocities, "velocities")))
        if not np.isfinite(v).all():
            raise ValueError(f"velocities: expected finite numbers, got {v.tolist()}")
        ages = self.ages()
        path, seconds = self.law.path(q, v, 1.0)
        joints = self.query.joints
        assert joints is not None
        check = PathCheck(True, None, None, None, Status.BEYOND, curves_beyond_limits(path, joints))
        run = self._run(path, seconds, ages, self.query.mask or 0)
        answer = yield run, None, _rows(path)
        if answer.all_free():
            return StopCheck(check, 1.0, seconds, path)
        for motion in np.flatnonzero(Result(answer, ANY, run).verdict != BEYOND).tolist():
            details = self._run(path, seconds, ages, DETAILS)
            result = Result((yield details, None, _rows(path[motion : motion + 1])), ANY, details)
            if result.status[0] != BEYOND:
                check = stopped(result, motion, check.limit_violations)
                break
        proved = yield from self._greatest(q, v, ages, 1.0 if check.free else 0.0)
        return StopCheck(check, proved, seconds, path)

    def _greatest(self, q: np.ndarray, v: np.ndarray, ages: list[float], proved: float) -> Steps:
        """Returns the greatest share of the velocities that is proved, by bisection with a proof at each step."""
        beyond = 1.0
        scale = 0.0  # at rest, when others have reached as far as they do before a reaction
        for _ in range(_HALVINGS + 1):
            if proved == beyond:
                break
            path, seconds = self.law.path(q, v, scale)
            answer = yield self._run(path, seconds, ages, self.query.mask or 0), None, _rows(path)
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

    def _run(self, path: np.ndarray, seconds: float, ages: list[float], mask: int) -> Run:
        points = path.shape[1]
        if not self.law.others:
            return self.query.run_of(True, mask, points)
        return self.query.widened(mask, points, self.margins(seconds, ages))

    def ages(self) -> list[float]:
        """Returns the age of each body's pose in seconds, -1 for those without a pose; none if no others move."""
        if not self.law.others:
            return []
        return [-1.0 if state.age_ns is None else 1e-9 * state.age_ns for state in self.query.source.body_states()]

    def margins(self, seconds: float, ages: Optional[list[float]]) -> np.ndarray:
        """Returns margins that contain how far others come in some seconds, and came in the ages of their poses."""
        moving = self._movers()
        rows = np.zeros(1 + len(moving), MARGIN_DTYPE)
        rows["a"], rows["b"], rows["margin"] = EVERY_BODY, EVERY_BODY, self.query.margin
        for row, (a, b, speeds) in zip(rows[1:], moving):
            row["a"], row["b"] = a, b
            for mover, speed in speeds:
                age = 0.0 if ages is None else ages[mover] if mover < len(ages) else -1.0
                if age < 0:
                    raise ValueError(f"others: no pose of {self.query.names.meaning(mover)} has been received")
                row["margin"] = (row["margin"] + speed * (age + seconds)) * _UP
        return rows

    def _movers(self) -> list[Moving]:
        """Returns pairs of selectors, each with the movers that count for it and their speeds; the last pair counts.

        Two that move are a pair of their own, since both may come nearer; what moves both alike does not count.
        """
        names = self.query.names
        if self._moving[0] is not names:
            speeds = {number: speed for body, speed in self.law.others for number in _ids(names, body)}
            found = [(b.id, above) for b in names.bodies if (above := _above(names, b.id, speeds))]
            if len(found) > _MOST_MOVING:
                raise ValueError(f"others: {len(found)} bodies move, followers included; at most {_MOST_MOVING}")
            alone: list[Moving] = [(EVERY_BODY, body, above) for body, above in found]
            both = [
                (a, b, [mover for mover in (*one, *other) if (mover in one) != (mover in other)])
                for (a, one), (b, other) in itertools.combinations(found, 2)
            ]
            self._moving = names, alone + both
        return self._moving[1]


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


def _above(names: NameTable, body: int, speeds: Mapping[int, float]) -> list[tuple[int, float]]:
    """Returns those of the others that a body follows, and itself if it is one, with their speeds."""
    found = []
    at: Optional[int] = body
    while at is not None:
        if at in speeds:
            found.append((at, speeds[at]))
        at = names.bodies[at].parent
    return found


def _rows(path: np.ndarray) -> np.ndarray:
    return path.reshape(-1, path.shape[2])
