"""Enumerations and columns of queries and answers.

Mirrors wire/types.h and wire/mesh_as.h, value by value (tests/python/client/test_words.py compares them).
"""

from __future__ import annotations

import enum
from typing import Literal, NamedTuple

import numpy as np


class Status(enum.IntEnum):
    """Status of one pair (or one reduced group) in one configuration."""

    OK = 0  #: apart: lower > 0, and the interval is within the tolerance
    OVERLAP = 1  #: a common point is proved: upper <= 0 (if signed, also within the tolerance)
    CONTACT = 2  #: neither is provable: lower <= 0 <= upper
    BEYOND = 3  #: proved farther than max_distance (with reduce="any", than the margins); not refined
    UNCONVERGED = 4  #: the interval is valid but wider than the tolerance
    BAD_POSE = 5  #: a pose with NaN, Inf or a quaternion that cannot be normalised
    NO_POSE = 6  #: a movable body without a pose
    UNKNOWN_BODY = 7  #: a body id outside the scene
    STALE_POSE = 8  #: a pose older than max_pose_age_ns


class Flag(enum.IntFlag):
    """Facts about one answer, as bits."""

    RENORMALISED = 1 << 1  #: a quaternion's norm was off by more than 1e-3
    ROUNDING_LIMITED = 1 << 2  #: as narrow as the arithmetic allows
    NONSMOOTH = 1 << 3  #: witness points are not unique; the gradient is one of several
    PIECES = 1 << 4  #: a body of several convex parts overlaps: the depth is a lower bound for their union
    INCOMPLETE = 1 << 5  #: a reduced group contains a bad or missing pose
    UNCERTAINTY_LIMITED = 1 << 6  #: uncertainty widens the interval beyond the tolerance
    BEYOND_LIMITS = 1 << 7  #: a joint that places one of the bodies is beyond its limits
    HALF_TURN = 1 << 8  #: a body turns by nearly half a turn in a motion, so its direction of rotation is ambiguous


class Precision(enum.IntEnum):
    """Arithmetic of the iterations; the bounds are valid in either."""

    F64 = 0
    F32 = 1


class Reduce(enum.IntEnum):
    """Rows of an answer."""

    NONE = 0  #: one row per configuration and pair
    WITHIN = 1  #: sparse: only pairs not proved farther than max_distance, up to max_results, with the total
    NEAREST = 2  #: one row per configuration and body; with k, one for each of the k nearest pairs, or of all
    MIN = 3  #: one row per configuration
    ANY = 4  #: one row per configuration: BEYOND if every pair is proved beyond its margin, otherwise another pair


class MeshAs(enum.IntEnum):
    """Body made from a mesh that need not be convex."""

    HULL = 0  #: one convex part: the hull of all vertices
    PARTS = 1  #: one convex part for each submesh of the file
    AUTO = 2  #: the default: the hull of a convex or an open mesh, otherwise a solid
    SURFACE = 3  #: the triangles alone
    SOLID = 4  #: the volume that the triangles enclose


class Field(enum.IntFlag):
    """Columns of an answer, as bits of a mask."""

    DISTANCE = 1 << 0
    LOWER = 1 << 1
    UPPER = 1 << 2
    STATUS = 1 << 3
    FLAGS = 1 << 4
    POINT_A = 1 << 5
    POINT_B = 1 << 6
    NORMAL = 1 << 7
    PIECES = 1 << 8
    GRADIENT = 1 << 9
    PAIR = 1 << 10
    CONFIGURATION = 1 << 11
    POINTS32 = 1 << 12
    GRADIENT_JOINTS = 1 << 13
    PAIR_LOWER = 1 << 14
    TIME = 1 << 15
    FIRST_CONTACT = 1 << 16
    STEPS = 1 << 17
    BOUNDS = 1 << 18
    FREE_SCALE = 1 << 19
    VERDICT = 1 << 20
    HESSIAN_JOINTS = 1 << 21
    RATE = 1 << 22
    CURVATURE = 1 << 23
    SMOOTH_RADIUS = 1 << 24
    RATE_BOUNDS = 1 << 25


class Column(NamedTuple):
    """How one column of an answer is stored."""

    bit: int
    dtype: np.dtype
    shape: tuple[int, ...]  #: of one row; for a column of BY_JOINT that of one entry


