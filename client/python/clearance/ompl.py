"""OMPL over Clearance: validity of states, motions that are *proved* free, clearance as an objective, shortcuts.

    import clearance, clearance.ompl
    problem = clearance.ompl.JointProblem(engine, "panda/panda_arm", margin=0.01)
    si = problem.space_information()
    planner = og.RRTConnect(si)

Requires the package ompl (tested with 2.0.1).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Optional

import numpy as np
from ompl import base as ob

from ._front.front import Front
from ._joints import JointsRef
from ._names import Margin, Pairs
from ._words import Status


class JointProblem:
    """A robot's joints as a state space, with an engine or client that checks states and motions.

    engine: an Engine or a Client.
    joints: as in distances(). A joint with limits is a number between them; a joint without limits is an angle on a
        circle (SO2). OMPL moves it in the shorter direction, which queries receive unwrapped.
    margin, pairs: as in check(), the required clearance.
    max_evaluations: maximum evaluations per motion; a motion that needs more counts as not free.
    """

    def __init__(
        self,
        engine: Front,
        joints: JointsRef,
        margin: Margin = 0.0,
        pairs: Pairs = None,
        max_evaluations: int = 256,
    ):
        self.engine = engine
        self.joints = engine.joints(joints)
        self.requested: dict[str, Any] = {"joints": self.joints, "margin": margin, "pairs": pairs}
        self.max_evaluations = max_evaluations
        self._check = engine.prepare("check", **self.requested)
        decided: dict[str, Any] = {"reduce": "any", "max_evaluations": max_evaluations, **self.requested}
        self._motions = engine.prepare("motions", **decided)
        self._contacts = engine.prepare("motions", fields=("status", "first_contact"), **decided)
        self._least = engine.prepare(joints=self.joints, pairs=pairs, reduce="min", fields="lower")
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
        """Returns the (J,) positions of a state, radians and metres."""
        row = np.empty(len(self.joints))
        first = int(len(self._bounded) > 0)
        for i, j in enumerate(self._bounded):
            row[j] = state[0][i]
        for i, j in enumerate(self._turning):
            row[j] = state[first + i].value
        return row

    def state(self, row: Sequence[float]) -> Any:
        """Returns the state at (J,) positions. Wraps angles of joints without limits to (-pi, pi]."""
        state = self.space.allocState()
        first = int(len(self._bounded) > 0)
        for i, j in enumerate(self._bounded):
            state[0][i] = float(row[j])
        for i, j in enumerate(self._turning):
            state[first + i].value = math.remainder(float(row[j]), 2 * math.pi)
        return state

    def unwrapped(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Returns `end` unwrapped relative to `start`: joints without limits turn the shorter way. (..., J) each."""
        end = np.array(end, dtype=float)
        way = end[..., self._turning] - start[..., self._turning]
        end[..., self._turning] = start[..., self._turning] + np.arctan2(np.sin(way), np.cos(way))
        return end

    # ---- callbacks of OMPL ----------------------------------------------------------------------------------------

    def space_information(self) -> Any:
        """Returns a complete ob.SpaceInformation of this problem, with certified checks of states and motions."""
        si = ob.SpaceInformation(self.space)
        si.setStateValidityChecker(StateValidity(si, self))
        si.setMotionValidator(CertifiedMotions(si, self))
        si.setup()
        return si

    def free(self, rows: np.ndarray) -> np.ndarray:
        """Returns whether (K, J) positions are free: (K,) bool."""
        return self._check.run(rows).free

    def motions(self, start: np.ndarray, end: np.ndarray) -> Any:
        """Returns the Result of motions() with reduce="any" from (K, J) to (K, J), along OMPL's interpolation."""
        return self._motions.run(start, self.unwrapped(start, end))

    def contact(self, start: np.ndarray, end: np.ndarray) -> Any:
        """Returns the same for (J,) positions, with the columns status and first_contact."""
        return self._contacts.run(start[None], self.unwrapped(start, end)[None])

    def least(self, row: np.ndarray) -> float:
        """Returns the certified lower bound of the least distance at (J,) positions, in metres."""
        return float(self._least.run(row[None]).lower[0])

    def shortened(self, path: np.ndarray) -> np.ndarray:
        """Returns a shortcut of a path (N, J), which connects each kept waypoint to the farthest one with a motion
        proved free.

        Raises ValueError if the motion to the next waypoint is not proved free.
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
    """Validates states: joints are within their limits, and every pair is proved farther than its margin."""

    def __init__(self, si: Any, problem: JointProblem):
        super().__init__(si)
        self._problem = problem

    def isValid(self, state: Any) -> bool:
        problem = self._problem
        return bool(problem.space.satisfiesBounds(state) and problem.free(problem.row(state)[None])[0])

    def clearance(self, state: Any) -> float:
        """Returns the certified lower bound of the least distance, in metres."""
        return self._problem.least(self._problem.row(state))


class CertifiedMotions(ob.MotionValidator):  # type: ignore[misc]
    """Validates whole continuous motions, not samples: every pair is proved farther than its margin."""

    def __init__(self, si: Any, problem: JointProblem):
        super().__init__(si)
        self._problem = problem

    def checkMotion(self, start: Any, end: Any) -> bool:
        return self.last_valid(start, end) is None

    def last_valid(self, start: Any, end: Any) -> Optional[tuple[Any, float]]:
        """Returns the last state up to which the motion is proved free and its time, 0 to 1; None if all of it is.

        Replaces checkMotion() with lastValid, which OMPL's Python package does not expose.
        """
        problem = self._problem
        a, b = problem.row(start), problem.row(end)
        result = problem.contact(a, b)
        if result.status[0] == Status.BEYOND:
            return None
        time = float(result.first_contact[0, 0])
        time = time if math.isfinite(time) else 0.0
        return problem.state(a + time * (problem.unwrapped(a, b) - a)), time


class ClearanceObjective(ob.StateCostIntegralObjective):  # type: ignore[misc]
    """Prefers paths far from obstacles: the integral of 1 / (clearance + softening) along the path."""

    def __init__(self, si: Any, problem: JointProblem, softening: float = 1e-2):
        super().__init__(si, True)
        self._validity = StateValidity(si, problem)
        self._softening = softening

    def stateCost(self, state: Any) -> Any:
        return ob.Cost(1.0 / (max(self._validity.clearance(state), 0.0) + self._softening))
