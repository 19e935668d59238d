"""Balls of covers over the bodies, one level at a time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Optional

import numpy as np

from .shapes import sphere_of_directions

if TYPE_CHECKING:
    import viser

    from .._scene.scene import Scene

#: Levels of a cover; level 0 is one ball.
LEVELS = 4
_HOLLOW, _INSIDE = (245, 158, 11), (47, 158, 98)  # of outer balls, and of those within the body


@dataclass(frozen=True)
class Balls:
    """Balls of one level, in the body's frame and metres. Together they contain the body, its interior included."""

    centres: np.ndarray  #: (N, 3) float32
    outer: np.ndarray  #: (N,) float32 radii: each ball contains its share of the body
    inner: np.ndarray  #: (N,) float32: above 0, radii of balls about the same centres that lie within the body

    @property
    def width(self) -> float:
        """Greatest width of the bounds that the level gives, in metres."""
        return float(np.max(self.outer.astype(np.float64) - np.maximum(self.inner, 0.0)))


def cover_of(scene: Scene, body: int) -> tuple[Balls, ...]:
    """Returns the balls of each level of a body's cover, or () for a body without one.

    Takes seconds if the cache lacks the cover.
    """
    return tuple(Balls(rows[:, :3], rows[:, 3], rows[:, 4]) for rows in scene._scene.cover(body))


class DrawnBalls:
    """The balls of one body, children of its frame."""

    def __init__(self, scene: viser.SceneApi, path: str):
        self._scene, self._path = scene, path
        self._level: Optional[int] = None
        self._handles: list[Any] = []

    def show(self, cover: Sequence[Balls], level: Optional[int]) -> None:
        """Draws a level, or nothing for None and for a body without a cover."""
        if not cover:
            level = None
        if level == self._level:
            return
        self._level = level
        for handle in self._handles:
            handle.remove()
        self._handles = []
        if level is not None:
            balls = cover[level]
            inside = balls.inner > 0
            self._draw("outer", balls.centres, balls.outer, _HOLLOW, 0.18)
            self._draw("inner", balls.centres[inside], balls.inner[inside], _INSIDE, 0.5)

    def _draw(
        self, name: str, centres: np.ndarray, radii: np.ndarray, colour: tuple[int, int, int], opacity: float
    ) -> None:
        if not len(centres):
            return
        vertices, triangles = sphere_of_directions(2)
        handle = self._scene.add_batched_meshes_simple(
            f"{self._path}/{name}", vertices.astype(np.float32), triangles, np.tile([1.0, 0, 0, 0], (len(centres), 1)),
            centres, batched_scales=radii, batched_colors=colour, opacity=opacity, cast_shadow=False,
        )  # fmt: skip
        self._handles.append(handle)
