"""Base of the calls that can be prepared."""

from __future__ import annotations

import math
from collections.abc import Generator, Mapping
from typing import Any, ClassVar, Optional

import numpy as np

from .._words import FIELD_MASKS, Reduce, Status
from .limits import LimitViolation
from .path import PathCheck
from .query import Query, Run
from .result import Result

#: A query to answer: with its poses (K, M, 7) and positions (K, J), None for the kind that does not move.
Request = tuple[Run, Optional[np.ndarray], Optional[np.ndarray]]
Steps = Generator[Request, Any, Any]

ANY, BEYOND = int(Reduce.ANY), int(Status.BEYOND)  # numpy compares an enum's member as an object
#: Columns of the first motion without a proof. They cost more than the verdict, above all `first_contact`.
DETAILS = sum(FIELD_MASKS[name] for name in ("status", "pair", "time", "first_contact"))


class Call:
    """A call with a parsed query. A call of one query implements read() and result(), others steps()."""

    inputs: ClassVar[tuple[str, ...]] = ("configurations",)  #: parameters that each run gives
    least_rows: ClassVar[int] = 1  #: least and greatest number of inputs of the usual case, all rows of joints
    most_rows: ClassVar[int] = 1
    fixed: ClassVar[dict[str, Any]] = {}  #: options of its queries
    extra: ClassVar[tuple[str, ...]] = ()  #: arguments of prepare() alone that are no options

    def __init__(self, query: Query):
        self.query = query

    @classmethod
    def options(cls, arguments: Mapping[str, Any]) -> dict[str, Any]:
        """Converts the call's arguments to those of its queries."""
        return {**arguments, **cls.fixed}

    def read(self, *inputs: Any) -> Request:
        raise NotImplementedError

    def result(self, run: Run, answer: Any, positions: Optional[np.ndarray]) -> Any:
        return Result(answer, run.reduce, run)

    def steps(self, *inputs: Any) -> Steps:
        """Yields the queries, receives their answers, and returns the result."""
        run, poses, positions = self.read(*inputs)
        answer = yield run, poses, positions
        return self.result(run, answer, positions)


def stopped(r: Result, motion: int, violations: tuple[LimitViolation, ...]) -> PathCheck:
    """Describes a motion that is not proved free."""
    time = float(r.time[0])
    if math.isnan(time):
        time = float(r.first_contact[0, 0])
    a, b = r.pair[0].tolist()
    return PathCheck(False, motion, time, (a, b), Status(int(r.status[0])), violations, (r.names[a], r.names[b]))
