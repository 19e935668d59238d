"""The result of check()."""

from __future__ import annotations

from typing import Any, Optional

import numpy as np

from .._words import Reduce, Status
from .limits import Beyond, LimitViolation
from .result import PairSource, Result

_ANY, _BEYOND, _OK = int(Reduce.ANY), int(Status.BEYOND), int(Status.OK)  # numpy compares an enum's member as an object


class Check:
    """The free ones among K configurations (1 without configurations), and the verdict on the others.

    `free` considers distances only; `ok` is free and within the joints' limits. As a bool, a check is ok.all().
    """

    __slots__ = ("_answer", "_source", "_beyond", "_result", "_free")

    def __init__(self, answer: Any, source: PairSource, beyond: Optional[Beyond] = None):
        self._answer, self._source, self._beyond = answer, source, beyond
        self._result: Optional[Result] = None
        self._free: Optional[np.ndarray] = None

    @property
    def result(self) -> Result:
        """The result of reduce="any" with the columns verdict and pair, as distances() returns it."""
        if self._result is None:
            self._result = Result(self._answer, _ANY, self._source)
        return self._result

    @property
    def free(self) -> np.ndarray:
        """(K,) bool: every pair is proved farther than its margin."""
        if self._free is None:
            self._free = self.result.verdict == _BEYOND
        return self._free

    @property
    def beyond_limits(self) -> np.ndarray:
        """(K,) bool: whether a joint of the query, or without configurations of the scene, is beyond its limits."""
        if self._beyond is None:
            return np.zeros(len(self.free), dtype=bool)
        return self._beyond.configurations

    @property
    def ok(self) -> np.ndarray:
        """(K,) bool: free, and within the joints' limits."""
        return self.free & ~self.beyond_limits

    @property
    def limit_violations(self) -> tuple[LimitViolation, ...]:
        """The joints beyond their limits in each configuration, with position and excess."""
        return () if self._beyond is None else self._beyond.violations()

    def __bool__(self) -> bool:
        return self._beyond is None and self._answer.all_free()

    @property
    def verdict(self) -> np.ndarray:
        """(K,) uint8, values of clearance.Status.

        BEYOND if free, OK if `pair` is proved within its margin, UNCONVERGED if neither is proved, and BAD_POSE,
        NO_POSE, STALE_POSE or UNKNOWN_BODY if `pair` could not be evaluated.
        """
        return self.result.verdict

    @property
    def pair(self) -> np.ndarray:
        """(K, 2) uint32: ids of a pair that is not proved free, or clearance.NONE."""
        return self.result.pair

    @property
    def pair_names(self) -> np.ndarray:
        """(K, 2): the names of `pair`, an array of str, and None where there is no body."""
        return self.result.pair_names

    @property
    def hit(self) -> np.ndarray:
        """(K,) bool: whether `pair` is proved to be within its margin. If neither free nor hit, nothing is proved."""
        return self.verdict == _OK

    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]:
        return _restored, (self.result, self._beyond)

    def __repr__(self) -> str:
        text = f"{np.count_nonzero(self.free)} of {len(self.free)} free"
        if self._beyond is not None:
            count = np.count_nonzero(self.beyond_limits)
            text += f", {count} beyond joint limits ({self._beyond.first()})"
        if not self.free.all():
            first = int(np.argmin(self.free))
            a, b = map(repr, self.pair_names[first])
            text += f"; configuration {first}: {f'{a} hits {b}' if self.hit[first] else f'{a} and {b} not proved free'}"
        return f"<clearance.Check: {text}>"


def _restored(result: Result, beyond: Optional[Beyond]) -> Check:
    """Restores a Check from the state of __reduce__()."""
    return Check(result._answer, result._source, beyond)
