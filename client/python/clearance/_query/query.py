"""Parsed arguments of queries, with errors that name the argument, and their meaning in a scene that changes."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any, Callable, Optional, Protocol

import numpy as np

from .._arguments import to_bool, to_floats, to_number_from_0
from .._errors import QueryError, StaleQuery
from .._joints import Joints, JointTable
from .._names import NameTable, has_selectors
from .._words import MARGIN_DTYPE
from .conversions import one_each, options_of, own, some
from .meanwhile import BodyPath, to_body_paths
from .result import fields_mask

#: Bit in addition to those of columns: the engine adds points and normal if there are few rows.
POINTS_BY_DEFAULT = 1 << 31


class Source(Protocol):
    """The members of an Engine or a Client that queries use."""

    _module: Any

    @property
    def _names(self) -> NameTable: ...
    @property
    def _joint_table(self) -> JointTable: ...
    def _default_fields(self, query: Query, moves: bool, count: int) -> int: ...
    def _table(
        self, pairs: Optional[np.ndarray], bodies: Optional[np.ndarray], joints: Optional[np.ndarray] = None
    ) -> np.ndarray: ...
    def _scene_revision(self) -> int: ...
    def body_states(self) -> list[Any]: ...


_SPEED_ERRORS = "one number for each joint and two for each body"


class Query:
    """The arguments of a call without its configurations. Thread-safe."""

    names: NameTable  #: of the scene of its ids
    pairs: Optional[np.ndarray]  #: (P, 2) selectors, read-only
    selects: bool  #: whether an entry of `pairs` selects several pairs
    bodies: Optional[np.ndarray]  #: (M,) ids that configurations move, if the caller named them
    joints: Optional[Joints]  #: that configurations move
    reduce: int
    mask: Optional[int]  #: bits of its columns; None for those by default
    timeout_s: Optional[float]
    copy: bool
    weights: Optional[np.ndarray]  #: (J,) of free_scale
    braking: Any  #: of check_stop
    speed_errors: Optional[np.ndarray]  #: (J + 2 M,) of rate_bounds

    def __init__(self, source: Source, call: str, arguments: Mapping[str, Any]):
        self.source = source
        names = self.names = source._names
        given = dict(arguments)
        pairs, bodies, joints = (given.pop(name, None) for name in ("pairs", "bodies", "joints"))
        meanwhile = given.pop("meanwhile", None)
        self.meanwhile: Optional[dict[Any, BodyPath]] = None
        if meanwhile is not None:
            self.meanwhile = to_body_paths(meanwhile)
            if joints is None:
                raise ValueError("meanwhile: expected joints that move along the path, got none")
            if bodies is not None:
                raise ValueError("bodies: expected none, since meanwhile names those that move, got some")
            bodies = list(self.meanwhile)
        self.pairs = None if pairs is None else own(names.pairs_array(pairs))
        self.selects = self.pairs is not None and has_selectors(self.pairs)
        self.bodies = None if bodies is None else some(own(names.bodies_array(bodies, "bodies")), "bodies")
        self._movable = names.movable
        self.joints = None if joints is None else _joints_of(source, joints)
        self.joint_count = 0 if self.joints is None else len(self.joints)
        fields, timeout_s = given.pop("fields", None), given.pop("timeout_s", None)
        self.mask = None if fields is None else fields_mask(fields)
        self.timeout_s = None if timeout_s is None else to_number_from_0(timeout_s, "timeout_s")
        self.copy = to_bool(given.pop("copy", True), "copy")
        weights = given.pop("weights", None)
        self.weights = None if weights is None else one_each(weights, "weights", "one number for each joint")
        self.braking = given.pop("braking", None)  # of check_stop
        errors = given.pop("speed_errors", None)
        self.speed_errors = None if errors is None else one_each(errors, "speed_errors", _SPEED_ERRORS)
        self._take_margin(given)
        self._options = dict(options_of(source._module.OPTIONS, call, given))
        self.reduce = self._options.get("reduce", 0)
        self._runs: dict[tuple[bool, int, int], Run] = {}
        self.rows_each: dict[bool, int] = {}  #: rows of one configuration, cached by the source

    def _take_margin(self, given: dict[str, Any]) -> None:
        self._margins = self._pair_margins = None
        margin = given.get("margin")
        if isinstance(margin, Mapping):
            self._margins = self.names.margins_array(margin)
        elif isinstance(margin, (np.ndarray, list, tuple)) and np.ndim(margin) > 0:
            each = to_floats(margin, "margin", "a number, one for each pair, or a dict of pairs")
            if each.ndim != 1 or not len(each):
                raise ValueError(f"margin: expected one number for each pair, got shape {each.shape}")
            self._pair_margins = each.copy()
        else:
            return
        del given["margin"]

    @property
    def margin(self) -> float:
        return self._options.get("margin", 0.0)

    @property
    def has_margins(self) -> bool:
        """Whether pairs have margins of their own."""
        return self._margins is not None or self._pair_margins is not None

    def watch(self, margins: np.ndarray) -> None:
        """Takes margins whose ids must keep their meaning, those of the runs being others."""
        self._margins = margins

    @property
    def max_results(self) -> int:
        return self._options.get("max_results", self.source._module.OPTIONS["max_results"][2])

    def moved(self, moves: bool) -> tuple[Optional[np.ndarray], Optional[np.ndarray]]:
        """Returns the ids of bodies and joints that configurations move."""
        if not moves:
            return None, None
        if self.joints is not None:
            return self.bodies, self.joints.ids
        return some(self._movable, "bodies") if self.bodies is None else self.bodies, None

    def run(self, moves: bool, count: int, points: int = 2) -> Run:
        """Returns the query for the current poses, or for `count` configurations, or motions of some control points."""
        mask = self.source._default_fields(self, moves, count) if self.mask is None else self.mask
        return self.run_of(moves, mask, points)

    def run_of(self, moves: bool, mask: int, points: int = 2) -> Run:
        """Returns the query with these columns."""
        run = self._runs.get((moves, mask, points))
        return self.with_columns(moves, mask, points) if run is None else run

    def with_columns(self, moves: bool, mask: int, points: int = 2) -> Run:
        """Returns the query with these columns, and keeps it for run()."""
        run = self._runs[moves, mask, points] = self.made(moves, mask, points)
        return run

    def run_growing(self, count: int, points: int, growths: Optional[np.ndarray], mask: Optional[int] = None) -> Run:
        """Returns the query for motions, in which bodies grow if there are growths: (..., M) metres."""
        run = self.run(True, count, points) if mask is None else self.run_of(True, mask, points)
        return run if growths is None else self.growing(run.mask, points, growths.reshape(-1, growths.shape[-1]))

    def growing(self, mask: int, points: int, growths: np.ndarray) -> Run:
        """Returns the query with these columns, for one run in which bodies grow. growths: (K, M) metres."""
        run = self.made(True, mask, points)
        run.raw.set_growths(growths)
        run.growths = growths
        return run

    def widened(self, mask: int, points: int, margins: Callable[[], np.ndarray]) -> Run:
        """Returns the query with these columns, for one run with margins of its own.

        margins: makes them, (E,) MARGIN_DTYPE; called again if the scene has changed.
        """
        run = self.made(True, mask, points)
        run.raw.set_margins(margins().view(np.uint8).reshape(-1, MARGIN_DTYPE.itemsize))
        run.margins = margins
        return run

    def made(self, moves: bool, mask: int, points: int = 2) -> Run:
        """Returns the query with these columns."""
        names = self.names
        bodies, joints = self.moved(moves)
        module = self.source._module
        raw = module.Query(self.pairs, bodies, joints, names.revision)
        for name, value in self._options.items():
            setattr(raw, name, value)
        raw.fields = mask & ~POINTS_BY_DEFAULT
        raw.control_points = points
        if mask & POINTS_BY_DEFAULT:
            raw.points_by_default = True
        if self._margins is not None:
            raw.set_margins(self._margins.view(np.uint8).reshape(-1, MARGIN_DTYPE.itemsize))
        if self._pair_margins is not None:
            raw.set_pair_margins(self._pair_margins)
        if self.weights is not None:
            raw.set_weights(self.weights)
        if self.speed_errors is not None:
            raw.set_speed_errors(self.speed_errors)
        if moves and self.joints is not None:
            raw.set_limits(self.joints.lower, self.joints.upper)
        return Run(self, raw, mask, names, bodies, joints, points)

    # ---- the scene changes ----------------------------------------------------------------------------------------

    @property
    def k(self) -> int:
        return self._options.get("k", 0)

    def renew(self) -> None:
        """Adopts the current scene. Raises StaleQuery if the query's ids mean something else in it."""
        names = self.source._names
        if names.revision != self.names.revision:
            if change := self._changed_in(names):
                raise StaleQuery(2, f"{change}; prepare the query again")
            self.joints = None if self.joints is None else self.source._joint_table.joints(self.joints.ids)
            self._runs = {}
            self.rows_each = {}
        self.names = names

    def _changed_in(self, now: NameTable) -> str:
        """Returns the first difference in the meaning of the query's ids, or an empty string."""
        moved = self._movable if self.bodies is None and self.joints is None else self.bodies
        if self.bodies is None and not any(moves for moves, *_ in list(self._runs)):
            moved = None  # no configurations yet
        for body in [] if moved is None else moved.tolist():
            was, is_now = self.names.parent(body), now.parent(body)
            if was != is_now:
                return f"bodies: the parent of {self.names.meaning(body)} was {was}, and is now {is_now}"
        for selector in self._selectors(moved):
            was, is_now = self.names.meaning(selector), now.meaning(selector)
            if was != is_now:
                return f"the scene has changed: id {selector} was {was}, and is now {is_now}"
        if self.joints is not None:
            table = self.source._joint_table
            for joint, name in zip(self.joints.ids.tolist(), self.joints.names):
                is_now = table.names[joint] if joint < len(table.names) else "none"
                if name != is_now:
                    return f"the scene has changed: joint {joint} was {name!r}, and is now {is_now!r}"
        if self._pair_margins is not None and (self.pairs is None or self.selects):
            return "margin: one number for each pair, and the scene's pairs have changed"
        return ""

    def _selectors(self, moved: Optional[np.ndarray]) -> list[int]:
        margins = () if self._margins is None else (self._margins["a"], self._margins["b"])
        ids = [ids.ravel() for ids in (self.pairs, moved, *margins) if ids is not None]
        return np.unique(np.concatenate(ids)).tolist() if ids else []


