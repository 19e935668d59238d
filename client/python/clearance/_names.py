"""Bodies and groups by name or id."""

from __future__ import annotations

import math
import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Optional, Union

import numpy as np

from ._arguments import contiguous, did_you_mean, reject_masked, to_list, to_number_from_0
from ._words import EVERY_BODY, GROUP_BIT, MARGIN_DTYPE, NONE

BodyRef = Union[str, int]  #: a body or, where groups are accepted, a group, by name or id
# Types of arguments of queries.
Bodies = Optional[Sequence[BodyRef]]
Margin = Union[float, np.ndarray, Sequence[float], Mapping[tuple[BodyRef, BodyRef], float]]
Pairs = Union[np.ndarray, Sequence[tuple[BodyRef, BodyRef]], tuple[BodyRef, BodyRef], None]


@dataclass(frozen=True)
class BodyInfo:
    """Properties of a body of the scene."""

    name: str
    id: int
    parent: Optional[int]  #: id of the body that this one follows
    is_static: bool
    piece_count: int
    vertex_count: int
    model_error: float  #: metres: bound on how far the convex parts reach outside the specified shape
    extent: float  #: metres: distance of the farthest point from the body's origin
    hull_excess: float = 0.0  #: metres: bound on the distance of the convex parts from their mesh; 0 if convex
    empty_share: float = 0.0  #: fraction of the parts' volume outside the mesh; NaN for an open mesh
    triangle_count: int = 0  #: triangles of a surface or solid, which its parts only enclose; 0 if the parts are exact
    is_solid: bool = False  #: whether the triangles enclose the body, rather than being the body
    is_cloud: bool = False  #: whether the body is a point cloud, which set_points() replaces
    # Terms of the body's uncertainty, for bodies in this process.
    model_inner: float = 0.0  #: metres: bound on how far the specified shape reaches outside the convex parts
    uncertainty_position: float = 0.0  #: metres: radius of the ball that contains its origin
    uncertainty_angle: float = 0.0  #: radians: bound on its rotation error
    padding: float = 0.0  #: metres: growth of the convex parts
    max_speed: float = 0.0  #: metres per second: bound on the speed of its points


