"""What a picture shows: shapes of bodies, where they are, and what an Engine or a Client answers about them."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Optional

import numpy as np

from .._front import BodyState, Front
from .._joints import Joints
from .._words import NONE, Status
from .shapes import Shape, shape_of, unknown_shape

if TYPE_CHECKING:
    from .._scene import Scene

_FIELDS = ("default", "points", "pair", "pair_lower", "flags")
_MOST_RESULTS = 10_000  # pairs that a question brings; of these the nearest are shown


@dataclass(frozen=True)
class Question:
    """What is asked each time."""

    kind: Literal["within", "nearest"] = "within"  #: pairs that may be nearer than max_distance; or each body's nearest
    max_distance: float = 0.25  #: metres, of "within"
    most_rows: int = 100  #: shown, the nearest of them


@dataclass(frozen=True)
class Picture:
    """One answer, with all that a page shows of it."""

    names: tuple[str, ...]  #: of the N bodies, by id
    poses: np.ndarray  #: (N, 7) X_wb, metres; meaningful where `placed`
    placed: np.ndarray  #: (N,) bool
    ages_s: np.ndarray  #: (N,) seconds since each pose was received; NaN: never was
    pairs: np.ndarray  #: (R, 2) ids of a row's bodies, the nearest pair first
    status: np.ndarray  #: (R,) of clearance.Status
    flags: np.ndarray  #: (R,) bits of clearance.Flag
    lower: np.ndarray  #: (R,) metres, certified
    upper: np.ndarray  #: (R,) metres, certified
    segments: np.ndarray  #: (R, 2, 3) witness points on a and on b, metres, world; NaN: there are none
    total: int  #: pairs found, also those past most_rows
    took_s: float  #: from the call to the answer
    engine_s: float  #: of that in the engine
    pose_age_s: float  #: of the oldest pose that the answer saw; NaN: none was received
    scene_revision: int
    pose_revision: int

    @property
    def overlapping(self) -> np.ndarray:
        """(N,) bool: bodies of a row whose overlap is proved."""
        marked = np.zeros(len(self.names), dtype=bool)
        marked[self.pairs[self.status == Status.OVERLAP].reshape(-1)] = True
        return marked

    @property
    def drawn(self) -> np.ndarray:
        """(R,) bool: rows with a segment."""
        return np.isfinite(self.segments).all(axis=(1, 2))


@dataclass(frozen=True)
class WhatIf:
    """Joints somewhere else than they are: asked about, and not moved."""

    joints: Joints
    positions: np.ndarray  #: (J,) radians and metres


def look(front: Front, question: Question, what_if: Optional[WhatIf] = None) -> Picture:
    """Asks once, and gives all that the picture of the answer needs.

    Poses are read just before the question is answered: of bodies that move meanwhile they may be a little older than
    the answer, whose segments and bounds are of one snapshot. Raises as Front.distances() does.
    """
    states: Sequence[BodyState] = front.body_states()  # type: ignore[attr-defined]  # both have it, of their own
    names = tuple(body.name for body in front.bodies)
    asked = as_planner(front)
    if question.kind == "within":
        asked |= {"reduce": "within", "max_distance": question.max_distance, "max_results": _MOST_RESULTS}
    else:
        asked["reduce"] = "nearest"
    if what_if is not None:
        asked |= {"joints": what_if.joints, "positions": np.atleast_2d(what_if.positions)}
    began = time.perf_counter()
    r = front.distances(("*", "*"), fields=_FIELDS, **asked)
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


def as_planner(front: Front) -> dict[str, Any]:
    """The option by which a daemon's controllers come first, whatever class this client has."""
    return {"as_planning": True} if front._waits else {}


def _rows(pairs: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Places of the rows that have a pair, each pair once, the nearest first."""
    there = np.flatnonzero((pairs != NONE).all(axis=1))
    _, first = np.unique(np.sort(pairs[there], axis=1), axis=0, return_index=True)
    once = there[first]
    return once[np.lexsort((pairs[once, 1], pairs[once, 0], lower[once], upper[once]))]


def shapes_of(front: Front, scene: Optional[Scene]) -> list[Shape]:
    """The shape of each body of `front`: that of the scene's body of the same name, else the ball that holds it."""
    known = {} if scene is None else {body.name: body for body in scene.bodies}
    return [
        shape_of(scene, known[body.name]) if scene is not None and body.name in known else unknown_shape(body)
        for body in front.bodies
    ]


def all_joints(front: Front) -> Optional[Joints]:
    """Every joint of the scene's robots; None: there are none."""
    count = len(front.joint_states())
    return front.joints(np.arange(count, dtype=np.uint32)) if count else None


def positions_now(front: Front) -> np.ndarray:
    """(J,) where each joint is, by id; one without a position counts as 0, or as its limit that is nearest to 0."""
    states = front.joint_states()
    joints = front.joints(np.arange(len(states), dtype=np.uint32))
    rest = np.clip(0.0, *slider_range(joints))
    return np.array([s.position if s.status == Status.OK else zero for s, zero in zip(states, rest.tolist())])


def slider_range(joints: Joints) -> tuple[np.ndarray, np.ndarray]:
    """(J,) each: the limits of joints, and a turn about 0 for those that have none."""
    limited = np.isfinite(joints.lower) & np.isfinite(joints.upper)
    return np.where(limited, joints.lower, -math.pi), np.where(limited, joints.upper, math.pi)