class Run:
    """A query with certain columns, in one revision of the scene; results take their pairs and names from it.

    Refers to no Query, since a cycle would keep the arrays of each one-off call until the next garbage collection.
    """

    __slots__ = (
        "source", "raw", "mask", "names", "pairs", "selects", "bodies", "joints", "points", "growths", "reduce",
        "timeout_s", "copy", "speeds", "k", "margins",
    )  # fmt: skip

    def __init__(
        self,
        query: Query,
        raw: Any,
        mask: int,
        names: NameTable,
        bodies: Optional[np.ndarray],
        joints: Optional[np.ndarray],
        points: int = 2,
    ):
        self.raw, self.mask, self.names, self.bodies, self.joints = raw, mask, names, bodies, joints
        self.points = points  # of each motion
        self.growths: Optional[np.ndarray] = None  # of this run alone
        self.margins: Optional[Callable[[], np.ndarray]] = None  # likewise
        self.speeds: Optional[tuple[Optional[np.ndarray], Optional[np.ndarray]]] = None  # flat velocities and twists
        self.source, self.pairs, self.selects = query.source, query.pairs, query.selects
        self.reduce, self.timeout_s, self.copy, self.k = query.reduce, query.timeout_s, query.copy, query.k

    def at_speeds(self, velocities: Optional[np.ndarray], twists: Optional[np.ndarray]) -> Run:
        """Returns the query at these velocities of joints and twists of bodies."""
        run = copy.copy(self)
        run.speeds = velocities, twists
        run.raw = self.raw.at_velocities(velocities, twists)
        return run

    def pairs_at(self, revision: int) -> np.ndarray:
        """Returns (P, 2) body ids of an answer for a revision of the scene."""
        if self.pairs is not None and not self.selects:
            return self.pairs
        table = self.source._table(self.pairs, self.bodies, self.joints)
        if self.source._scene_revision() != revision:
            raise QueryError(2, "pairs: the scene has changed since this answer; read pairs before changing it")
        return table

    def body_names(self) -> tuple[str, ...]:
        return self.names.body_names


def _joints_of(source: Source, joints: Any) -> Joints:
    table = source._joint_table
    ids = some(own(table.ids_of(joints, "joints")), "joints")
    return table.joints(ids)
