"""A motion between two rows of joint positions, in spans: which are proved free, and which pair decided each."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np

from .._front import Front
from .._joints import Joints
from .._result import Result
from .model import as_planner


class Verdict(Enum):
    """What is proved of a span."""

    FREE = "free"  #: every pair is farther than its margin all along
    HIT = "hit"  #: some pair is within its margin at some time
    OPEN = "undecided"  #: neither


@dataclass(frozen=True)
class Span:
    """A part of an edge, asked about as a motion of its own."""

    begin: float  #: 0 to 1 along the edge
    end: float
    verdict: Verdict
    lower: float  #: metres: certified, of the least distance during the span
    upper: float
    decided_by: tuple[int, int]  #: ids: the pair that the lower bound is of where free, else the nearest
    at: float  #: 0 to 1 along the edge: when its witness points are so near; NaN: there are none
    segment: np.ndarray  #: (2, 3) those points, metres, world
    steps: int  #: configurations that the proof asked for


@dataclass(frozen=True)
class Edge:
    """A motion in a straight line in joint space."""

    joints: Joints
    start: np.ndarray  #: (J,) radians and metres
    end: np.ndarray
    margin: float  #: metres
    whole: Span  #: the edge itself, as one motion: what a planner would be told
    spans: tuple[Span, ...]  #: its parts, which say where and by whom

    def at(self, t: float) -> np.ndarray:
        """(J,) positions at a time, 0 to 1."""
        return self.start + t * (self.end - self.start)


_FIELDS = ("default", "points", "pair", "pair_lower", "time", "first_contact", "steps")


def certified_edge(
    front: Front,
    joints: Joints,
    start: np.ndarray,
    end: np.ndarray,
    margin: float = 0.0,
    spans: int = 16,
    max_steps: int = 256,
) -> Edge:
    """Asks about the edge from (J,) `start` to `end`, and about equal spans of it, all in one question.

    margin: metres >= 0, of every pair. spans: 1 or more. max_steps: of each motion.

    Where two spans meet stands the same configuration, rounded to float64: the spans are the edge as it is drawn, and
    `whole` is the edge as it was given. Raises ValueError for spans < 1, and as Front.motions() does.
    """
    if spans < 1:
        raise ValueError(f"spans: expected 1 or more, got {spans}")
    start, end = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
    times = np.linspace(0.0, 1.0, spans + 1)
    rows = start + times[:, None] * (end - start)
    rows[-1] = end
    asked = {"margin": margin, "reduce": "min", "max_steps": max_steps, "fields": _FIELDS, **as_planner(front)}
    r = front.motions(joints, np.vstack((start, rows[:-1])), np.vstack((end, rows[1:])), **asked)
    whole, *parts = (_span(r, i, *ends) for i, ends in enumerate([(0.0, 1.0), *zip(times[:-1], times[1:])]))
    return Edge(joints, start, end, margin, whole, tuple(parts))


def _span(r: Result, i: int, begin: float, end: float) -> Span:
    """Row i of an answer, which is of the motion from one time to another."""
    proved, within = r.first_contact[i].tolist()
    verdict = Verdict.FREE if math.isinf(proved) else Verdict.OPEN if math.isinf(within) else Verdict.HIT
    a, b = (r.pair_lower if verdict is Verdict.FREE else r.pair)[i].tolist()
    at = float(begin + r.time[i] * (end - begin))
    points = np.stack((r.point_a[i], r.point_b[i]))
    return Span(
        float(begin), float(end), verdict, float(r.lower[i]), float(r.upper[i]), (a, b), at, points, int(r.steps[i])
    )
