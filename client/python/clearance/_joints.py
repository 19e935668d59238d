"""Joints of a scene's robots, by name or id."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Optional, Union

import numpy as np

from ._arguments import contiguous, did_you_mean, to_floats, to_list, to_number
from ._words import Status


@dataclass(frozen=True, eq=False)
class Joints:
    """Joints in the order of the columns of positions."""

    names: tuple[str, ...]
    ids: np.ndarray  #: (J,) uint32
    lower: np.ndarray  #: (J,) radians or metres; -inf without a limit
    upper: np.ndarray  #: (J,) radians or metres; +inf without a limit

    def __len__(self) -> int:
        return len(self.names)

    def __repr__(self) -> str:
        return f"<clearance.Joints: {', '.join(self.names)}>"


@dataclass(frozen=True)
class JointState:
    """The current state of a joint."""

    name: str
    position: float  #: radians or metres; valid if status is OK
    status: Status  #: OK, NO_POSE (without a position) or BAD_POSE
    beyond_limits: bool
    stamp_ns: int  #: publisher's clock
    age_ns: Optional[int]  #: since the position was received; None if never


#: Type of `joints=`: the result of joints(), the name of a robot or group, or names or ids of joints.
JointsRef = Union[Joints, str, Sequence[Union[str, int]], np.ndarray]


class JointTable:
    """The joints and their groups of one scene revision."""

    def __init__(self, revision: int, rows: Sequence[tuple[Any, ...]], groups: Sequence[tuple[str, Sequence[int]]]):
        self.revision = revision
        self.names = tuple(row[0] for row in rows)
        self.lower = np.array([row[1] for row in rows], dtype=np.float64)
        self.upper = np.array([row[2] for row in rows], dtype=np.float64)
        self.groups = {name: np.array(ids, dtype=np.uint32) for name, ids in groups}
        self.ids = {name: i for i, name in enumerate(self.names)}

    def joints(self, ids: np.ndarray) -> Joints:
        return Joints(tuple([self.names[i] for i in ids.tolist()]), ids, self.lower[ids], self.upper[ids])

    def joint(self, value: Any, what: str) -> int:
        """Returns the id of a joint given by name or id."""
        if isinstance(value, str):
            found = self.ids.get(value)
            if found is None:
                raise ValueError(f"{what}: no joint is named {value!r}{did_you_mean(value, self.ids)}")
            return found
        if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)):
            raise TypeError(f"{what}: expected a joint's name or id, got {value!r}")
        if not 0 <= value < len(self.names):
            raise ValueError(f"{what}: expected an id of the scene's {len(self.names)} joints, from 0 on, got {value}")
        return int(value)

    def ids_of(self, value: Any, what: str) -> np.ndarray:
        """(J,) uint32 ids of what JointsRef names."""
        if isinstance(value, Joints):
            count = len(self.names)
            if [self.names[i] if i < count else None for i in value.ids.tolist()] != list(value.names):
                raise ValueError(f"{what}: the scene has changed since joints() returned these; call it again")
            return value.ids
        if isinstance(value, str):
            if value in self.groups:
                return self.groups[value]
            near = did_you_mean(value, self.groups)
            raise ValueError(
                f"{what}: no robot or group of joints is named {value!r}"
                f"{near or '; there are ' + (', '.join(map(repr, self.groups)) or 'none')}"
            )
        if isinstance(value, np.ndarray) and (value.ndim != 1 or value.dtype.kind not in "iu"):
            raise TypeError(f"{what}: expected (J,) ids, got an array of {value.dtype} and shape {value.shape}")
        items = to_list(value, what, "joints(...), a robot or group, or a list of names or ids")
        ids = np.array([self.joint(item, f"{what}[{i}]") for i, item in enumerate(items)], dtype=np.uint32)
        if len(set(ids.tolist())) != len(ids):
            twice = next(int(i) for k, i in enumerate(ids) if i in ids[:k])
            raise ValueError(f"{what}: {self.names[twice]!r} is named twice")
        return ids

    def update(self, positions: Any, joints: Any) -> tuple[np.ndarray, np.ndarray]:
        """Returns (J,) ids and positions of an update."""
        given = None if joints is None else self.ids_of(joints, "joints")
        if isinstance(positions, Mapping):
            if given is not None:
                raise TypeError("joints: expected none with a dict of positions, got some")
            ids = np.array([self.joint(key, "positions") for key in positions], dtype=np.uint32)
            numbers = [_position(value, f"positions[{key!r}]") for key, value in positions.items()]
            return ids, np.array(numbers, dtype=np.float64)
        if given is None:
            raise ValueError(f"positions: expected a dict by joint, or joints= as well, got {positions!r}")
        row = contiguous(to_floats(positions, "positions", "(J,) numbers"))
        if row.shape != given.shape:
            raise ValueError(f"positions: expected shape ({len(given)},), one for each joint, got {row.shape}")
        return given, row


def _position(value: Any, what: str) -> float:
    """Converts to a number. Accepts NaN, which is stored as an invalid position."""
    if isinstance(value, (float, np.floating)) and value != value:
        return float("nan")
    return to_number(value, what)