#: One entry of margins for groups of pairs, in the layout of the extension modules and the wire.
MARGIN_DTYPE = np.dtype([("a", "<u4"), ("b", "<u4"), ("margin", "<f8")])

#: Every column by name, in the order of Field.
COLUMNS: dict[str, Column] = {
    "distance": Column(0, np.dtype("<f8"), ()),
    "lower": Column(1, np.dtype("<f8"), ()),
    "upper": Column(2, np.dtype("<f8"), ()),
    "status": Column(3, np.dtype("u1"), ()),
    "flags": Column(4, np.dtype("<u2"), ()),
    "point_a": Column(5, np.dtype("<f8"), (3,)),
    "point_b": Column(6, np.dtype("<f8"), (3,)),
    "normal": Column(7, np.dtype("<f8"), (3,)),
    "pieces": Column(8, np.dtype("<u4"), (2,)),
    "gradient": Column(9, np.dtype("<f8"), (2, 6)),
    "pair": Column(10, np.dtype("<u4"), (2,)),
    "configuration": Column(11, np.dtype("<u4"), ()),
    "points32": Column(12, np.dtype("<f4"), (2, 3)),
    "gradient_joints": Column(13, np.dtype("<f8"), ()),
    "pair_lower": Column(14, np.dtype("<u4"), (2,)),
    "time": Column(15, np.dtype("<f8"), ()),
    "first_contact": Column(16, np.dtype("<f8"), (2,)),
    "steps": Column(17, np.dtype("<u4"), ()),
    "bounds": Column(18, np.dtype("<f4"), (2,)),
    "free_scale": Column(19, np.dtype("<f8"), ()),
    "verdict": Column(20, np.dtype("u1"), ()),
    "hessian_joints": Column(21, np.dtype("<f8"), ()),
    "rate": Column(22, np.dtype("<f8"), ()),
    "curvature": Column(23, np.dtype("<f8"), ()),
    "smooth_radius": Column(24, np.dtype("<f8"), ()),
    "rate_bounds": Column(25, np.dtype("<f8"), (2,)),
}
#: Columns with an entry for each joint of the query, or for each two: the number of these axes.
BY_JOINT = {"gradient_joints": 1, "hessian_joints": 2}
KNOWN_FIELDS = sum(1 << column.bit for column in COLUMNS.values())
#: Bits from 0 to that of the last column.
FIELD_COUNT = KNOWN_FIELDS.bit_length()

DEFAULT_FIELDS = int(Field.DISTANCE | Field.LOWER | Field.UPPER | Field.STATUS)
#: Names for `fields`, with their masks. "points" is both points, "default" the default columns.
FIELD_MASKS: dict[str, int] = {
    **{name: 1 << column.bit for name, column in COLUMNS.items()},
    "points": int(Field.POINT_A | Field.POINT_B),
    "default": DEFAULT_FIELDS,
}


def row_shape(name: str, joints: int) -> tuple[int, ...]:
    """Returns the shape of a row of a column. joints: number of the query's joints."""
    return (joints,) * BY_JOINT[name] if name in BY_JOINT else COLUMNS[name].shape


# Types of arguments for type checkers; tests compare them with the tables below.
ReduceWord = Literal["none", "within", "nearest", "min", "any"]
MeshAsWord = Literal["hull", "parts", "auto", "surface", "solid"]
GeometryWord = Literal["collision", "visual"]
ServiceWord = Literal["control", "planning"]
BackendWord = Literal["auto", "cpu", "cuda", "reference"]
CoversWord = Literal["background", "off"]

REDUCTIONS = {word.name.lower(): int(word) for word in Reduce}
MESH_AS = {word.name.lower(): int(word) for word in MeshAs}
GEOMETRIES = {"collision": 0, "visual": 1}
SERVICE_CLASSES = {name: name for name in ("control", "planning")}
BACKENDS = {name: name for name in ("auto", "cpu", "cuda", "reference")}
COVERS = {name: name for name in ("background", "off")}

#: Marks a pair selector as a group; the other bits are the group's index.
GROUP_BIT = 0x80000000
#: The pair selector for every body.
EVERY_BODY = 0xFFFFFFFF
#: "No such body or convex part" in an answer.
NONE = 0xFFFFFFFE
#: Maximum length of a body's or group's name, in bytes.
MAX_NAME_BYTES = 63
#: Maximum number of rows for which points and normal are default columns.
DEFAULT_POINTS_ROWS = 100000
