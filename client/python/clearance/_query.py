"""Parsing of the arguments of distances() into a query, with errors that name the argument."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Optional

import numpy as np

from ._arguments import to_bool, to_count, to_floats, to_number, to_number_from_0, to_option, to_word
from ._joints import JointTable
from ._names import NameTable, has_selectors
from ._poses import as_pose7
from ._result import fields_mask, out_arrays
from ._words import COLUMNS, EVERY_BODY, FIELD_COUNT, MARGIN_DTYPE, MODELS, PRECISIONS, REDUCTIONS, Field

NO_WAIT = (
    "min_pose_stamp_ns: only a daemon's client waits for poses; in process they are there once set_poses() returns"
)
#: Bit in addition to those of columns: the extension module adds points and normal if there are few rows.
POINTS_BY_DEFAULT = 1 << 31


class Query:
    """A query with parsed arguments: the request, and the values that shape the answer."""

    __slots__ = ("raw", "reduce", "pairs", "selects", "bodies", "joints", "out", "timeout_s", "copy", "max_results")

    raw: Any  #: the extension module's Query
    reduce: int
    pairs: Optional[np.ndarray]
    selects: bool  #: whether an entry of `pairs` selects several pairs
    bodies: Optional[np.ndarray]
    joints: Optional[np.ndarray]
    out: Optional[dict[str, np.ndarray]]
    timeout_s: Optional[float]
    copy: bool
    max_results: int

    def at(self, poses: Optional[np.ndarray], rows: Optional[np.ndarray]) -> Query:
        """Returns a copy with other configurations, of the same number, and its own mutable state."""
        other = Query()
        other.raw = self.raw.at(poses, rows)
        other.reduce, other.pairs, other.selects = self.reduce, self.pairs, self.selects
        other.bodies, other.joints, other.out = self.bodies, self.joints, self.out
        other.timeout_s, other.copy, other.max_results = self.timeout_s, self.copy, self.max_results
        return other

    def known_pairs(self) -> Optional[np.ndarray]:
        """Returns a copy of the pairs if each names two bodies; otherwise None, since only the pair table has them."""
        return None if self.pairs is None or self.selects else self.pairs.copy()

    def out_list(self) -> Optional[list[Optional[np.ndarray]]]:
        """Returns the output arrays, one entry for each bit of a field, as the extension modules expect them."""
        if self.out is None:
            return None
        arrays: list[Optional[np.ndarray]] = [None] * FIELD_COUNT
        for name, column in COLUMNS.items():
            arrays[column.bit] = self.out.get(name)
        return arrays


class Parser:
    """Resolves a query's arguments for an Engine or a Client, which implement the following members."""

    _module: Any  # the extension module with Query
    _waits = False  # whether queries may wait for poses

    @property
    def _names(self) -> NameTable:
        raise NotImplementedError

    @property
    def _joint_table(self) -> JointTable:
        raise NotImplementedError

    def _scene_revision(self) -> int:
        """Returns the revision of the scene of the names and pair tables."""
        raise NotImplementedError

    def _default_fields(self, query: Query, configurations: int) -> int:
        """Returns the default column bits: points and normal are included if there are few rows."""
        raise NotImplementedError

    def _parse(  # type: ignore[no-untyped-def]  # types as in distances()
        self, pairs, configurations, bodies, max_distance, abs_tol, rel_tol, precision, signed_distance, reduce, fields,
        out, timeout_s, max_results, max_pose_age_ns, copy, min_pose_stamp_ns, pose_wait_s, wait_for,
        joints, positions, model, **more,
    ) -> Query:  # fmt: skip
        query = Query()
        query.pairs = None if pairs is None else self._names.pairs_array(pairs)
        query.selects = query.pairs is not None and has_selectors(query.pairs)
        query.bodies = query.joints = None
        poses = rows = None
        count = 1
        if configurations is not None:
            poses, query.bodies = self._configurations(configurations, bodies)
            count = len(poses)
        elif bodies is not None:
            raise ValueError("bodies: only together with configurations")
        if positions is not None or joints is not None:
            rows, query.joints = self._joint_table.rows(positions, joints)
            if poses is not None and len(poses) != len(rows):
                raise ValueError(f"positions: expected K = {len(poses)} as in configurations, got shape {rows.shape}")
            count = len(rows)

        query.reduce = to_word(reduce, REDUCTIONS, "reduce")
        query.out = None if out is None else out_arrays(out)
        query.timeout_s = None if timeout_s is None else to_number_from_0(timeout_s, "timeout_s")
        query.copy = to_bool(copy, "copy")
        if query.out is not None and not query.copy:
            raise ValueError("copy: out= is a copy; expected copy=True")
        query.max_results = to_count(max_results, "max_results")
        mask = self._mask(query, fields, count)
        raw = query.raw = self._module.Query(
            query.pairs, query.bodies, poses, bool(mask & POINTS_BY_DEFAULT), query.joints, rows
        )
        raw.max_distance = to_number(max_distance, "max_distance")
        raw.abs_tol = to_number(abs_tol, "abs_tol")
        raw.rel_tol = -1.0 if rel_tol is None else to_number_from_0(rel_tol, "rel_tol", " or None")
        raw.precision = to_word(precision, PRECISIONS, "precision")
        raw.signed_distance = to_bool(signed_distance, "signed_distance")
        raw.model = to_word(model, MODELS, "model")
        raw.reduce = query.reduce
        raw.fields = mask & ~POINTS_BY_DEFAULT
        raw.max_results = query.max_results
        raw.max_pose_age_ns = to_count(max_pose_age_ns, "max_pose_age_ns")
        if more:
            if "weights" in more:
                raw.set_weights(_weights(more.pop("weights")))
            self._add_options(raw, {**more, **self._add_margins(raw, more.get("margin"))})
        stamp_ns, wait_s = to_count(min_pose_stamp_ns, "min_pose_stamp_ns"), to_number(pose_wait_s, "pose_wait_s")
        every = isinstance(wait_for, str) and wait_for == "*"
        waited_for = EVERY_BODY if every else self._names.selector(wait_for, "wait_for")
        if not 0 <= wait_s <= 10:
            raise ValueError(f"pose_wait_s: expected 0 to 10 seconds, got {pose_wait_s}")
        if stamp_ns or wait_s or waited_for != EVERY_BODY:
            if not self._waits:
                raise ValueError(NO_WAIT)
            raw.min_pose_stamp_ns, raw.pose_wait_ns, raw.wait_for = stamp_ns, round(1e9 * wait_s), waited_for
        return query

    def _add_margins(self, raw: Any, margin: Any) -> dict[str, float]:
        """Adds margins that are not one number, and returns the option that replaces them."""
        if isinstance(margin, Mapping):
            raw.set_margins(self._names.margins_array(margin).view(np.uint8).reshape(-1, MARGIN_DTYPE.itemsize))
        elif isinstance(margin, (np.ndarray, list, tuple)) and np.ndim(margin) > 0:
            each = to_floats(margin, "margin", "a number, one for each pair, or a dict of pairs")
            if each.ndim != 1 or not len(each):
                raise ValueError(f"margin: expected one number for each pair, got shape {each.shape}")
            raw.set_pair_margins(each.copy())
        else:
            return {}
        return {"margin": 0.0}

    def _add_options(self, raw: Any, more: Mapping[str, Any]) -> None:
        """Adds options without a parameter of their own: those of wire/query_options.h that travel in records."""
        for name, value in more.items():
            if name not in self._module.OPTIONS:
                raise TypeError(f"distances() got an unexpected keyword argument {name!r}, or one for a daemon alone")
            tag, kind, _, words, *_ = self._module.OPTIONS[name]
            if not tag:
                raise TypeError(f"distances() got an unexpected keyword argument {name!r}")
            setattr(raw, name, to_option(value, kind, words, name))

    def _configurations(self, configurations: Any, bodies: Any) -> tuple[np.ndarray, np.ndarray]:
        poses = as_pose7(configurations, "configurations")
        names = self._names
        ids = names.movable if bodies is None else names.bodies_array(bodies, "bodies")
        if poses.ndim != 3:
            raise ValueError(
                f"configurations: expected shape (K, M, 7) or (K, M, 4, 4), got {np.shape(configurations)}"
            )
        if poses.shape[1] != len(ids):
            whose = "every movable body" if bodies is None else "bodies"
            raise ValueError(
                f"configurations: expected M = {len(ids)} poses each ({whose}), got shape {np.shape(configurations)}"
            )
        if len(ids) == 0:
            raise ValueError("bodies: expected at least one")
        if len(poses) == 0:
            raise ValueError(f"configurations: expected at least one, got shape {np.shape(configurations)}")
        return poses, ids

    def _mask(self, query: Query, fields: Any, configurations: int) -> int:
        """Returns the column bits of the query. With POINTS_BY_DEFAULT, the engine decides about points and normal."""
        if query.out is not None:
            held = fields_mask(tuple(query.out))
            if fields is None:
                return held
            mask = fields_mask(fields)
            for name in _names_of(mask & ~held):
                raise ValueError(f"out: no array for the column {name!r}, which fields names")
            for name in _names_of(held & ~mask):
                raise ValueError(f"out: holds {name!r}, which fields does not name")
            return mask
        if fields is not None:
            return fields_mask(fields)
        return self._default_fields(query, configurations)


def _weights(weights: Any) -> np.ndarray:
    each = to_floats(weights, "weights", "one number for each joint")
    if each.ndim != 1:
        raise ValueError(f"weights: expected one number for each joint, got shape {each.shape}")
    return each.copy()


def _names_of(mask: int) -> list[str]:
    return [str(field.name).lower() for field in Field if mask & field]
