"""Conversion of arguments to numbers, words, text and arrays, with TypeError and ValueError that name the argument.

Each function takes the value and `what`, the argument's name. Errors contain the expected and the given value. There is
no implicit conversion: "yes" is no bool, and neither True nor "1.5" is a number.
"""

from __future__ import annotations

import difflib
import math
import os
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple, TypeVar

import numpy as np

from ._words import MESH_AS, MeshAs

_Word = TypeVar("_Word")
_INT64 = 1 << 63
_FLOAT64 = np.dtype(np.float64)


def to_bool(value: Any, what: str) -> bool:
    if not isinstance(value, (bool, np.bool_)):
        raise TypeError(f"{what}: expected True or False, got {value!r}")
    return bool(value)


def to_number(value: Any, what: str) -> float:
    if type(value) is not float:
        value = _as_float(value, what)
    if math.isnan(value):
        raise ValueError(f"{what}: expected a number, got nan")
    return value


def _as_float(value: Any, what: str) -> float:
    if isinstance(value, (np.ndarray, np.generic)):
        if is_masked(value):
            raise ValueError(f"{what}: expected a number, got a masked entry")
        numeric = value.ndim == 0 and value.dtype.kind in "fiu"
    else:
        numeric = not isinstance(value, (str, bytes, bytearray, bool))
    try:
        if not numeric:
            raise TypeError
        return float(value)
    except (TypeError, ValueError):
        raise TypeError(f"{what}: expected a number, got {value!r}") from None
    except OverflowError:
        raise ValueError(f"{what}: expected a number that float64 holds, got {value!r}") from None


def to_number_from_0(value: Any, what: str, otherwise: str = "") -> float:
    """otherwise: further accepted values, for the error."""
    number = to_number(value, what)
    if number < 0:
        raise ValueError(f"{what}: expected a number >= 0{otherwise}, got {value}")
    return number


def to_integer(value: Any, what: str) -> int:
    """Converts to a signed integer of 64 bits."""
    try:
        if isinstance(value, bool):
            raise TypeError
        number = value.__index__()
    except (TypeError, AttributeError):
        raise TypeError(f"{what}: expected an integer, got {value!r}") from None
    if not -_INT64 <= number < _INT64:
        raise ValueError(f"{what}: expected an integer of 64 bits, got {number}")
    return number


def to_count(value: Any, what: str) -> int:
    number = to_integer(value, what)
    if number < 0:
        raise ValueError(f"{what}: expected an integer >= 0, got {number}")
    return number


def to_word(value: Any, words: Mapping[str, _Word], what: str) -> _Word:
    word = words.get(value) if isinstance(value, str) else None
    if word is None:
        error = ValueError if isinstance(value, str) else TypeError
        expected = " or ".join(map(repr, words))
        raise error(f"{what}: expected {expected}, got {value!r}{did_you_mean(value, words, 0.7)}")
    return word


def to_option(value: Any, kind: str, words: str, what: str) -> Any:
    """kind, words: columns of the table of query options (wire/query_options.h)."""
    if kind == "word":
        return to_word(value, {word: i for i, word in enumerate(words.split())}, what)
    return {"bool": to_bool, "number": to_number, "integer": to_integer, "count": to_count}[kind](value, what)


def to_text(value: Any, what: str) -> str:
    if not isinstance(value, str):
        raise TypeError(f"{what}: expected a string, got {value!r}")
    try:
        value.encode()
    except UnicodeEncodeError:  # half of a surrogate pair
        raise ValueError(f"{what}: expected a string that UTF-8 can hold, got {value!r}") from None
    return value


def to_path(value: Any, what: str) -> str:
    try:
        return to_text(os.fspath(value), what)
    except TypeError:
        raise TypeError(f"{what}: expected a path (str or os.PathLike), got {value!r}") from None


def to_list(value: Any, what: str, expected: str) -> list[Any]:
    try:
        if isinstance(value, (str, bytes, bytearray)):
            raise TypeError
        return list(value)
    except TypeError:
        raise TypeError(f"{what}: expected {expected}, got {value!r}") from None


