"""Queries that were asked before: whoever plans asks the same of one configuration after another."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Optional

import numpy as np

from ._joints import Joints
from ._query import Query

_KEPT = 16


class Asked:
    """Parsed queries by their arguments, without their configurations. May be used from several threads."""

    def __init__(self) -> None:
        self._queries: dict[Any, Query] = {}

    def find(self, key: Any) -> Optional[Query]:
        return None if key is None else self._queries.get(key)

    def keep(self, key: Any, query: Query) -> None:
        if key is None:
            return
        if len(self._queries) >= _KEPT:
            self._queries.clear()
        self._queries[key] = query.at(None, None)  # without the arrays, and nobody else's


def key_of(
    revision: int,
    configurations: Any,
    positions: Optional[np.ndarray],
    arguments: tuple[Any, ...],
    more: Mapping[str, Any],
) -> Any:
    """What stands for these arguments in the scene of that revision: equal keys, the same parsed query, but for the
    numbers in configurations and positions. None: something among them may change, and is to be parsed each time.
    """
    try:
        where = _shape_of(configurations), None if positions is None else positions.shape
        return (revision, where, _frozen_all(arguments), *more, _frozen_all(tuple(more.values())))
    except TypeError:
        return None


def _shape_of(configurations: Any) -> Optional[tuple[int, ...]]:
    if configurations is None:
        return None
    if type(configurations) is np.ndarray and configurations.dtype == np.float64 and configurations.shape[2:] == (7,):
        flags = configurations.flags
        if flags.c_contiguous and flags.aligned:
            return configurations.shape
    raise TypeError


_NEVER_CHANGES = frozenset((type(None), str, float, int, bool, Joints))


def _frozen_all(values: tuple[Any, ...]) -> tuple[Any, ...]:
    """With their types: 1 is no True."""
    kinds = tuple(map(type, values))
    if not _NEVER_CHANGES.issuperset(kinds):
        values = tuple([v if kind in _NEVER_CHANGES else _frozen(v, kind) for kind, v in zip(kinds, values)])
    return kinds, values


def _frozen(value: Any, kind: type) -> tuple[Any, ...]:
    if kind is dict:
        return _frozen_all(tuple(value)), _frozen_all(tuple(value.values()))
    if kind is list or kind is tuple:
        return _frozen_all(tuple(value))
    raise TypeError
