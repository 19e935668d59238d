"""Parsed arguments of a query. The options come from the C++ headers, through contract.json, which the build writes."""

from __future__ import annotations

import copy
import json
import math
import pathlib
from collections.abc import Iterable
from typing import Any, Optional

import numpy as np

from .._errors import QueryError
from .._words import Field, Reduce
from ..wire import ErrorCode

_MOTION_FIELDS = Field.TIME | Field.FIRST_CONTACT | Field.STEPS
_SECOND_ORDER = Field.HESSIAN_JOINTS | Field.RATE | Field.CURVATURE | Field.SMOOTH_RADIUS | Field.RATE_BOUNDS
_RATES = Field.RATE | Field.CURVATURE | Field.RATE_BOUNDS

CONTRACT = json.loads((pathlib.Path(__file__).parent / "contract.json").read_text())
#: {name: (tag, kind, default, words, unit, text, bytes in a record, least, most, text of these)}: the rows of
#: wire/query_options.h.
OPTIONS: dict[str, tuple[int, str, Any, str, str, str, int, float, float, str]] = {
    name: tuple(row)  # type: ignore[misc]
    for name, row in CONTRACT["options"].items()
}


class Query:
    """Arguments of a query without its configurations, with every option of OPTIONS as an attribute."""

    def __init__(
        self,
        pairs: Optional[np.ndarray],
        bodies: Optional[np.ndarray],
        joints: Optional[np.ndarray],
        scene_revision: int,
    ):
        self.pairs, self.bodies, self.joints, self.scene_revision = pairs, bodies, joints, scene_revision
        self.limits: Optional[tuple[np.ndarray, np.ndarray]] = None
        self.margins: Optional[np.ndarray] = None
        self.pair_margins: Optional[np.ndarray] = None
        self.weights: Optional[np.ndarray] = None
        self.speed_errors: Optional[np.ndarray] = None
        self.growths: Optional[np.ndarray] = None
        self.velocities: Optional[np.ndarray] = None
        self.twists: Optional[np.ndarray] = None
        self.__dict__.update((name, row[2]) for name, row in OPTIONS.items())

    def check(self, poses: Optional[np.ndarray], positions: Optional[np.ndarray]) -> None:
        """Raises ValueError unless a run's configurations have the query's bodies and joints."""
        if not _fits(poses, self.bodies):
            raise ValueError("configurations: expected one pose for each of bodies")
        if not _fits(positions, self.joints):
            raise ValueError("positions: expected one for each of joints")
        if poses is not None and positions is not None and len(poses) != len(positions):
            raise ValueError("positions: expected as many configurations as there are of poses")

    def check_options(self) -> None:
        """Raises QueryError for options that contradict each other, as wire/query_contradictions.h."""
        for is_wrong, text, code in self._contradictions():
            if is_wrong:
                raise QueryError(code, text)

    def _contradictions(self) -> Iterable[tuple[Any, str, ErrorCode]]:
        bad, unsupported = ErrorCode.BAD_QUERY, ErrorCode.NOT_SUPPORTED
        q: Any = self
        fields, is_any, is_motion = q.fields, q.reduce == Reduce.ANY, q.max_evaluations > 0
        has_margins = q.margin != 0 or self.margins is not None or self.pair_margins is not None
        text = "margin: only for reduce any and motions; use max_distance for other queries"
        yield has_margins and not is_any and not is_motion, text, bad
        yield is_any and q.max_distance < math.inf, "max_distance: reduce any uses its margins instead", bad
        yield is_any and q.signed_distance, "signed_distance: reduce any computes no depth", bad
        text = "fields: gradient_joints is for a query with joints"
        yield fields & Field.GRADIENT_JOINTS and self.joints is None, text, bad
        text = "fields: hessian_joints is for a query with joints"
        yield fields & Field.HESSIAN_JOINTS and self.joints is None, text, bad
        text = "fields: reduce any has no rate, rate_bounds, curvature, hessian_joints and smooth_radius"
        yield fields & _SECOND_ORDER and is_any, text, bad
        for name in ("velocities", "twists"):
            text = f"{name}: only for the columns rate, rate_bounds and curvature"
            yield getattr(self, name) is not None and not fields & _RATES, text, bad
        text = "speed_errors: only for the column rate_bounds"
        yield self.speed_errors is not None and not fields & Field.RATE_BOUNDS, text, bad
        yield q.k > 0 and q.reduce != Reduce.NEAREST, "k: only for reduce nearest", bad
        text = "fields: time, first_contact and steps are only for motions (max_evaluations)"
        yield fields & _MOTION_FIELDS and not is_motion, text, bad
        text = "reduce: motions are reduced by none, min and any"
        yield is_motion and q.reduce in (Reduce.WITHIN, Reduce.NEAREST), text, unsupported
        yield is_motion and q.signed_distance, "signed_distance: motions have no depths", unsupported
        has_gradient = fields & (Field.GRADIENT | Field.GRADIENT_JOINTS | _SECOND_ORDER)
        yield is_motion and has_gradient, "fields: motions have no gradient", unsupported
        if q.control_points != 2:
            yield not is_motion, "control_points: only for motions (max_evaluations)", bad
        if self.growths is not None:
            yield not is_motion, "growths: only for motions (max_evaluations)", bad
            yield self.bodies is None, "growths: expected bodies, which grow", bad
        if fields & Field.FREE_SCALE:
            yield not is_any, "fields: free_scale needs reduce any", bad
            yield is_motion, "fields: motions have no free_scale", unsupported
            others = fields & ~(Field.FREE_SCALE | Field.PAIR)
            yield others, "fields: free_scale can be combined only with pair", bad
        else:
            yield self.weights is not None, "weights: only for the column free_scale", bad
        yield fields & Field.VERDICT and not is_any, "fields: verdict needs reduce any", bad

    def beyond_limits(self, positions: Optional[np.ndarray]) -> bool:
        """Whether a position is beyond the limits of the query's joints."""
        if positions is None or self.limits is None:
            return False
        lower, upper = self.limits
        return bool(((positions < lower) | (positions > upper)).any())

    def set_limits(self, lower: np.ndarray, upper: np.ndarray) -> None:
        joints = 0 if self.joints is None else len(self.joints)
        if len(lower) != joints or len(upper) != joints:
            raise ValueError("limits: expected one for each of joints")
        self.limits = lower, upper

    def set_margins(self, rows: np.ndarray) -> None:
        self.margins = rows

    def set_pair_margins(self, each: np.ndarray) -> None:
        self.pair_margins = each

    def at_velocities(self, velocities: Optional[np.ndarray], twists: Optional[np.ndarray]) -> Query:
        copied = copy.copy(self)
        copied.velocities, copied.twists = velocities, twists
        return copied

    def set_weights(self, each: np.ndarray) -> None:
        self.weights = each

    def set_speed_errors(self, each: np.ndarray) -> None:
        self.speed_errors = each

    def set_growths(self, rows: np.ndarray) -> None:
        self.growths = rows


def _fits(rows: Optional[np.ndarray], ids: Optional[np.ndarray]) -> bool:
    return rows is None if ids is None else rows is not None and rows.shape[1] == len(ids)
