"""A motion between two rows of joint positions, in spans with their proofs and deciding pairs."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np

from .._front.front import Front
from .._joints import Joints
from .._query.path_report import PathReport
from .._query.result import Result


class Verdict(Enum):
    """Result of the proof for a span."""

    FREE = "free"  #: every pair is farther than its margin throughout
    HIT = "hit"  #: a pair is within its margin at some time
    OPEN = "undecided"  #: neither is proved


@dataclass(frozen=True)
class Span:
    """A part of an edge, evaluated as a separate motion."""

    begin: float  #: 0 to 1 along the edge
    end: float
    verdict: Verdict
    lower: float  #: metres: certified lower bound of the least distance during the span
    upper: float
    decided_by: tuple[int, int]  #: ids: the pair of the lower bound if free, otherwise the nearest pair
    at: float  #: 0 to 1 along the edge: time of the witness points, or NaN
    segment: np.ndarray  #: (2, 3) witness points, metres, world
    steps: int  #: evaluations of the proof


@dataclass(frozen=True)
class Edge:
    """A straight motion in joint space."""

    joints: Joints
    start: np.ndarray  #: (J,) radians and metres
    end: np.ndarray
    margin: float  #: metres
    whole: Span  #: the whole edge as one motion, as a planner evaluates it
    spans: tuple[Span, ...]  #: its parts, to locate a contact and its pair
    report: PathReport  #: where it is closest, or where and how deep its contact is

    def at(self, t: float) -> np.ndarray:
        """Returns (J,) positions at a time, 0 to 1."""
        return self.start + t * (self.end - self.start)


_FIELDS = ("default", "points", "pair", "pair_lower", "time", "first_contact", "steps")


def certified_edge(
    front: Front,
    joints: Joints,
    start: np.ndarray,
    end: np.ndarray,
    margin: float = 0.0,
    spans: int = 16,
    max_evaluations: int = 256,
) -> Edge:
    """Evaluates the edge from (J,) `start` to `end` and equal spans of it.

    margin: metres >= 0, of every pair. spans: 1 or more. max_evaluations: maximum evaluations of each motion.

    Adjacent spans share one configuration, rounded to float64: the spans are the edge as drawn, `whole` is the exact
    edge. Raises ValueError for spans < 1, and as Front.motions() does.
    """
    if spans < 1:
        raise ValueError(f"spans: expected 1 or more, got {spans}")
    start, end = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
    times = np.linspace(0.0, 1.0, spans + 1)
    rows = start + times[:, None] * (end - start)
    rows[-1] = end
    r = front.motions(
        np.vstack((start, rows[:-1])),
        np.vstack((end, rows[1:])),
        joints,
        margin=margin,
        max_evaluations=max_evaluations,
        fields=_FIELDS,
    )
    whole, *parts = (_span(r, i, *ends) for i, ends in enumerate([(0.0, 1.0), *zip(times[:-1], times[1:])]))
    report = front.explain_path(np.stack((start, end)), joints, margin=margin, max_evaluations=max_evaluations)
    return Edge(joints, start, end, margin, whole, tuple(parts), report)


def _span(r: Result, i: int, begin: float, end: float) -> Span:
    """Converts row i of an answer, for the motion between two times."""
    proved, within = r.first_contact[i].tolist()
    verdict = Verdict.FREE if math.isinf(proved) else Verdict.OPEN if math.isinf(within) else Verdict.HIT
    a, b = (r.pair_lower if verdict is Verdict.FREE else r.pair)[i].tolist()
    at = float(begin + r.time[i] * (end - begin))
    points = np.stack((r.point_a[i], r.point_b[i]))
    return Span(
        float(begin), float(end), verdict, float(r.lower[i]), float(r.upper[i]), (a, b), at, points, int(r.steps[i])
    )
