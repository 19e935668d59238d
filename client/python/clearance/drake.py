"""Drake's collision checker over Clearance, with its names. Edges are proved, not sampled.

    import clearance.drake
    checker = clearance.drake.CollisionChecker(diagram, [arm_instance], padding=0.01)
    checker.CheckEdgeCollisionFree(q1, q2)

Requires the package drake (tested with 1.51.1).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.multibody.tree import BodyIndex
from pydrake.planning import RobotClearance, RobotCollisionType

from ._adapters.drake import DrakeWorld
from ._arguments import to_number_from_0
from ._words import Status


class CollisionChecker:
    """Checks configurations and edges of the plant of a RobotDiagram. It is no pydrake.planning.CollisionChecker.

    model: a RobotDiagram (or anything with plant() and scene_graph()), which must not change.
    robot_model_instances: model instances of the robot, with at least one body; only pairs with one of their bodies
        count.
    padding: metres >= 0; pairs at this distance or nearer are in collision.
    max_evaluations: maximum evaluations per edge; an edge that needs more counts as not free.

    Configurations q are all positions of the plant, in its order: (num_positions,). Pairs that the SceneGraph filters
    do not count. Meshes are their convex hulls, as in Drake's distances. Quaternions of an edge move as in motions().

    Raises ValueError, naming it, for a joint, shape or geometry without a counterpart, and for a proximity geometry of
    the SceneGraph that is none of the plant's.
    """

    def __init__(
        self, model: Any, robot_model_instances: Sequence[Any], padding: float = 0.0, max_evaluations: int = 256
    ):
        plant = model.plant()
        self.world = DrakeWorld(plant, model.scene_graph())
        self._robot = {int(i) for instance in robot_model_instances for i in plant.GetBodyIndices(instance)}
        if not self._robot:
            raise ValueError("robot_model_instances: expected model instances with bodies, got none")
        engine = self.world.engine
        #: The body of the plant of each body of the scene that is a geometry.
        self._body = {engine.body_id(name): body for name, (_, body) in self.world.geometries.items()}
        pairs = [pair for pair in engine.pairs.tolist() if self._robot & {self._body[body] for body in pair}]
        self._pairs = np.array(pairs, np.uint32).reshape(-1, 2)
        self.padding = to_number_from_0(padding, "padding")
        self._of_robot = np.array([body in self._robot for body in self.world.column_bodies], dtype=bool)
        self._columns = np.array(self.world.columns, dtype=int)[self._of_robot]
        self._num_positions = int(plant.num_positions())
        common = {"pairs": self._pairs, "margin": self.padding, **self.world.moving}
        self._check = engine.prepare("check", **common)
        self._edges = engine.prepare("motions", reduce="any", max_evaluations=max_evaluations, **common)
        self._contacts = engine.prepare(
            "motions", reduce="any", max_evaluations=max_evaluations, fields=("status", "first_contact"), **common
        )

    def CheckConfigCollisionFree(self, q: Any) -> bool:
        """Returns whether every pair is proved farther apart than the padding."""
        return bool(self.CheckConfigsCollisionFree([q])[0])

    def CheckConfigsCollisionFree(self, configs: Any) -> np.ndarray:
        """Returns the same for (K, num_positions) configurations: (K,) bool."""
        return np.array(self._check.run(self.world.configurations(configs)).free)

    def CheckEdgeCollisionFree(self, q1: Any, q2: Any) -> bool:
        """Returns whether every pair is proved farther apart than the padding on the whole straight edge."""
        return bool(self.CheckEdgesCollisionFree([(q1, q2)])[0])

    def CheckEdgesCollisionFree(self, edges: Any) -> np.ndarray:
        """Returns the same for K pairs of configurations: (K,) bool."""
        return np.array(self._edges.run(*self._ends(edges)).status == Status.BEYOND)

    def MeasureEdgeCollisionFree(self, q1: Any, q2: Any) -> float:
        """Returns the share of the edge, 0 to 1, that is proved free from its start on; 1 only if all of it is."""
        result = self._contacts.run(*self._ends([(q1, q2)]))
        if result.status[0] == Status.BEYOND:
            return 1.0
        return float(min(result.first_contact[0, 0], np.nextafter(1.0, 0.0)))

    def CalcRobotClearance(self, q: Any, influence_distance: float) -> Any:
        """Returns a pydrake.planning.RobotClearance of the pairs nearer than influence_distance, in metres.

        Distances are certified lower bounds minus the padding, below 0 by the depth of an overlap. A row belongs to a
        pair of geometries; its Jacobian has a column for each position of the robot, in m/rad or m/m.

        Raises ValueError for a robot with quaternions, and RuntimeError for an overlap without a direction.
        """
        engine, out = self.world.engine, RobotClearance(self._num_positions)
        if "joints" not in self.world.moving or self._floats():
            raise ValueError("CalcRobotClearance: expected a robot whose positions are all of joints, not quaternions")
        near = engine.distances(
            configurations=self.world.configurations(q), pairs=self._pairs, reduce="within", signed_distance=True,
            max_distance=max(influence_distance + self.padding, 0.0), fields=("lower", "gradient_joints"),
            **self.world.moving,
        )  # fmt: skip
        for (a, b), lower, gradient in zip(near.pairs.tolist(), near.lower.tolist(), near.gradient_joints):
            if not np.isfinite(gradient).all():
                names = " and ".join(engine.bodies[body].name for body in (a, b))
                raise RuntimeError(f"{names} overlap, and no direction separates them")
            first, second = self._body[a], self._body[b]
            if first not in self._robot:
                first, second = second, first
            both = second in self._robot
            kind = RobotCollisionType.kSelfCollision if both else RobotCollisionType.kEnvironmentCollision
            jacobian = np.zeros(self._num_positions)
            jacobian[self._columns] = gradient[self._of_robot]
            if lower - self.padding < influence_distance:
                out.Append(BodyIndex(first), BodyIndex(second), kind, lower - self.padding, jacobian)
        return out

    def _floats(self) -> bool:
        """Whether a quaternion places a body of the robot."""
        return bool(self._robot & set(self.world.placed_bodies))

    def _ends(self, edges: Any) -> tuple[Any, Any]:
        rows = np.asarray(edges, dtype=float)
        if rows.ndim != 3 or rows.shape[1:] != (2, self._num_positions):
            raise ValueError(f"edges: expected shape (K, 2, {self._num_positions}), got {rows.shape}")
        return self.world.configurations(rows[:, 0]), self.world.configurations(rows[:, 1])
