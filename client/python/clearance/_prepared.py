"""Prepared queries, which are parsed once and run many times, and the pair tables of queries."""

from __future__ import annotations

from typing import Any, Optional, Protocol

import numpy as np

from ._arguments import to_count
from ._errors import QueryError
from ._query import NO_WAIT, Query
from ._result import Result


class Answerer(Protocol):
    """The members of an Engine or a Client that a prepared query uses."""

    _waits: bool

    def _answer(self, query: Query) -> Any: ...
    def _scene_revision(self) -> int: ...
    def _table(
        self, pairs: Optional[np.ndarray], bodies: Optional[np.ndarray], joints: Optional[np.ndarray] = None
    ) -> np.ndarray: ...


class Prepared:
    """A query parsed by prepare(). Calling it returns the result of distances() for the current poses."""

    __slots__ = ("_answerer", "_query", "_table", "_pairs")

    def __reduce__(self) -> Any:
        raise TypeError("a prepared query cannot be pickled or copied: send its arguments, and prepare it there")

    def __init__(self, answerer: Answerer, query: Query):
        self._answerer = answerer
        self._query = query
        self._table = TableOf(answerer, query)
        self._pairs = query.known_pairs()
        if self._pairs is not None:
            self._pairs.flags.writeable = False  # all its results share it

    def __call__(self, min_pose_stamp_ns: Optional[int] = None) -> Result:
        """Runs the query. min_pose_stamp_ns, if given, applies to this call and later ones."""
        query = self._query
        if min_pose_stamp_ns is not None:
            if not self._answerer._waits:
                raise ValueError(NO_WAIT)
            query.raw.min_pose_stamp_ns = to_count(min_pose_stamp_ns, "min_pose_stamp_ns")
        return Result(self._answerer._answer(query), query.reduce, query.out, self._pairs, self._table)


class TableOf:
    """Fetches the pair table of a query on demand."""

    __slots__ = ("answerer", "query")

    def __init__(self, answerer: Answerer, query: Query):
        self.answerer = answerer
        self.query = query

    def __call__(self, revision: int) -> np.ndarray:
        table = self.answerer._table(self.query.pairs, self.query.bodies, self.query.joints)
        if self.answerer._scene_revision() != revision:
            raise QueryError(2, "pairs: the scene has changed since this answer; read pairs before changing it")
        return table
