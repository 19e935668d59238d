"""Paths of joints whose every motion is proved free."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Optional

import numpy as np

from .._arguments import to_bool, to_count, to_floats, to_integer, to_number_from_0
from .._joints import JointsRef
from .._names import Margin, Pairs
from .certificate import Certificate
from .check import Check
from .meanwhile import Meanwhile
from .path_report import PathReport, explain_path
from .query import Run
from .stop import Others
from .stop_terms import Separation, separations


@dataclass(frozen=True)
class PathPlan:
    """A path that is proved free, or the reason why there is none. As a bool, whether there is a path."""

    path: Optional[np.ndarray]  #: (N, J) waypoints, radians and metres; None if none was found
    reason: str  #: why there is no path; empty if there is one
    check: Check  #: the start and the goal: their verdicts, pairs and limit violations
    iterations: int  #: samples drawn
    motions: int  #: motions that were tried
    #: Bounds of the least distance of all pairs along the path, metres; None without a path, or if not requested.
    clearance: Optional[tuple[float, float]] = None
    certificate: Optional[Certificate] = None  #: proofs that all motions are free, if requested

    def __bool__(self) -> bool:
        return self.path is not None


class Plans:
    """The methods of Front for paths."""

    # ---- for subclasses -------------------------------------------------------------------------------------------

    def _find_path(self, run: Run, ends: np.ndarray, **options: Any) -> tuple[np.ndarray, int, int]:
        """Returns (N J,) positions of a path, empty if none was found, the samples drawn, and the motions tried."""
        raise NotImplementedError

    # ---- calls ----------------------------------------------------------------------------------------------------

    def plan(
        self,
        start: Any,
        goal: Any,
        joints: JointsRef,
        pairs: Pairs = None,
        margin: Margin = 0.0,
        range: float = 1.0,
        max_iterations: int = 100_000,
        shortcuts: int = 32,
        seed: int = 0,
        clearance: bool = True,
        certificate: bool = False,
    ) -> PathPlan:
        """Plans a path of joints whose every motion is proved free (RRT-Connect with shortcuts).

        start, goal: (J,) positions of `joints`, radians and metres.
        joints, pairs, margin: as in motions(). Other joints and bodies keep their current positions and poses.
        range: greatest length of a new motion, Euclidean in joint space, before shortcuts. Default: 1; smaller ones
            need more motions.
        max_iterations: samples after which the search ends, each of one motion or more. Half are near the straight
            motion, half uniform within the limits; a joint without limits has uniform samples from -pi to pi, and does
            not wrap around. Default: 100,000.
        shortcuts: random shortcuts that are tried, a motion each; 0 leaves the path as it was found. Default: 32.
        seed: the same seed, scene and poses give the same path. Default: 0.
        clearance: whether to bound the least distance along the path, to 1 mm. Default: True, which takes longer than
            most plans.
        certificate: whether to add proofs of all motions. Default: False; certificate() takes ten times a query's time.

        Returns a PathPlan. It is false, and has the reason, if the start or the goal is not free or is beyond limits,
        or if no path was found. Ctrl-C ends the search. Raises ValueError for arrays of another shape, and as
        motions() does.
        """
        search = {"range": range, "max_iterations": max_iterations, "shortcuts": shortcuts, "seed": seed}
        return _plan(self, start, goal, joints, pairs, margin, search, clearance, certificate)

    def explain_path(
        self,
        path: Any,
        joints: JointsRef,
        pairs: Pairs = None,
        margin: Margin = 0.0,
        max_evaluations: int = 256,
        meanwhile: Meanwhile = None,
    ) -> PathReport:
        """Returns where a path comes closest to a contact, or why it is not free.

        path: (N, J) positions of `joints`, radians and metres; or a Trajectory of them.
        joints, pairs, margin, max_evaluations: as in check_path().
        meanwhile: likewise. A depth that growth alone makes has a lower bound of -inf.

        If the path is free: its least distance, to 1 mm, and where it is. Otherwise the first contact, its pair, and
        the deepest of 33 states of the motion from there on, with the penetration depth. Takes up to a hundred times as
        long as check_path(), whose verdict is included. Raises as check_path() does.
        """
        return explain_path(self, path, joints, pairs, margin, max_evaluations, meanwhile)

    def explain_stop(
        self,
        positions: Any,
        velocities: Any,
        joints: JointsRef,
        deceleration: Any,
        reaction_s: float = 0.0,
        others: Others = None,
        pairs: Pairs = None,
        margin: float = 0.0,
        together: bool = True,
    ) -> tuple[Separation, ...]:
        """Returns the terms of the protective separation distance from each of the others, and from their followers.

        Arguments are those of check_stop(). Takes two queries of distances for each. Their sum is more cautious than
        check_stop(), which considers all states of the path at once. Raises as check_stop().
        """
        rest = {"joints": joints, "deceleration": deceleration, "reaction_s": reaction_s, "others": others}
        return separations(
            self, positions, velocities, {**rest, "pairs": pairs, "margin": margin, "together": together}
        )


def _plan(
    engine: Any,
    start: Any,
    goal: Any,
    joints: JointsRef,
    pairs: Pairs,
    margin: Margin,
    search: dict[str, Any],
    clearance: bool,
    certificate: bool,
) -> PathPlan:
    """Implements Plans.plan(). search: range, max_iterations, shortcuts and seed."""
    options = _checked(search)
    with_clearance, with_certificate = to_bool(clearance, "clearance"), to_bool(certificate, "certificate")
    common: dict[str, Any] = {"joints": joints, "pairs": pairs, "margin": margin}
    prepared = engine.prepare("motions", reduce="any", fields="verdict", **common)
    ends = _ends(start, goal, prepared._query.joint_count)
    check = engine.check(ends, **common)
    if not check:
        return PathPlan(None, _why_not(check), check, 0, 0)

    run, _, _ = prepared._call.read(ends[:1], ends[1:])
    states, iterations, motions = prepared._retried(
        lambda current, *_: engine._find_path(current, ends, **options), (run, None, None)
    )
    if not len(states):
        reason = f"no path after {iterations} iterations"
        if not engine.wait_covers(0.0):
            reason += "; covers, which make them faster, are not ready: wait_covers()"
        return PathPlan(None, reason, check, iterations, motions)

    path = states.reshape(-1, ends.shape[1])
    bounds: Optional[tuple[float, float]] = None
    proof: Optional[Certificate] = None
    if with_clearance:
        least = engine.motions(path[:-1], path[1:], reduce="min", joints=joints, pairs=pairs)
        bounds = float(least.lower.min()), float(least.upper.min())
    if with_certificate:
        proof = engine.certificate(start=path[:-1], end=path[1:], reduce="any", **common)
    return PathPlan(path, "", check, iterations, motions, bounds, proof)


def _ends(start: Any, goal: Any, joints: int) -> np.ndarray:
    rows = []
    for value, what in ((start, "start"), (goal, "goal")):
        row = to_floats(value, what, "(J,) numbers")
        if row.shape != (joints,):
            raise ValueError(f"{what}: expected shape ({joints},), one number for each joint, got {row.shape}")
        if not np.isfinite(row).all():
            raise ValueError(f"{what}: expected finite numbers, got {row.tolist()}")
        rows.append(row)
    return np.array(rows)


def _checked(search: dict[str, Any]) -> dict[str, Any]:
    """Returns the options of the search, or raises an error that names one."""
    options: dict[str, Any] = {name: to_count(search[name], name) for name in ("max_iterations", "shortcuts")}
    options["shortcuts"] = min(options["shortcuts"], 2**32 - 1)
    options["range"] = to_number_from_0(search["range"], "range")
    if not 0 < options["range"] < math.inf:
        raise ValueError(f"range: expected a number above 0, got {search['range']!r}")
    options["seed"] = to_integer(search["seed"], "seed") % 2**64
    return options


def _why_not(check: Check) -> str:
    for k, what in enumerate(("the start", "the goal")):
        if not check.free[k]:
            a, b = check.pair_names[k]
            proved = "is" if check.hit[k] else "is not proved not to be"
            return f"{what} is not free: the pair {a}, {b} {proved} within its margin"
    violation = check.limit_violations[0]
    return f"{('the start', 'the goal')[violation.configuration]} is beyond the limits of a joint: {violation}"
