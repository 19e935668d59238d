"""OMPL over Clearance: validity of states, motions that are *proved* free, clearance as an objective, shortcuts.

    import clearance, clearance.ompl
    problem = clearance.ompl.JointProblem(engine, "panda/panda_arm", margin=0.01)
    si = problem.space_information()
    planner = og.RRTConnect(si)

Needs the package ompl (2.0.1 is what is tested), which nothing else of this package does.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Optional

import numpy as np
from ompl import base as ob

from ._front import Front, Margin, Pairs
from ._joints import JointsRef
from ._words import Status


class JointProblem:
    """Joints of a robot as a state space, and an engine or client that says what is free.

    engine: an Engine or a Client.
    joints: as in distances(). A joint with limits is a number between them; one without is an angle on a circle (SO2),
        along which OMPL goes the shorter way, and what is asked about is that way, unwrapped.
    margin, pairs: as in check(): farther than this every pair has to be.
    max_steps: configurations that the proof of a motion may ask for; one that needs more is not taken for free.
    """

    def __init__(
        self,
        engine: Front,
        joints: JointsRef,
        margin: Margin = 0.0,
        pairs: Pairs = None,
        max_steps: int = 256,
    ):
        self.engine = engine
        self.joints = engine.joints(joints)
        self.asked: dict[str, Any] = {"joints": self.joints, "margin": margin, "pairs": pairs}
        self.max_steps = max_steps
        bounded = np.isfinite(self.joints.lower) & np.isfinite(self.joints.upper)
        self._bounded: list[int] = np.flatnonzero(bounded).tolist()
        self._turning: list[int] = np.flatnonzero(~bounded).tolist()
        self.space = self._make_space()

    def _make_space(self) -> Any:
        space = ob.CompoundStateSpace()
        if len(self._bounded):
            numbers = ob.RealVectorStateSpace(len(self._bounded))
            bounds = ob.RealVectorBounds(len(self._bounded))
            for i, j in enumerate(self._bounded):
                bounds.setLow(i, float(self.joints.lower[j]))
                bounds.setHigh(i, float(self.joints.upper[j]))
            numbers.setBounds(bounds)
            space.addSubspace(numbers, 1.0)
        for _ in self._turning:
            space.addSubspace(ob.SO2StateSpace(), 1.0)
        return space

    # ---- states ---------------------------------------------------------------------------------------------------

    def row(self, state: Any) -> np.ndarray:
        """(J,) positions of a state, radians and metres."""
        row = np.empty(len(self.joints))
        first = int(len(self._bounded) > 0)
        for i, j in enumerate(self._bounded):
            row[j] = state[0][i]
        for i, j in enumerate(self._turning):
            row[j] = state[first + i].value
        return row

    def state(self, row: Sequence[float]) -> Any:
        """A state of the space at (J,) positions; an angle of a joint without limits is wrapped to (-pi, pi]."""
        state = self.space.allocState()
        first = int(len(self._bounded) > 0)
        for i, j in enumerate(self._bounded):
            state[0][i] = float(row[j])
        for i, j in enumerate(self._turning):
            state[first + i].value = math.remainder(float(row[j]), 2 * math.pi)
        return state

    def unwrapped(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """`end` as OMPL gets there from `start`: joints without limits turn the shorter way. (..., J) each."""
        end = np.array(end, dtype=float)
        way = end[..., self._turning] - start[..., self._turning]
        end[..., self._turning] = start[..., self._turning] + np.arctan2(np.sin(way), np.cos(way))
        return end

    # ---- what OMPL asks -------------------------------------------------------------------------------------------

    def space_information(self) -> Any:
        """An ob.SpaceInformation of this problem, set up: validity of states, and motions that are proved free."""
        si = ob.SpaceInformation(self.space)
        si.setStateValidityChecker(StateValidity(si, self))
        si.setMotionValidator(CertifiedMotions(si, self))
        si.setup()
        return si

    def free(self, rows: np.ndarray) -> np.ndarray:
        """(K,) bool of (K, J) positions."""
        return self.engine.check(rows, **self.asked).free

    def motions(self, start: np.ndarray, end: np.ndarray) -> Any:
        """The Result of motions() with reduce="any" from (K, J) to (K, J), which go as OMPL would."""
        asked = {**self.asked, "reduce": "any", "max_steps": self.max_steps}
        return self.engine.motions(start=start, end=self.unwrapped(start, end), **asked)

    def shortened(self, path: np.ndarray) -> np.ndarray:
        """A path (N, J) with fewer waypoints, each of whose motions is proved free: from every waypoint it goes
        straight to the farthest one that it can.

        Raises ValueError where even the next waypoint is not proved to be reached.
        """
        path = np.asarray(path, dtype=float)
        kept, at = [0], 0
        while at < len(path) - 1:
            ends = path[at + 1 :]
            result = self.motions(np.tile(path[at], (len(ends), 1)), ends)
            free = np.flatnonzero(result.status == Status.BEYOND)
            if not len(free):
                raise ValueError(f"path: the motion from waypoint {at} to {at + 1} is not proved to be free")
            at += 1 + int(free[-1])
            kept.append(at)
        return path[kept]


class StateValidity(ob.StateValidityChecker):  # type: ignore[misc]  # ompl has no types
    """A state is valid where every joint is within its limits and every pair is proved farther than its margin."""

    def __init__(self, si: Any, problem: JointProblem):
        super().__init__(si)
        self._problem = problem

    def isValid(self, state: Any) -> bool:
        problem = self._problem
        return bool(problem.space.satisfiesBounds(state) and problem.free(problem.row(state)[None])[0])

    def clearance(self, state: Any) -> float:
        """Metres: the certified lower bound of the least distance."""
        problem = self._problem
        asked = {"joints": problem.joints, "pairs": problem.asked["pairs"]}
        row = problem.row(state)[None]
        return float(problem.engine.distances(positions=row, reduce="min", fields=["lower"], **asked).lower[0])


class CertifiedMotions(ob.MotionValidator):  # type: ignore[misc]
    """A motion is valid where every pair is proved farther than its margin all along, not at samples."""

    def __init__(self, si: Any, problem: JointProblem):
        super().__init__(si)
        self._problem = problem

    def checkMotion(self, start: Any, end: Any) -> bool:
        return self.last_valid(start, end) is None

    def last_valid(self, start: Any, end: Any) -> Optional[tuple[Any, float]]:
        """The last state up to which the motion is proved free, and its time, 0 to 1; None: all of it is.

        This is checkMotion() with lastValid, which OMPL's Python package does not hand on.
        """
        problem = self._problem
        a, b = problem.row(start), problem.row(end)
        result = problem.motions(a[None], b[None])
        if result.status[0] == Status.BEYOND:
            return None
        time = float(result.first_contact[0, 0])
        time = time if math.isfinite(time) else 0.0
        return problem.state(a + time * (problem.unwrapped(a, b) - a)), time


class ClearanceObjective(ob.StateCostIntegralObjective):  # type: ignore[misc]
    """Prefers paths far from everything: the integral of 1 / (clearance + softening) along the path."""

    def __init__(self, si: Any, problem: JointProblem, softening: float = 1e-2):
        super().__init__(si, True)
        self._validity = StateValidity(si, problem)
        self._softening = softening

    def stateCost(self, state: Any) -> Any:
        return ob.Cost(1.0 / (max(self._validity.clearance(state), 0.0) + self._softening))
