"""A query that is parsed once and asked again and again, and the table of its pairs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Optional

import numpy as np

from ._arguments import to_count
from ._errors import QueryError
from ._query import NO_WAIT, Query
from ._result import Result

if TYPE_CHECKING:
    from ._front import Front


class Prepared:
    """A query that prepare() has parsed. A call answers it as distances() would, for the poses at that moment."""

    __slots__ = ("_front", "_query", "_table", "_pairs")

    def __reduce__(self) -> Any:
        raise TypeError("a prepared query cannot be pickled or copied: send its arguments, and prepare it there")

    def __init__(self, front: Front, query: Query):
        self._front = front
        self._query = query
        self._table = TableOf(front, query)
        self._pairs = front._known_pairs(query)
        if self._pairs is not None:
            self._pairs.flags.writeable = False  # all its results share it

    def __call__(self, min_pose_stamp_ns: Optional[int] = None) -> Result:
        """min_pose_stamp_ns: for this call and later ones; None: unchanged."""
        query = self._query
        if min_pose_stamp_ns is not None:
            if not self._front._waits:
                raise ValueError(NO_WAIT)
            query.raw.min_pose_stamp_ns = to_count(min_pose_stamp_ns, "min_pose_stamp_ns")
        return Result(self._front._answer(query), query.reduce, query.out, self._pairs, self._table)


class TableOf:
    """Fetches the pair table of one query when its result is asked for it."""

    __slots__ = ("front", "query")

    def __init__(self, front: Front, query: Query):
        self.front = front
        self.query = query

    def __call__(self, revision: int) -> np.ndarray:
        table = self.front._table(self.query.pairs, self.query.bodies, self.query.joints)
        if self.front._scene_revision() != revision:
            raise QueryError(2, "pairs: the scene has changed since this answer; ask for pairs before changing it")
        return table
