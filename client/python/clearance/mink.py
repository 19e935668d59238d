"""mink over Clearance: a limit that keeps geoms apart, for the quadratic program of mink's solve_ik().

    import mink, clearance.mink
    limits = [mink.ConfigurationLimit(model), clearance.mink.CollisionAvoidanceLimit(model)]
    velocity = mink.solve_ik(configuration, tasks, dt, "daqp", limits=limits)

Requires the package mink (tested with 1.3.0).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any, Optional, Union

import mujoco
import numpy as np
from mink.limits import Constraint, Limit

from ._adapters.mujoco import MujocoWorld, from_mujoco
from ._arguments import to_integer, to_number_from_0

Geoms = Sequence[Union[int, str]]


class CollisionAvoidanceLimit(Limit):  # type: ignore[misc]  # mink has no types that mypy reads here
    """Keeps pairs of geoms apart. Takes the place of mink.CollisionAvoidanceLimit, with its arguments but `broadphase`.

    Each pair nearer than the detection distance adds a row: to first order, a step reduces its distance by at most
    gain * (lower - minimum_distance), where lower is the certified lower bound. mink 1.3.0 divides that by dt, and so
    permits a step 1 / dt times as long.

    model: a mujoco.MjModel, or the result of from_mujoco() for a choice of meshes. Metres, radians.
    geom_pairs: pairs of lists of geoms, by name or id, as in mink; of them only pairs that MuJoCo collides count.
        Default: all pairs that MuJoCo collides.
    gain: above 0, at most 1.
    minimum_distance_from_collisions, collision_detection_distance, bound_relaxation: metres.
    recovery_speed: metres per second at most that a pair below the minimum distance must gain. At 0, as in mink, it
        must only lose no more to first order, and creeps nearer.

    Raises ValueError for an unknown geom and an argument out of range, and as from_mujoco().
    """

    def __init__(
        self,
        model: Union[Any, MujocoWorld],
        geom_pairs: Optional[Sequence[tuple[Geoms, Geoms]]] = None,
        gain: float = 0.85,
        minimum_distance_from_collisions: float = 0.005,
        collision_detection_distance: float = 0.01,
        bound_relaxation: float = 0.0,
        *,
        recovery_speed: float = 0.1,
    ):
        self.world = model if isinstance(model, MujocoWorld) else from_mujoco(model)
        if not 0 < gain <= 1:
            raise ValueError(f"gain: expected a number above 0 and at most 1, got {gain}")
        self.gain, self.minimum_distance = gain, minimum_distance_from_collisions
        self.bound_relaxation = bound_relaxation
        self.recovery_speed = to_number_from_0(recovery_speed, "recovery_speed")
        engine = self.world.engine
        self._geom = {engine.body_id(name): geom for geom, name in self.world.geoms.items()}
        #: MuJoCo's body of each body of the scene that is a geom.
        self._body = {body: self.world.geom_bodies[geom] for body, geom in self._geom.items()}
        self._near = engine.prepare(
            pairs=None if geom_pairs is None else self._pairs(geom_pairs),
            reduce="within",
            max_distance=to_number_from_0(collision_detection_distance, "collision_detection_distance"),
            signed_distance=True,
            fields=("lower", "normal", "points"),
            **self.world.moving,
        )

    def _pairs(self, geom_pairs: Sequence[tuple[Geoms, Geoms]]) -> np.ndarray:
        """(P, 2) ids of bodies: the pairs among geom_pairs that are enabled."""
        engine, world = self.world.engine, self.world
        body = {name: engine.body_id(name) for name in world.geoms.values()}
        wanted = set()
        for i, sides in enumerate(geom_pairs):
            lists = [[self._id(geom, f"geom_pairs[{i}]", body) for geom in side] for side in sides]
            wanted |= {(min(a, b), max(a, b)) for a, b in itertools.product(*lists) if a is not None and b is not None}
        return np.array([pair for pair in engine.pairs.tolist() if tuple(pair) in wanted], np.uint32).reshape(-1, 2)

    def _id(self, geom: Union[int, str], what: str, bodies: dict[str, int]) -> Optional[int]:
        """The body of a geom, or None if it collides with nothing."""
        if isinstance(geom, str):
            if geom not in bodies and geom not in self.world.left_out:
                raise ValueError(f"{what}: no geom is named {geom!r}")
            return bodies.get(geom)
        index, count = to_integer(geom, what), len(self.world.geom_bodies)
        if not 0 <= index < count:
            raise ValueError(f"{what}: no geom has the id {index}; the model has {count}")
        return bodies[self.world.geoms[index]] if index in self.world.geoms else None

    def compute_qp_inequalities(self, configuration: Any, dt: float) -> Constraint:
        """Returns rows G dq <= h at configuration.q for a step dq of the degrees of freedom, one for each near pair.

        Raises RuntimeError for a near pair without a direction, naming its geoms: two geoms deep in each other.
        """
        model, data = configuration.model, configuration.data
        near = self._near.run(*self.world.inputs(data))
        pairs, normals = near.pairs.tolist(), near.normal
        undirected = ~np.isfinite(normals).all(axis=1)
        if undirected.any():
            names = " and ".join(self.world.geoms[self._geom[body]] for body in pairs[int(undirected.argmax())])
            raise RuntimeError(f"{names} overlap, and no direction separates them")
        rows, (first, second) = np.empty((len(pairs), model.nv)), np.empty((2, 3, model.nv))
        for row, (a, b), normal, point_a, point_b in zip(rows, pairs, normals, near.point_a, near.point_b):
            mujoco.mj_jac(model, data, first, None, point_a, self._body[a])
            mujoco.mj_jac(model, data, second, None, point_b, self._body[b])
            np.dot(normal, first - second, out=row)
        most = self.gain * (near.lower - self.minimum_distance)
        return Constraint(G=rows, h=np.maximum(most, -self.recovery_speed * dt) + self.bound_relaxation)
