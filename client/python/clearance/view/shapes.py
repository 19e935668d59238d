"""What a body looks like: triangles of its mesh, of its pieces, and its vertices, in its own frame and metres."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from .._names import BodyInfo
    from .._scene import Scene

#: What a body may be drawn as.
LOOKS = ("mesh", "pieces", "points")
#: Metres: how much of a half-space is drawn, which has no end.
HALF_SPACE_EDGE = 4.0
_FINENESS = 4  # a piece is drawn by its farthest points in 1026 directions


@dataclass(frozen=True)
class Mesh:
    """Triangles."""

    vertices: np.ndarray  #: (V, 3) float64
    triangles: np.ndarray  #: (T, 3) uint32


@dataclass(frozen=True)
class Shape:
    """A body in its own frame."""

    mesh: Sequence[Mesh]  #: as it was given; none: it was given as pieces
    hulls: Sequence[tuple[np.ndarray, float]]  #: vertices and radius of each convex piece; none: the mesh is what it is
    points: np.ndarray  #: (V, 3) vertices of what bounds are about

    def look(self, look: str) -> Sequence[Mesh]:
        """The meshes of a look; of "points" none. Pieces are made anew each time, some milliseconds each."""
        if look == "points":
            return ()
        if not self.hulls or (look == "mesh" and self.mesh):
            return self.mesh
        return [hull_mesh(vertices, radius) for vertices, radius in self.hulls]


EMPTY = Shape((), (), np.zeros((0, 3)))


def shape_of(scene: Scene, body: BodyInfo) -> Shape:
    """The shape of a scene's body; of a frame, which has none, EMPTY."""
    if not body.piece_count:
        return EMPTY
    if math.isinf(body.extent):
        square = Mesh(*_square(HALF_SPACE_EDGE))
        return Shape((square,), (), square.vertices)
    given = scene._scene.display(body.id)  # Scene's own methods look through all names for each body
    mesh = None if given is None else Mesh(*given)
    pieces = scene._scene.pieces(body.id)
    points = np.concatenate([vertices for vertices, _ in pieces])
    # A point with a radius is a round shape, whose picture is finer than any made here; triangles are what they are.
    if mesh and (body.triangle_count or all(len(vertices) == 1 for vertices, _ in pieces)):
        return Shape((mesh,), (), mesh.vertices)
    return Shape((mesh,) if mesh else (), pieces, points)


def unknown_shape(body: BodyInfo) -> Shape:
    """Of a body whose shape this process does not have: the ball that holds it."""
    if not body.piece_count or not math.isfinite(body.extent):
        return EMPTY
    directions, triangles = sphere_of_directions(2)
    ball = Mesh(directions * body.extent, triangles)
    return Shape((ball,), (), np.zeros((1, 3)))


def hull_mesh(vertices: np.ndarray, radius: float = 0.0) -> Mesh:
    """The hull of (V, 3) vertices grown by a radius, as triangles between its farthest points in many directions.

    It lies within the hull, and has every vertex that is farthest in one of these directions: exact for a box.
    """
    directions, triangles = sphere_of_directions(_FINENESS)
    farthest = np.empty(len(directions), dtype=np.int64)
    for first in range(0, len(directions), 256):  # a few MB at a time, however many vertices there are
        farthest[first : first + 256] = np.argmax(directions[first : first + 256] @ vertices.T, axis=1)
    if radius > 0:
        return Mesh(vertices[farthest] + radius * directions, triangles)
    used, place = np.unique(farthest, return_inverse=True)
    corners = place.reshape(-1)[triangles]
    a, b, c = corners.T
    kept = (a != b) & (b != c) & (c != a)
    # The same triangle comes again where a face is seen from several directions: each begins with its least corner.
    corners = corners[kept]
    order = (np.argmin(corners, axis=1)[:, None] + np.arange(3)) % 3
    unique = np.unique(np.take_along_axis(corners, order, axis=1), axis=0)
    return Mesh(vertices[used], unique.astype(np.uint32))


_SPHERES: dict[int, tuple[np.ndarray, np.ndarray]] = {}


def sphere_of_directions(fineness: int) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) unit vectors and (T, 3) triangles between them: an octahedron, each triangle parted `fineness` times."""
    known = _SPHERES.get(fineness)
    if known is not None:
        return known
    points = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=np.float64)
    triangles = np.array([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]])
    for _ in range(fineness):
        edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        unique, place = np.unique(edges, axis=0, return_inverse=True)
        middles = points[unique].sum(axis=1)
        middle = place.reshape(-1, 3) + len(points)
        points = np.concatenate([points, middles / np.linalg.norm(middles, axis=1, keepdims=True)])
        a, b, c = triangles.T
        ab, bc, ca = middle.T
        corners: list[Any] = [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
        triangles = np.concatenate([np.stack(three, axis=1) for three in corners])
    _SPHERES[fineness] = points, triangles.astype(np.uint32)
    return _SPHERES[fineness]


def _square(edge: float) -> tuple[np.ndarray, np.ndarray]:
    half = edge / 2
    corners = [[-half, -half, 0], [half, -half, 0], [half, half, 0], [-half, half, 0]]
    return np.array(corners, dtype=np.float64), np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32)