class NameTable:
    """The bodies and groups of one scene revision."""

    def __init__(self, revision: int, bodies: Sequence[BodyInfo], groups: dict[str, np.ndarray]):
        self.revision = revision
        self.bodies: tuple[BodyInfo, ...] = tuple(bodies)
        self.body_names = tuple(body.name for body in bodies)
        self.groups = groups
        self.group_names = tuple(groups)
        self.ids: dict[str, int] = {body.name: body.id for body in bodies}
        self.selectors: dict[str, int] = dict(self.ids)
        # A robot's name refers to its group here, since its frame has no pairs.
        self.selectors.update((name, GROUP_BIT | index) for index, name in enumerate(groups))
        self.selectors["*"] = EVERY_BODY
        self.movable = np.array([body.id for body in bodies if not body.is_static], dtype=np.uint32)

    def meaning(self, selector: int) -> str:
        """Returns the quoted name of a body or group by its selector, or "none"."""
        if selector == EVERY_BODY:
            return "'*'"
        known, index = (self.group_names if selector & GROUP_BIT else self.body_names), selector & ~GROUP_BIT
        return repr(known[index]) if index < len(known) else "none"

    def parent(self, body: int) -> str:
        """Returns the quoted name of a body's parent, or "none"."""
        parent = self.bodies[body].parent if body < len(self.bodies) else None
        return "none" if parent is None else self.meaning(parent)

    def body(self, value: Any, what: str) -> int:
        """Returns the id of a body given by name or id."""
        if isinstance(value, str):
            found = self.ids.get(value)
            if found is None:
                raise ValueError(f"{what}: {self._unknown(value, groups=False)}")
            return found
        return _as_id(value, what, "a body's name or id")

    def bodies_array(self, value: Any, what: str) -> np.ndarray:
        """Returns (M,) uint32 ids of bodies given by names or ids."""
        if isinstance(value, np.ndarray) and value.dtype.kind in "iu":
            return _as_uint32(value, what, 1)
        items = to_list(value, what, "a list of names or ids")
        return np.array([self.body(item, f"{what}[{i}]") for i, item in enumerate(items)], dtype=np.uint32)

    def selector(self, value: Any, what: str) -> int:
        """Returns the id of a body, or the selector of a group or of every body ("*")."""
        if isinstance(value, str):
            found = self.selectors.get(value)
            if found is None:
                raise ValueError(f"{what}: {self._unknown(value, groups=True)}")
            return found
        return _as_id(value, what, "a name or an id")

    def pairs_array(self, value: Any) -> np.ndarray:
        """Returns (P, 2) uint32 selectors from ids, names, or one pair."""
        if isinstance(value, np.ndarray) and value.dtype.kind in "iu":
            return _as_uint32(value, "pairs", 2)
        rows = to_list(value, "pairs", "(P, 2) ids, a list of name pairs or one pair")
        if len(rows) == 2 and not any(_is_pair(row) for row in rows):
            rows = [rows]
        flat: list[int] = []
        for i, row in enumerate(rows):
            if not _is_pair(row):
                raise ValueError(f"pairs[{i}]: expected two bodies or groups, got {row!r}")
            flat.append(self.selector(row[0], f"pairs[{i}][0]"))
            flat.append(self.selector(row[1], f"pairs[{i}][1]"))
        return np.array(flat, dtype=np.uint32).reshape(-1, 2)

    def margins_array(self, value: Mapping[Any, Any]) -> np.ndarray:
        """Converts {(body or group, body or group): metres} to (E,) rows of MARGIN_DTYPE, in the order of the dict."""
        rows = np.zeros(len(value), MARGIN_DTYPE)
        for i, (pair, margin) in enumerate(value.items()):
            what = f"margin[{pair!r}]"
            if not _is_pair(pair):
                raise ValueError(f"{what}: expected a pair of bodies or groups for a key, got {pair!r}")
            number = to_number_from_0(margin, what)
            if math.isinf(number):
                raise ValueError(f"{what}: expected a finite number, got {margin}")
            rows[i] = (self.selector(pair[0], what), self.selector(pair[1], what), number)
        return rows

    def _unknown(self, name: str, groups: bool) -> str:
        known = [key for key in (self.selectors if groups else self.ids) if key != "*"]
        kind = "body or group" if groups else "body"
        if suggestion := did_you_mean(name, known):
            return f"no {kind} is named {name!r}{suggestion}"
        if not groups and name in self.groups:
            return f"{name!r} is a group; expected a body"
        shown = ", ".join(map(repr, known[:8])) + (f" and {len(known) - 8} more" if len(known) > 8 else "")
        return f"no {kind} is named {name!r}; the scene has {shown or 'none'}"


def names_of(ids: np.ndarray, names: Sequence[str]) -> np.ndarray:
    """Returns an array of the names of body ids, None where there is no such body."""
    table = np.array([*names, None], dtype=object)
    return table[np.minimum(ids, len(names))]


def has_selectors(pairs: np.ndarray) -> bool:
    """Whether an entry of (P, 2) selectors selects more than one body."""
    if not pairs.size or pairs.max() < GROUP_BIT:
        return False
    return bool(((pairs >= GROUP_BIT) & (pairs != NONE)).any())


def _is_pair(value: Any) -> bool:
    if isinstance(value, (str, bytes, Mapping)) or not hasattr(value, "__getitem__"):
        return False
    try:
        return len(value) == 2
    except TypeError:  # an array of no dimension
        return False


def _as_id(value: Any, what: str, expected: str) -> int:
    if isinstance(value, (bool, np.bool_)):
        raise TypeError(f"{what}: expected {expected}, got {value!r}")
    try:
        number = operator.index(value)
    except TypeError:
        raise TypeError(f"{what}: expected {expected}, got {value!r}") from None
    if not 0 <= number <= 0xFFFFFFFF:
        raise ValueError(f"{what}: an id is 0 to 4294967295, got {number}")
    return number


def _as_uint32(array: np.ndarray, what: str, ndim: int) -> np.ndarray:
    reject_masked(array, what)
    if array.ndim != ndim or (ndim == 2 and array.shape[1] != 2):
        raise ValueError(f"{what}: expected shape {'(P, 2)' if ndim == 2 else '(M,)'}, got {array.shape}")
    if array.dtype != np.uint32:
        if array.size and (array.min() < 0 or array.max() > 0xFFFFFFFF):
            wrong = int(array[(array < 0) | (array > 0xFFFFFFFF)].flat[0])
            raise ValueError(f"{what}: an id is 0 to 4294967295, got {wrong}")
        array = array.astype(np.uint32)
    return contiguous(array)
