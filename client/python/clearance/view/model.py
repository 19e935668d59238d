"""Contents of a picture: shapes and poses of bodies, and the answers of an Engine or a Client."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Optional

import numpy as np

from .._front.front import BodyState, Front
from .._joints import Joints
from .._words import NONE, Status
from .shapes import Shape, shape_of, unknown_shape

if TYPE_CHECKING:
    from .._scene.scene import Scene

_FIELDS = ("default", "points", "pair", "pair_lower", "flags")
_MOST_RESULTS = 10_000  # maximum pairs of a query, of which the nearest are shown


@dataclass(frozen=True)
class ViewQuery:
    """The query of every picture."""

    kind: Literal["within", "nearest"] = "within"  #: pairs that may be nearer than max_distance, or each body's nearest
    max_distance: float = 0.25  #: metres, for "within"
    most_rows: int = 100  #: maximum number of rows shown, the nearest ones


@dataclass(frozen=True)
class Picture:
    """One answer with everything that the page shows."""

    names: tuple[str, ...]  #: names of the N bodies, by id
    poses: np.ndarray  #: (N, 7) X_wb, metres; valid where `placed`
    placed: np.ndarray  #: (N,) bool
    ages_s: np.ndarray  #: (N,) seconds since each pose was received, or NaN
    pairs: np.ndarray  #: (R, 2) ids of a row's bodies, the least lower bound first
    status: np.ndarray  #: (R,) of clearance.Status
    flags: np.ndarray  #: (R,) bits of clearance.Flag
    lower: np.ndarray  #: (R,) metres, certified
    upper: np.ndarray  #: (R,) metres, certified
    segments: np.ndarray  #: (R, 2, 3) witness points on a and b, metres, world, or NaN
    total: int  #: pairs found, including those past most_rows
    took_s: float  #: time from the call to the answer
    engine_s: float  #: part of that time in the engine
    pose_age_s: float  #: age of the oldest pose of the answer, or NaN
    scene_revision: int
    pose_revision: int

    @property
    def overlapping(self) -> np.ndarray:
        """(N,) bool: bodies of the rows with a proved overlap."""
        marked = np.zeros(len(self.names), dtype=bool)
        marked[self.pairs[self.status == Status.OVERLAP].reshape(-1)] = True
        return marked

    @property
    def drawn(self) -> np.ndarray:
        """(R,) bool: rows with a segment."""
        return np.isfinite(self.segments).all(axis=(1, 2))


@dataclass(frozen=True)
class WhatIf:
    """Hypothetical joint positions for a query, which moves no joints."""

    joints: Joints
    positions: np.ndarray  #: (J,) radians and metres


def look(front: Front, question: ViewQuery, what_if: Optional[WhatIf] = None) -> Picture:
    """Runs one query and returns the picture of its answer.

    Reads the poses just before the query, so that those of moving bodies can be slightly older than the answer.
    Segments and bounds are from one snapshot. Raises as Front.distances() does.
    """
    states: Sequence[BodyState] = front.body_states()  # type: ignore[attr-defined]  # both have it, of their own
    names = tuple(body.name for body in front.bodies)
    requested: dict[str, Any] = {"pairs": ("*", "*"), "fields": _FIELDS}
    if question.kind == "within":
        requested |= {"reduce": "within", "max_distance": question.max_distance, "max_results": _MOST_RESULTS}
    else:
        requested["reduce"] = "nearest"
    if what_if is not None:
        requested["joints"] = what_if.joints
    query = front.prepare("distances", **requested)
    began = time.perf_counter()
    r = query.run(None if what_if is None else np.atleast_2d(what_if.positions))
    took = time.perf_counter() - began

    pairs = r.pairs.reshape(-1, 2)
    rows = _rows(pairs, r.lower.reshape(-1), r.upper.reshape(-1))
    shown = rows[: question.most_rows]
    points = [column.reshape(-1, 3)[shown] for column in (r.point_a, r.point_b)]
    return Picture(
        names=names,
        poses=np.array([state.pose for state in states]).reshape(-1, 7),
        placed=np.array([state.status == Status.OK for state in states], dtype=bool),
        ages_s=np.array([math.nan if s.age_ns is None else s.age_ns * 1e-9 for s in states]),
        pairs=pairs[shown],
        status=r.status.reshape(-1)[shown],
        flags=r.flags.reshape(-1)[shown],
        lower=r.lower.reshape(-1)[shown],
        upper=r.upper.reshape(-1)[shown],
        segments=np.stack(points, axis=1),
        total=r.total if question.kind == "within" else len(rows),
        took_s=took,
        engine_s=r.engine_ns * 1e-9,
        pose_age_s=math.nan if r.pose_age_ns < 0 else r.pose_age_ns * 1e-9,
        scene_revision=r.scene_revision,
        pose_revision=r.snapshot_revision,
    )


def _rows(pairs: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Returns the indices of rows with a pair, each pair once, by their lower bounds."""
    there = np.flatnonzero((pairs != NONE).all(axis=1))
    _, first = np.unique(np.sort(pairs[there], axis=1), axis=0, return_index=True)
    once = there[first]
    return once[np.lexsort((pairs[once, 1], pairs[once, 0], upper[once], lower[once]))]


def shapes_of(front: Front, scene: Optional[Scene]) -> list[Shape]:
    """Returns the shape of each body of `front`: that of the scene's body of that name, or its bounding ball."""
    known = {} if scene is None else {body.name: body for body in scene.bodies}
    return [
        shape_of(scene, known[body.name]) if scene is not None and body.name in known else unknown_shape(body)
        for body in front.bodies
    ]


def all_joints(front: Front) -> Optional[Joints]:
    """Returns every joint of the scene's robots, or None."""
    count = len(front.joint_states())
    return front.joints(np.arange(count, dtype=np.uint32)) if count else None


def positions_now(front: Front) -> np.ndarray:
    """Returns (J,) current positions by id; 0, clamped to the limits, for a joint without a position."""
    states = front.joint_states()
    joints = front.joints(np.arange(len(states), dtype=np.uint32))
    rest = np.clip(0.0, *slider_range(joints))
    return np.array([s.position if s.status == Status.OK else zero for s, zero in zip(states, rest.tolist())])


def slider_range(joints: Joints) -> tuple[np.ndarray, np.ndarray]:
    """Returns the limits of joints, (J,) each, or a full turn around 0 for joints without limits."""
    limited = np.isfinite(joints.lower) & np.isfinite(joints.upper)
    return np.where(limited, joints.lower, -math.pi), np.where(limited, joints.upper, math.pi)
