"""Conversions of arguments of queries."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from .._arguments import to_floats, to_number_from_0, to_option

#: Rows of wire/query_options.h that are no arguments of calls.
NO_ARGUMENTS = frozenset(("min_pose_stamp_ns", "wait_for", "control_points"))


def options_of(table: Mapping[str, Any], call: str, given: Mapping[str, Any]) -> Iterable[tuple[str, Any]]:
    """Converts options of wire/query_options.h."""
    for name, value in given.items():
        if name not in table or name in NO_ARGUMENTS:
            raise TypeError(f"{call}() got an unexpected argument {name!r}, or one for a daemon alone")
        if name == "rel_tol":
            yield name, -1.0 if value is None else to_number_from_0(value, name, " or None")
        else:
            _, kind, _, words, *_ = table[name]
            yield name, to_option(value, kind, words, name)


def own(array: np.ndarray) -> np.ndarray:
    """Returns a read-only copy, which the caller cannot change."""
    array = array.copy()
    array.flags.writeable = False
    return array


def some(ids: np.ndarray, what: str) -> np.ndarray:
    if not len(ids):
        raise ValueError(f"{what}: expected at least one")
    return ids


def one_each(numbers: Any, what: str, expected: str) -> np.ndarray:
    each = to_floats(numbers, what, expected)
    if each.ndim != 1:
        raise ValueError(f"{what}: expected {expected}, got shape {each.shape}")
    return each.copy()
