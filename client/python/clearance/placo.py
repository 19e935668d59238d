"""placo over Clearance: rows that keep a robot's links apart and away from obstacles, for placo's kinematics solver.

    import placo, clearance.placo
    avoidance = clearance.placo.CollisionAvoidance(solver)            # a placo.KinematicsSolver
    avoidance.engine.add_body("table", box=[1, 1, 0.1], pose=[0.5, 0, -0.05, 1, 0, 0, 0])
    avoidance.update()                                                # before each solver.solve()

Requires the package placo (tested with 0.10.2).
"""

from __future__ import annotations

from typing import Any, Optional

import numpy as np

from ._adapters.pinocchio import PinocchioWorld, from_pinocchio
from ._arguments import to_number_from_0
from ._words import Status


class CollisionAvoidance:
    """A constraint of a placo.KinematicsSolver, with a row for each near pair of bodies.

    To first order, a step reduces the distance of a pair by at most gain * (lower - minimum_distance), where lower is
    the certified lower bound. Curvature is not part of a row, so limit the length of steps: set solver.dt, and enable
    velocity limits.

    solver: its robot's joints must be revolute with limits, or prismatic, as placo's half-spaces require.
    world: result of from_pinocchio(robot.collision_model, robot.model). Default: made here. Obstacles are bodies that
        you add to its engine; they may move.
    minimum_distance, detection_distance: metres, the second at least the first. Rows are the pairs that may be nearer
        than detection_distance.
    gain: above 0, at most 1.
    recovery: metres that a pair below the minimum distance must gain in a step, at most.
    base_is_fixed: masks the floating base, which placo's rows cannot contain. If False, only the pairs of links count,
        and update() raises ValueError for a scene with obstacles.

    Raises ValueError for an argument out of range and for other joints, and as from_pinocchio() does.
    """

    def __init__(
        self,
        solver: Any,
        world: Optional[PinocchioWorld] = None,
        minimum_distance: float = 0.005,
        detection_distance: float = 0.05,
        gain: float = 0.5,
        *,
        recovery: float = 0.001,
        base_is_fixed: bool = True,
    ):
        if not 0 < gain <= 1:
            raise ValueError(f"gain: expected a number above 0 and at most 1, got {gain}")
        self.gain = gain
        self.minimum_distance = to_number_from_0(minimum_distance, "minimum_distance")
        self.detection_distance = to_number_from_0(detection_distance, "detection_distance")
        if self.detection_distance < self.minimum_distance:
            least = f"minimum_distance, {self.minimum_distance:g}"
            raise ValueError(f"detection_distance: expected at least {least}, got {self.detection_distance:g}")
        self.recovery = to_number_from_0(recovery, "recovery")
        self._robot = robot = solver.robot
        if robot.model.nq - 7 != robot.model.nv - 6:
            raise ValueError("solver: the robot has a joint with more numbers than degrees of freedom (continuous?)")
        self.world = from_pinocchio(robot.collision_model, robot.model) if world is None else world
        self.engine = self.world.engine
        self._links = {item.name for item in robot.collision_model.geometryObjects}
        self._base_is_fixed = base_is_fixed
        if base_is_fixed:
            solver.mask_fbase(True)
        self._columns = [robot.get_joint_offset(name.split("/", 1)[1]) for name in self.world.moving["joints"]]
        self._near = self.engine.prepare(
            reduce="within",
            max_distance=self.detection_distance,
            signed_distance=True,
            fields=("lower", "status", "gradient_joints"),
            **self.world.moving,
        )
        #: placo's constraint, for example to configure() its priority.
        self.constraint = solver.add_joint_space_half_spaces_constraint(*self._no_rows())
        self.constraint.configure("clearance", "hard")

    def _no_rows(self) -> tuple[np.ndarray, np.ndarray]:
        """A row that holds always, since placo requires one."""
        return np.zeros((1, self._robot.model.nq)), np.ones(1)

    def update(self) -> float:
        """Computes the rows at the robot's configuration. Returns the least lower bound of all pairs, in metres.

        It is at most the detection distance, and below 0 if bodies overlap. Test it before each step: a pair whose
        distance no joint changes counts, but has no row.
        Pairs that may touch, as a base and its table, do not count after engine.allow().

        Raises RuntimeError, naming the bodies, for a near pair without a distance or a direction: one without a pose,
        or two bodies deep in each other.
        """
        if not self._base_is_fixed:
            self._reject_obstacles()
        q = np.array(self._robot.state.q)
        near = self._near.run(self.world.configurations(q))
        slopes = near.gradient_joints
        bad = (near.status >= Status.BAD_POSE) | ~np.isfinite(slopes).all(axis=1)
        if bad.any():
            row = int(bad.argmax())
            names = " and ".join(self.engine.bodies[body].name for body in near.pairs[row])
            raise RuntimeError(f"{names}: {Status(near.status[row]).name}, without a direction that separates them")
        kept = (slopes != 0).any(axis=1)
        rows, bounds = self._no_rows()
        if kept.any():
            rows = np.zeros((int(kept.sum()), len(q)))
            rows[:, self._columns] = -slopes[kept]
            gaps = near.lower[kept] - self.minimum_distance
            bounds = np.maximum(self.gain * gaps, -self.recovery) + rows @ q
        self.constraint.A, self.constraint.b = rows, bounds
        return float(near.lower.min(initial=self.detection_distance))

    def _reject_obstacles(self) -> None:
        others = [body.name for body in self.engine.bodies if body.piece_count and body.name not in self._links]
        if others:
            raise ValueError(f"base_is_fixed: rows for {others[0]!r} need a fixed base")
