"""Data source of a page: an engine in this process, or a daemon as its client."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Optional

import numpy as np

from .._errors import ClearanceError, NewEpoch, QueryError
from .._front.front import Front
from .._joints import Joints
from ..wire import ErrorCode
from .covers import Balls, cover_of
from .edge import Edge, certified_edge
from .model import Picture, ViewQuery, WhatIf, all_joints, look, positions_now, shapes_of
from .path import ProvedPath, joints_of, proved_path
from .shapes import Shape

if TYPE_CHECKING:
    from .._query.trajectory import Trajectory
    from .._scene.scene import Scene
    from .shadow import Shadow

_MOST_PLACES = 2000  # of a path, at which bodies are placed


class Session:
    """Pictures of one front.

    front: an Engine, whose joints the sliders move; or a Client, whose daemon is queried but never changed.
    scene: source of shapes and of link poses for other joint positions. Without it, bodies are bounding balls.
    path: a path to show, with the names of its joints.
    """

    def __init__(self, front: Front, scene: Optional[Scene], source: str, path: Optional[Trajectory] = None):
        self.front = front
        self.path = path
        self.scene = scene
        self.source = source
        self.asks_only = front._is_remote
        self.generation = 0  #: incremented when bodies have changed
        self.warning = ""
        self.shapes: list[Shape] = []
        self.known: list[bool] = []  #: whether the scene has a body's shape
        self.joints: Optional[Joints] = None
        self.covers: dict[int, tuple[Balls, ...]] = {}  #: by body, as far as make_cover() has made them
        self.uncovered: list[int] = []  #: ids of bodies whose covers are still to be made
        self._shadow: Optional[Shadow] = None
        self._revision = -1
        self.refresh()

    def refresh(self) -> None:
        """Fetches bodies and joints again."""
        self.shapes = shapes_of(self.front, self.scene)
        named = set() if self.scene is None else {body.name for body in self.scene.bodies}
        self.known = [body.name in named for body in self.front.bodies]
        self.joints = all_joints(self.front)
        self._shadow = self._make_shadow()
        self.covers = {}
        shaped = [body for body, known in zip(self.front.bodies, self.known) if known and body.piece_count]
        self.uncovered = [body.id for body in sorted(shaped, key=lambda body: body.is_static)]  # robots first
        self._revision = self.front.scene_revision
        self.generation += 1

    def _make_shadow(self) -> Optional[Shadow]:
        self.warning = ""
        if self.scene is None:
            return None
        from .shadow import Shadow  # a client-only install has neither an engine nor a scene

        shadow = Shadow(self.scene)
        if shadow.fits(self.front):
            return shadow
        self.warning = "The daemon's scene has other bodies than the file: those it does not name are drawn as balls."
        return None

    def positions(self) -> np.ndarray:
        """Returns (J,) current joint positions."""
        return positions_now(self.front)

    def picture(self, question: ViewQuery, elsewhere: Optional[np.ndarray] = None) -> Picture:
        """Returns one picture. elsewhere: (J,) hypothetical positions, which an engine in this process is set to.

        Adopts a new scene after a change or a restart of the daemon. Raises as Front.distances().
        """
        try:
            picture = self._picture(question, elsewhere)
            if self.front.scene_revision == self._revision:
                return picture
            # The query has adopted a new scene.
        except NewEpoch:
            self.front.acknowledge_epoch()  # type: ignore[attr-defined]  # only a Client raises it
        except QueryError as error:
            if error.code != ErrorCode.WRONG_SCENE:
                raise
        self.front.refresh()  # type: ignore[attr-defined]
        self.refresh()
        return self._picture(question, None)

    def _picture(self, question: ViewQuery, elsewhere: Optional[np.ndarray]) -> Picture:
        if self.front.scene_revision != self._revision:
            self.refresh()
            elsewhere = None
        if elsewhere is None or self.joints is None:
            return look(self.front, question)
        if not self.asks_only:
            self.front.set_joints(elsewhere, self.joints)
            return look(self.front, question)
        what_if = WhatIf(self.joints, elsewhere)
        picture = look(self.front, question, what_if)
        poses = self._poses(what_if)
        return picture if poses is None else replace(picture, poses=poses)

    def make_cover(self) -> None:
        """Makes the cover of one more body, or reads it from the cache. No-op until picture() adopts a change."""
        if self.uncovered and self.scene is not None and self.front.scene_revision == self._revision:
            body = self.uncovered.pop(0)
            ids = {info.name: info.id for info in self.scene.bodies}
            self.covers[body] = cover_of(self.scene, ids[self.front.bodies[body].name])

    def edge(self, start: np.ndarray, end: np.ndarray, margin: float, spans: int) -> Edge:
        """Returns the edge between (J,) positions, as certified_edge() does."""
        if self.joints is None:
            raise ValueError("edge: the scene has no robot")
        return certified_edge(self.front, self.joints, start, end, margin, spans)

    def trace(self, edge: Edge, each: int = 4) -> Optional[np.ndarray]:
        """Returns the path of the body that moves farthest, (S * each + 1, 3) metres, or None without a scene."""
        times = np.linspace(0.0, 1.0, len(edge.spans) * each + 1)
        points = self._places(edge.joints, [edge.at(t) for t in times.tolist()])
        if points is None:
            return None
        way: np.ndarray = points[:, int(np.argmax(_lengths(points)))]
        return way

    def proved_path(self, margin: float) -> ProvedPath:
        """Returns the path with its proofs, as proved_path() does."""
        if self.path is None:
            raise ValueError("path: none was given")
        return proved_path(self.front, self.path, margin)

    def ways(self, proved: ProvedPath, each: int = 16) -> Optional[np.ndarray]:
        """Returns the polylines of all bodies that a path moves, (K * each + 1, B, 3) metres, or None without a scene.

        each: places of a motion, fewer for many motions.
        """
        each = max(1, min(each, _MOST_PLACES // len(proved.path)))
        shares = np.arange(each) / each
        times = [proved.time_of(k, t) for k in range(len(proved.path)) for t in shares.tolist()]
        points = self._places(proved.joints, [proved.path.at(t) for t in (*times, float(proved.path.times[-1]))])
        return None if points is None else points[:, _lengths(points) > 1e-6]

    def along(self, time: float) -> Optional[np.ndarray]:
        """Returns (J,) positions of all joints with those of the path at a time in seconds."""
        if self.path is None or self.joints is None:
            return None
        names = list(self.joints.names)
        row = self.positions()
        row[[names.index(name) for name in joints_of(self.front, self.path).names]] = self.path.at(time)
        return row

    def _places(self, joints: Joints, rows: list[np.ndarray]) -> Optional[np.ndarray]:
        """Returns (S, N, 3) origins of bodies for S rows of positions, or None without a scene."""
        poses = [self._poses(WhatIf(joints, row)) for row in rows]
        there = [each[:, :3] for each in poses if each is not None]
        return np.stack(there) if len(there) == len(poses) else None

    def _poses(self, what_if: WhatIf) -> Optional[np.ndarray]:
        return None if self._shadow is None else self._shadow.poses(self.front, what_if)


def _lengths(points: np.ndarray) -> np.ndarray:
    lengths: np.ndarray = np.linalg.norm(np.diff(points, axis=0), axis=2).sum(axis=0)
    return lengths


def reason(error: Exception) -> str:
    """Returns the page's message for an error."""
    return f"{type(error).__name__}: {error}" if isinstance(error, ClearanceError) else str(error)
