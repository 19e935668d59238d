"""Display geometry of bodies: triangles of meshes and convex parts, and vertices, in the body's frame and metres."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from .._names import BodyInfo
    from .._scene.scene import Scene

#: Ways to draw a body.
LOOKS = ("mesh", "pieces", "points")
#: Size of the drawn part of a half-space, in metres.
HALF_SPACE_EDGE = 4.0
_FINENESS = 4  # a convex part is drawn by its farthest points in 1026 directions


@dataclass(frozen=True)
class Mesh:
    """A triangle mesh."""

    vertices: np.ndarray  #: (V, 3) float64
    triangles: np.ndarray  #: (T, 3) uint32


@dataclass(frozen=True)
class Shape:
    """A body in its own frame."""

    mesh: Sequence[Mesh]  #: the given mesh; empty for a body given as convex parts
    hulls: Sequence[tuple[np.ndarray, float]]  #: vertices and radius of each convex part; empty if the mesh is exact
    points: np.ndarray  #: (V, 3) vertices of the geometry of the bounds

    def look(self, look: str) -> Sequence[Mesh]:
        """Returns the meshes of a look, none for "points". Recomputes convex parts, in some milliseconds each."""
        if look == "points":
            return ()
        if not self.hulls or (look == "mesh" and self.mesh):
            return self.mesh
        return [hull_mesh(vertices, radius) for vertices, radius in self.hulls]


EMPTY = Shape((), (), np.zeros((0, 3)))


def shape_of(scene: Scene, body: BodyInfo) -> Shape:
    """Returns the shape of a scene's body, or EMPTY for a frame."""
    if not body.piece_count:
        return EMPTY
    if math.isinf(body.extent):
        square = Mesh(*_square(HALF_SPACE_EDGE))
        return Shape((square,), (), square.vertices)
    given = scene._scene.display(body.id)  # avoids Scene's methods, which build a table of all names in each call
    mesh = None if given is None else Mesh(*given)
    pieces = scene._scene.pieces(body.id)
    points = np.concatenate([vertices for vertices, _ in pieces])
    # A point with a radius is a round shape, for which the display mesh is finer than hull_mesh(); triangles are exact.
    if mesh and (body.triangle_count or all(len(vertices) == 1 for vertices, _ in pieces)):
        return Shape((mesh,), (), mesh.vertices)
    return Shape((mesh,) if mesh else (), pieces, points)


def unknown_shape(body: BodyInfo) -> Shape:
    """Returns the bounding ball of a body whose shape this process does not have."""
    if not body.piece_count or not math.isfinite(body.extent):
        return EMPTY
    directions, triangles = sphere_of_directions(2)
    ball = Mesh(directions * body.extent, triangles)
    return Shape((ball,), (), np.zeros((1, 3)))


def hull_mesh(vertices: np.ndarray, radius: float = 0.0) -> Mesh:
    """Returns the hull of (V, 3) vertices grown by a radius: triangles between its farthest points in many directions.

    The result lies within the hull, and includes every vertex that is farthest in one of these directions. It is exact
    for a box.
    """
    directions, triangles = sphere_of_directions(_FINENESS)
    farthest = np.empty(len(directions), dtype=np.int64)
    for first in range(0, len(directions), 256):  # blocks, to limit memory to a few MB for any number of vertices
        farthest[first : first + 256] = np.argmax(directions[first : first + 256] @ vertices.T, axis=1)
    if radius > 0:
        return Mesh(vertices[farthest] + radius * directions, triangles)
    used, place = np.unique(farthest, return_inverse=True)
    corners = place.reshape(-1)[triangles]
    a, b, c = corners.T
    kept = (a != b) & (b != c) & (c != a)
    # Rotates each triangle to start with its least corner, to find duplicates of a face from several directions.
    corners = corners[kept]
    order = (np.argmin(corners, axis=1)[:, None] + np.arange(3)) % 3
    unique = np.unique(np.take_along_axis(corners, order, axis=1), axis=0)
    return Mesh(vertices[used], unique.astype(np.uint32))


_SPHERES: dict[int, tuple[np.ndarray, np.ndarray]] = {}


def sphere_of_directions(fineness: int) -> tuple[np.ndarray, np.ndarray]:
    """Returns (N, 3) unit vectors and (T, 3) triangles between them: an octahedron, subdivided `fineness` times."""
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
