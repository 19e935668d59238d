"""Changes of the scene of an engine or a daemon: bodies added, removed and replaced."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, Optional

import numpy as np

from .._arguments import ShapeArgument, to_bool, to_number, to_shape, to_text, to_uncertainties
from .._names import BodyRef, NameTable
from .._poses import as_first_pose
from .._words import NONE, MeshAsWord


@dataclass(frozen=True)
class SceneChanged:
    """The scene after a change."""

    scene_revision: int
    body_count: int
    body: Optional[int]  #: the id of the body that was added or replaced
    seconds: float  #: time to build the scene


class NewBody(NamedTuple):
    """The arguments of add_body() of the extension modules."""

    name: str
    shape: str
    numbers: np.ndarray
    radius: float
    parent: int
    static: bool
    pose: Optional[np.ndarray]
    uncertainties: tuple[float, float, float, float]
    triangles: np.ndarray
    mesh_as: int
    cloud: np.ndarray


class SceneChanges:
    """Methods of Engine and Client that change the scene."""

    _names_cache: Optional[NameTable]

    @property
    def _names(self) -> NameTable:
        raise NotImplementedError

    def _send_body(self, body: NewBody, revision: int) -> tuple[int, int, int, float]:
        """Adds a body. revision: the scene revision of its parent's id."""
        raise NotImplementedError

    def _send_shape(self, name: str, shape: ShapeArgument, radius: float) -> tuple[int, int, int, float]:
        raise NotImplementedError

    def _send_removal(self, name: str) -> tuple[int, int, int, float]:
        raise NotImplementedError

    def add_body(
        self,
        name: str,
        vertices: Any = None,
        *,
        mesh: Any = None,
        box: Any = None,
        sphere: Optional[float] = None,
        capsule: Any = None,
        cylinder: Any = None,
        cone: Any = None,
        ellipsoid: Any = None,
        half_space: bool = False,
        points: Any = None,
        voxel: float = 0.0,
        radius: float = 0.0,
        parent: Optional[BodyRef] = None,
        static: bool = False,
        pose: Any = None,
        uncertainty: Optional[Mapping[str, float]] = None,
        padding: float = 0.0,
        max_speed: float = 0.0,
        mesh_as: MeshAsWord = "auto",
    ) -> SceneChanged:
        """Adds a body at run time (for example a grasped object), and waits until the scene contains it.

        vertices: (V, 3) metres in the body's frame; the shape is their hull. Or one of mesh: a pair of such
            vertices and (T, 3) indices of them, box: (x, y, z) edge lengths, sphere: radius, capsule,
            cylinder and cone: (radius, length), ellipsoid: (x, y, z) half axes, half_space: True, points: (N, 3) of a
            cloud, which set_points() replaces, as in clearance.Scene.
        voxel: metres, for a cloud; above 0, boxes of this edge around the points are the body.
        mesh_as: body made from a mesh: "hull", "surface" (its triangles), "solid" (the volume that they enclose, for
            a closed mesh), or "auto": the hull of a convex or an open mesh, otherwise a solid.
        radius: metres, grows the shape.
        parent: name or id of the body that it follows.
        pose: X_world_body, or X_parent_body with a parent. Default: the identity with a parent or static, otherwise
            none until one arrives. Warns (PoseWarning) of a quaternion that looks like x, y, z, w.
        uncertainty: {"position": metres, "angle": radians}, bounds on the error of its pose; padding: metres of
            growth; max_speed: metres per second, a bound on the speed of its points. As in a scene file; the bounds of
            answers include all of these.

        The body gets the next id; the others keep their ids and poses. Running queries finish on the scene that they
        started with. Raises QueryError for a name in use, an invalid shape or, in a daemon, too many bodies; ValueError
        and TypeError for a wrong argument.
        """
        shape = to_shape(
            mesh_as, voxel, vertices=vertices, mesh=mesh, box=box, sphere=sphere, capsule=capsule, cylinder=cylinder,
            cone=cone, ellipsoid=ellipsoid, half_space=half_space, points=points,
        )  # fmt: skip
        names = None if parent is None else self._names
        body = NewBody(
            to_text(name, "name"),
            shape.kind,
            shape.numbers,
            to_number(radius, "radius"),
            names.body(parent, "parent") if names and parent is not None else NONE,
            to_bool(static, "static"),
            None if pose is None else as_first_pose(pose, "pose").reshape(1, 7),
            to_uncertainties(uncertainty, padding, max_speed),
            shape.triangles,
            shape.mesh_as,
            shape.cloud,
        )
        return self._changed(*self._send_body(body, names.revision if names else 0))

    def remove_body(self, name: str) -> SceneChanged:
        """Removes a body that add_body() added. The ids of bodies added after it change.

        Raises QueryError for any other body, and for the parent of another body.
        """
        return self._changed(*self._send_removal(to_text(name, "name")))

    def replace(
        self,
        name: str,
        vertices: Any = None,
        *,
        mesh: Any = None,
        box: Any = None,
        sphere: Optional[float] = None,
        capsule: Any = None,
        cylinder: Any = None,
        cone: Any = None,
        ellipsoid: Any = None,
        half_space: bool = False,
        points: Any = None,
        voxel: float = 0.0,
        radius: float = 0.0,
        mesh_as: MeshAsWord = "auto",
    ) -> SceneChanged:
        """Replaces the shape of any body. The arguments are those of add_body().

        The body keeps its id, pose, attachments, allowed pairs, padding and uncertainty; points received by
        set_points() are dropped. Running queries finish on the scene that they started with. Raises QueryError for an
        unknown body, an invalid shape, a robot's link or frame, and for the half-space of a body that is not static;
        ValueError and TypeError for a wrong argument; and from a client RequestError (FORBIDDEN) for a body of the
        scene file without the right "admin".
        """
        shape = to_shape(
            mesh_as, voxel, vertices=vertices, mesh=mesh, box=box, sphere=sphere, capsule=capsule, cylinder=cylinder,
            cone=cone, ellipsoid=ellipsoid, half_space=half_space, points=points,
        )  # fmt: skip
        return self._changed(*self._send_shape(to_text(name, "name"), shape, to_number(radius, "radius")))

    def _changed(self, revision: int, body_count: int, body: int, seconds: float) -> SceneChanged:
        self._names_cache = None
        return SceneChanged(revision, body_count, None if body == NONE else body, seconds)
