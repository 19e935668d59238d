"""A model of another project as a scene, and its states."""

from __future__ import annotations

import functools
from typing import Any, Optional

import numpy as np

from .._arguments import to_floats
from .._front.engine import Engine
from .._front.front import Front
from .._scene.scene import Scene


class World:
    """A scene made from a model, and the model's configurations."""

    scene: Scene
    moving: dict[str, Any]  #: the arguments joints and bodies of a query about configurations()

    def __init__(self, scene: Scene, joints: list[str], placed: list[str], first: np.ndarray):
        """joints: with positions. placed: bodies that poses place. first: (nq,) the initial configuration."""
        self.scene = scene
        self.moving = {key: names for key, names in (("joints", joints), ("bodies", placed)) if names}
        self._first = first

    def _positions(self, rows: np.ndarray) -> np.ndarray:
        """(K, J) positions of the joints at (K, nq) configurations."""
        raise NotImplementedError

    def _poses(self, rows: np.ndarray) -> np.ndarray:
        """(K, M, 7) poses of the placed bodies at (K, nq) configurations."""
        raise NotImplementedError

    @functools.cached_property
    def engine(self) -> Engine:
        """An engine of the scene, made when first used, at the model's initial configuration."""
        engine = Engine(self.scene)
        self._send(engine, self._first)
        return engine

    def set_state(self, q: Any, engine: Optional[Front] = None, stamp_ns: int = 0) -> None:
        """Sets the positions of all joints, and the poses that belong to the configuration.

        q: (nq,) radians, metres and quaternions, as in the model's project.
        engine: an Engine or Client of world.scene. Default: world.engine. Joints and poses are two updates.
        stamp_ns: as in set_poses().

        Raises ValueError for a wrong shape, and as set_joints() and set_poses() do.
        """
        row = self._rows(q, "q")
        if row.ndim != 1:
            raise ValueError(f"q: expected ({len(self._first)},) numbers, got shape {row.shape}")
        self._send(self.engine if engine is None else engine, row, stamp_ns)

    def configurations(self, q: Any) -> Any:
        """Converts (K, nq) rows to configurations of a query: with **world.moving, also of motions.

        Motions are straight in positions. Bodies that poses place move with constant velocities, their origins on a
        line. Raises ValueError for a wrong shape.
        """
        rows = np.atleast_2d(self._rows(q, "q"))
        positions, poses = np.ascontiguousarray(self._positions(rows)), self._poses(rows)
        if "bodies" not in self.moving:
            return positions
        return (positions, poses) if "joints" in self.moving else poses

    def _rows(self, value: Any, what: str) -> np.ndarray:
        rows, nq = to_floats(value, what), len(self._first)
        if rows.ndim not in (1, 2) or rows.shape[-1] != nq:
            raise ValueError(f"{what}: expected ({nq},) or (K, {nq}) numbers, got shape {rows.shape}")
        return rows

    def _send(self, engine: Front, q: np.ndarray, stamp_ns: int = 0) -> None:
        if "joints" in self.moving:
            engine.set_joints(self._positions(q[None])[0], joints=self.moving["joints"], stamp_ns=stamp_ns)
        if "bodies" in self.moving:
            engine.set_poses(self._poses(q[None])[0], bodies=self.moving["bodies"], stamp_ns=stamp_ns)
