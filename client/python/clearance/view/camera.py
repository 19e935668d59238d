"""Where the camera stands at first: near the nearest pair, with no body before it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .._adapters.urdf import matrix
from .model import Picture
from .shapes import Shape

_FROM = np.array([1.25, -1.55, 0.9])  # the preferred offset from the target, relative to the size of the view
_ELEVATIONS = (0.42, 0.8, 1.2, 0.1)  # radians
_AZIMUTHS = 16
_MOST_BODIES = 500  # of a scene in which what hides the target is searched
_MOST_TRIANGLES = 20000  # of a body that may hide it


def camera_at_first(picture: Picture, shapes: Sequence[Shape]) -> tuple[np.ndarray, np.ndarray]:
    """Returns the target and the camera's position, metres, world.

    Faces the nearest pair from the direction nearest to the preferred one from which most of its witness points and
    the middle between them are visible; without witness points, at the middle of the scene.
    """
    middle, size = _whole(picture, shapes)
    rows = np.flatnonzero(picture.drawn)
    if not len(rows):
        return middle, middle + size * _FROM
    first, second = picture.segments[rows[0]]
    target = (first + second) / 2
    size = min(size, max(0.3, 2.0 * float(np.linalg.norm(second - first))))
    offsets = _offsets() * size
    triangles = _triangles(picture, shapes)
    best, fewest = offsets[0], 4
    for offset in offsets:
        hidden = sum(_is_hidden(target + offset, point, triangles) for point in (target, first, second))
        if hidden < fewest:
            best, fewest = offset, hidden
        if not hidden:
            break
    return target, target + best


def _whole(picture: Picture, shapes: Sequence[Shape]) -> tuple[np.ndarray, float]:
    """Returns the middle and the size of most of the scene, metres."""
    seen = [i for i, shape in enumerate(shapes) if len(shape.points) and picture.placed[i]]
    if not seen:
        return np.zeros(3), 1.0
    origins = picture.poses[seen, :3]
    corners = [shapes[i].mesh[0].vertices if shapes[i].mesh else shapes[i].points for i in seen]
    reach = [float(np.linalg.norm(each, axis=1).max()) for each in corners]
    middle = np.median(origins, axis=0)
    far = np.linalg.norm(origins - middle, axis=1) + np.minimum(reach, 1.0)
    return middle, max(0.3, float(np.percentile(far, 80)))


def _offsets() -> np.ndarray:
    """(N, 3) offsets of the camera, the preferred one first, then by the angle to it."""
    turns = 2 * np.pi * np.arange(_AZIMUTHS) / _AZIMUTHS
    around = [
        (np.cos(up) * np.cos(turn), np.cos(up) * np.sin(turn), np.sin(up)) for up in _ELEVATIONS for turn in turns
    ]
    offsets = np.concatenate([_FROM[None], np.linalg.norm(_FROM) * np.array(around)])
    return offsets[np.argsort(-offsets @ _FROM, kind="stable")]


def _triangles(picture: Picture, shapes: Sequence[Shape]) -> np.ndarray:
    """(T, 3, 3) corners of the triangles of bodies with a pose, world."""
    found = [np.zeros((0, 3, 3))]
    for shape, pose, placed in zip(shapes, picture.poses, picture.placed):
        for mesh in shape.look("mesh") if placed and len(shapes) <= _MOST_BODIES else ():
            if len(mesh.triangles) <= _MOST_TRIANGLES:
                X = matrix(pose[:3], pose[3:])
                found.append((mesh.vertices @ X[:3, :3].T + X[:3, 3])[mesh.triangles])
    return np.concatenate(found)


def _is_hidden(camera: np.ndarray, point: np.ndarray, triangles: np.ndarray) -> bool:
    """Whether a triangle lies between the camera and the point, clearly before the point, which is on a surface."""
    origin, edge1, edge2 = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    ray = point - camera
    p = np.cross(ray, edge2)
    size = np.einsum("ij,ij->i", edge1, p)
    with np.errstate(divide="ignore", invalid="ignore"):
        to = camera - origin
        u = np.einsum("ij,ij->i", to, p) / size
        q = np.cross(to, edge1)
        v = q @ ray / size
        t = np.einsum("ij,ij->i", edge2, q) / size
        return bool(((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (t < 0.99)).any())
