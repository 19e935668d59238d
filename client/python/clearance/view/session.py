"""Data source of a page: an engine in this process, or a daemon as its client."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Optional

import numpy as np

from .._errors import ClearanceError, NewEpoch, QueryError
from .._front import Front
from .._joints import Joints
from ..wire import ErrorCode
from .edge import Edge, certified_edge
from .model import Picture, ViewQuery, WhatIf, all_joints, look, positions_now, shapes_of
from .shapes import Shape

if TYPE_CHECKING:
    from .._scene.scene import Scene
    from .shadow import Shadow


class Session:
    """Pictures of one front.

    front: an Engine, whose joints the sliders move; or a Client, whose daemon is queried but never changed.
    scene: source of shapes and of link poses for other joint positions. Without it, bodies are bounding balls.
    """

    def __init__(self, front: Front, scene: Optional[Scene], source: str):
        self.front = front
        self.scene = scene
        self.source = source
        self.asks_only = front._is_remote
        self.generation = 0  #: incremented when bodies have changed
        self.warning = ""
        self.shapes: list[Shape] = []
        self.known: list[bool] = []  #: whether the scene has a body's shape
        self.joints: Optional[Joints] = None
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

    def edge(self, start: np.ndarray, end: np.ndarray, margin: float, spans: int) -> Edge:
        """Returns the edge between (J,) positions, as certified_edge() does."""
        if self.joints is None:
            raise ValueError("edge: the scene has no robot")
        return certified_edge(self.front, self.joints, start, end, margin, spans)

    def trace(self, edge: Edge, each: int = 4) -> Optional[np.ndarray]:
        """Returns the path of the body that moves farthest, (S * each + 1, 3) metres, or None without a scene."""
        times = np.linspace(0.0, 1.0, len(edge.spans) * each + 1)
        ways = [self._poses(WhatIf(edge.joints, edge.at(t))) for t in times.tolist()]
        there = [way for way in ways if way is not None]
        if len(there) < len(ways):
            return None
        points = np.stack(there)[:, :, :3]
        lengths = np.linalg.norm(np.diff(points, axis=0), axis=2).sum(axis=0)
        way: np.ndarray = points[:, int(np.argmax(lengths))]
        return way

    def _poses(self, what_if: WhatIf) -> Optional[np.ndarray]:
        return None if self._shadow is None else self._shadow.poses(self.front, what_if)


def reason(error: Exception) -> str:
    """Returns the page's message for an error."""
    return f"{type(error).__name__}: {error}" if isinstance(error, ClearanceError) else str(error)
