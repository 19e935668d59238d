"""Parsed arguments of a query. The options come from the C++ headers, through contract.json, which the build writes."""

from __future__ import annotations

import json
import pathlib
from typing import Any, Optional

import numpy as np

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
        self.__dict__.update((name, row[2]) for name, row in OPTIONS.items())

    def check(self, poses: Optional[np.ndarray], positions: Optional[np.ndarray]) -> None:
        """Raises ValueError unless a run's configurations have the query's bodies and joints."""
        if not _fits(poses, self.bodies):
            raise ValueError("configurations: expected one pose for each of bodies")
        if not _fits(positions, self.joints):
            raise ValueError("positions: expected one for each of joints")
        if poses is not None and positions is not None and len(poses) != len(positions):
            raise ValueError("positions: expected as many configurations as there are of poses")

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

    def set_weights(self, each: np.ndarray) -> None:
        self.weights = each


def _fits(rows: Optional[np.ndarray], ids: Optional[np.ndarray]) -> bool:
    return rows is None if ids is None else rows is not None and rows.shape[1] == len(ids)
