"""Bodies that may move anywhere, those that follow them, and how far they come."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .._names import NameTable
from .._words import EVERY_BODY, MARGIN_DTYPE

_MOST = 90  # bodies; a query has 4096 margins, one for each of their pairs
_UP = 1 + 2.0**-44  # covers the rounding of sums of at most 90 products above 0


class Movers:
    """The movers of each body that moves, and the ages of their poses, at one moment.

    speeds: metres per second by id, limits of all points of these bodies and of those that follow them.
    states: of all bodies, with parents as they are now.
    """

    def __init__(self, speeds: Mapping[int, float], states: Sequence[Any], names: NameTable):
        for body in speeds:
            if body >= len(states) or states[body].age_ns is None:
                raise ValueError(f"others: no pose of {names.meaning(body)} has been received")
        self.age_s = {body: 1e-9 * states[body].age_ns for body in speeds}
        self._speeds = speeds
        above = ((body, _above(states, body, speeds)) for body in range(len(states)))
        self.of = {body: movers for body, movers in above if movers}  #: by body
        if len(self.of) > _MOST:
            raise ValueError(f"others: {len(self.of)} bodies move, followers included; at most {_MOST}")

    def reach(self, a: int, b: int, seconds: float) -> float:
        """Returns how much nearer two bodies may have come since their poses, and come in some seconds: metres.

        What moves both alike does not count.
        """
        movers = self.of.get(a, frozenset()) ^ self.of.get(b, frozenset())
        return sum(self._speeds[body] * (self.age_s[body] + seconds) for body in movers) * _UP

    def margins(self, seconds: float, margin: float) -> np.ndarray:
        """Returns margins that contain the reaches of all pairs. The last one that names a pair counts."""
        alone = [(EVERY_BODY, body) for body in self.of]
        both = list(itertools.combinations(self.of, 2))
        rows = np.zeros(1 + len(alone) + len(both), MARGIN_DTYPE)
        rows["a"][0], rows["b"][0] = EVERY_BODY, EVERY_BODY
        rows["a"][1:], rows["b"][1:] = zip(*alone, *both)
        reaches = [self.reach(a, b, seconds) for a, b in (*alone, *both)]
        rows["margin"] = margin
        rows["margin"][1:] = (margin + np.array(reaches)) * _UP
        return rows


def _above(states: Sequence[Any], body: int, speeds: Mapping[int, float]) -> frozenset[int]:
    """Returns the movers that a body follows, and itself if it is one."""
    found = set()
    at = body
    while at is not None:
        if at in speeds:
            found.add(at)
        at = states[at].parent
    return frozenset(found)