def to_items(value: Any, what: str, expected: str) -> list[tuple[Any, Any]]:
    if not isinstance(value, Mapping):
        raise TypeError(f"{what}: expected {expected}, got {value!r}")
    return list(value.items())


def to_numbers(value: Any, what: str, count: int, expected: str) -> list[float]:
    items = to_list(value, what, expected)
    if len(items) != count:
        raise ValueError(f"{what}: expected {expected}, got {value!r}")
    return [to_number(item, f"{what}[{i}]") for i, item in enumerate(items)]


def to_floats(value: Any, what: str, expected: str = "numbers") -> np.ndarray:
    """Converts to a C-contiguous float64 array. Returns the argument itself if it is one, otherwise a copy."""
    if type(value) is np.ndarray and value.dtype is _FLOAT64:
        return contiguous(value)
    reject_masked(value, what)
    try:
        array = np.asarray(value)
    except (TypeError, ValueError) as error:  # rows of different lengths, for one
        raise TypeError(f"{what}: expected {expected}, but numpy reports: {error}") from None
    if array.dtype.kind not in "fiu":
        raise TypeError(f"{what}: expected {expected}, got an array of {array.dtype}")
    return contiguous(array.astype(np.float64, copy=False))


def is_masked(value: Any) -> bool:
    """Whether an array has masked entries, or a list holds such an array: numpy drops masks when it converts."""
    if isinstance(value, (list, tuple)):
        return any(isinstance(item, (list, tuple, np.ma.MaskedArray)) and is_masked(item) for item in value)
    return isinstance(value, np.ma.MaskedArray) and bool(np.ma.is_masked(value))


def reject_masked(value: Any, what: str) -> None:
    """Raises ValueError for masked entries, whose values are undefined."""
    if is_masked(value):
        raise ValueError(f"{what}: expected numbers, got masked entries; fill them, or leave their rows out")


def to_cloud(value: Any, what: str) -> np.ndarray:
    """Converts to C-contiguous (N, 3) float32. Returns the argument itself if possible; (0, 3) without points."""
    if type(value) is np.ndarray and value.dtype == np.float32:
        array = contiguous(value)
    else:
        with np.errstate(over="ignore"):  # inf is rejected later, by name
            array = contiguous(to_floats(value, what, "(N, 3) numbers").astype(np.float32))
    if array.shape in ((0,), (0, 3)):
        return np.empty((0, 3), np.float32)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"{what}: expected shape (N, 3), got {array.shape}")
    return array


def contiguous(array: np.ndarray) -> np.ndarray:
    """Returns the array itself if it is C-contiguous and aligned, otherwise a copy."""
    flags = array.flags
    return array if flags.c_contiguous and flags.aligned else np.array(array, order="C")


def did_you_mean(value: Any, words: Iterable[str], cutoff: float = 0.6) -> str:
    """Returns "; did you mean 'nearest'?" for a similar word, otherwise an empty string."""
    if not isinstance(value, str):
        return ""
    by_fold = {word.casefold(): word for word in words}
    close = difflib.get_close_matches(value.casefold(), by_fold, n=3, cutoff=cutoff)
    return f"; did you mean {' or '.join(repr(by_fold[fold]) for fold in close)}?" if close else ""


def to_uncertainty(value: Any, what: str) -> tuple[float, float]:
    """Returns metres and radians of {"position": ..., "angle": ...}; missing keys are 0."""
    if not isinstance(value, Mapping):
        raise TypeError(f"{what}: expected a map, such as {{'position': 0.002, 'angle': 0.01}}, got {value!r}")
    for key in value:
        if key not in ("position", "angle"):
            raise ValueError(f"{what}: expected the keys position and angle, got {key!r}")
    position, angle = (to_number(value.get(key, 0.0), f"{what}[{key!r}]") for key in ("position", "angle"))
    return position, angle


def to_uncertainties(uncertainty: Any, padding: Any, max_speed: Any) -> tuple[float, float, float, float]:
    """Returns a body's uncertainty: position, angle, padding, max_speed (metres, radians, metres per second)."""
    position, angle = to_uncertainty({} if uncertainty is None else uncertainty, "uncertainty")
    return position, angle, to_number(padding, "padding"), to_number(max_speed, "max_speed")


