"""The result of check_path()."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Optional

from .._words import Status
from .limits import LimitViolation


@dataclass(frozen=True)
class PathCheck:
    """Whether a whole path is free, or the first motion that is not proved free."""

    free: bool  #: whether every pair is proved farther than its margin on every motion
    index: Optional[int]  #: the first motion or segment that is not free, from waypoint `index` on; None if free
    t: Optional[float]  #: 0 to 1 in that motion: time at which `pair` is within its margin, or at which the proof ends
    pair: Optional[tuple[int, int]]  #: ids of the bodies that are not proved free
    status: Status  #: BEYOND if free. OK, CONTACT, OVERLAP: `pair` is proved within its margin at `t`. Others: no proof
    #: First waypoint at which each joint is beyond its limits, in the order of joints. Independent of `free`.
    limit_violations: tuple[LimitViolation, ...] = ()
    pair_names: Optional[tuple[str, str]] = None  #: names of `pair`

    @property
    def beyond_limits(self) -> bool:
        """Whether a joint exceeds its limits. Straight motions are checked at their waypoints, curves throughout."""
        return bool(self.limit_violations)

    @property
    def ok(self) -> bool:
        """Whether the whole path is free and within the joints' limits; also the result as a bool."""
        return self.free and not self.limit_violations

    def __bool__(self) -> bool:
        return self.ok

    @property
    def hit(self) -> bool:
        """Whether the path is proved not to be free. If neither free nor hit, nothing is proved."""
        return self.status <= Status.CONTACT