class ShapeArgument(NamedTuple):
    """The shape that add_body() was given."""

    kind: str  #: name of the argument
    numbers: np.ndarray  #: float64: vertices (V, 3), or sizes (1, 3)
    triangles: np.ndarray  #: (T, 3) uint32 triangles of a mesh, otherwise empty
    mesh_as: int  #: body made from the mesh
    cloud: np.ndarray  #: (N, 3) float32 points of a cloud, otherwise empty; its voxel is the first of `numbers`


def to_shape(mesh_as: Any, voxel: Any, **shapes: Any) -> ShapeArgument:
    """Returns the one shape given to add_body(). shapes: each argument by its name, None or False if not given."""
    shapes["half_space"] = True if to_bool(shapes["half_space"], "half_space") else None
    given = [shape for shape, value in shapes.items() if value is not None]
    if len(given) != 1:
        raise ValueError(f"add_body: expected one of {', '.join(shapes)}, got {', '.join(given) or 'none'}")
    how = to_word(mesh_as, MESH_AS, "mesh_as")
    shape = given[0]
    edge, none = to_number(voxel, "voxel"), np.zeros((0, 3), np.float32)
    if edge != 0 and shape != "points":
        raise ValueError(f"voxel: expected 0 where there are no points, got {voxel!r}")
    if shape == "mesh":
        parts = to_list(shapes[shape], "mesh", "a pair (vertices, triangles)")
        if len(parts) != 2:
            raise ValueError(f"mesh: expected a pair (vertices, triangles), got {len(parts)} things")
        return ShapeArgument(shape, to_vertices(parts[0], "mesh[0]"), to_triangles(parts[1], "mesh[1]"), how, none)
    if how not in (MeshAs.HULL, MeshAs.AUTO):
        raise ValueError(f"mesh_as: expected 'auto' or 'hull' where there is no mesh, got {mesh_as!r}")
    triangles = np.zeros((0, 3), np.uint32)
    if shape == "points":
        cloud = to_cloud(shapes[shape], "points")
        return ShapeArgument(shape, np.array([[edge, 0.0, 0.0]]), triangles, how, cloud)
    return ShapeArgument(shape, _numbers_of(shape, shapes[shape]), triangles, how, none)


def _numbers_of(shape: str, value: Any) -> np.ndarray:
    if shape == "vertices":
        return to_vertices(value, "vertices")
    if shape in ("box", "ellipsoid"):
        return np.array([to_numbers(value, shape, 3, "three numbers")])
    if shape == "half_space":
        return np.zeros((1, 3))
    if shape == "sphere":
        return np.array([[to_number(value, "sphere"), 0.0, 0.0]])
    return np.array([[*to_numbers(value, shape, 2, "two numbers (radius, length)"), 0.0]])


def to_vertices(value: Any, what: str) -> np.ndarray:
    """Converts to (V, 3) float64, at least one row."""
    rows = to_floats(value, what, "(V, 3) numbers")
    if rows.ndim != 2 or rows.shape[1] != 3 or not len(rows):
        raise ValueError(f"{what}: expected shape (V, 3), got {rows.shape}")
    return rows


def to_triangles(value: Any, what: str) -> np.ndarray:
    """Converts to (T, 3) uint32, at least one row. The number of vertices is not checked."""
    reject_masked(value, what)
    try:
        array = np.asarray(value)
    except (TypeError, ValueError) as error:  # rows of different lengths, for one
        raise TypeError(f"{what}: expected (T, 3) integers, but numpy reports: {error}") from None
    if array.dtype.kind not in "iu":
        raise TypeError(f"{what}: expected (T, 3) integers, got an array of {array.dtype}")
    if array.ndim != 2 or array.shape[1] != 3 or not len(array):
        raise ValueError(f"{what}: expected shape (T, 3), got {array.shape}")
    if array.min() < 0 or array.max() >= 1 << 32:
        raise ValueError(f"{what}: expected indices of vertices, got {array.min()} to {array.max()}")
    return contiguous(array.astype(np.uint32, copy=False))
