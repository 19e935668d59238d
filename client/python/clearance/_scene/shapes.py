"""Bodies of a scene whose shapes are numbers: hulls, clouds and simple shapes."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from typing import Any, Callable, Optional

import numpy as np

from .._arguments import to_bool, to_cloud, to_floats, to_number, to_numbers, to_text, to_uncertainties
from .._names import BodyInfo, BodyRef
from .._poses import as_first_pose


class ShapeScene:
    """The methods of Scene for hulls, clouds and simple shapes."""

    _scene: Any
    _lock: threading.RLock

    def _body(self, body: BodyRef, what: str) -> BodyInfo:
        raise NotImplementedError

    def add_hull(
        self,
        name: str,
        vertices: Any,
        radius: float = 0.0,
        *,
        parent: Optional[BodyRef] = None,
        static: bool = False,
        pose: Any = None,
        uncertainty: Optional[Mapping[str, float]] = None,
        padding: float = 0.0,
        max_speed: float = 0.0,
    ) -> int:
        """Adds the convex hull of (V, 3) vertices, grown by `radius`. Accepts flat, collinear and single points."""
        rows = to_floats(vertices, "vertices", "(V, 3) numbers")
        if rows.ndim != 2 or rows.shape[1] != 3:
            raise ValueError(f"vertices: expected shape (V, 3), got {rows.shape}")
        rest = self._rest(parent, static, pose, uncertainty, padding, max_speed)
        return self._add(self._scene.add_hull, name, rest, rows, radius=radius)

    def add_points(
        self,
        name: str,
        points: Any = (),
        voxel: float = 0.0,
        radius: float = 0.0,
        *,
        requires_pose: bool = False,
        parent: Optional[BodyRef] = None,
        static: bool = False,
        pose: Any = None,
        uncertainty: Optional[Mapping[str, float]] = None,
        padding: float = 0.0,
        max_speed: float = 0.0,
    ) -> int:
        """Adds a cloud: (N, 3) points, grown by `radius`, which set_points() of an engine or a client replaces.

        points: float32 values are exact; other numbers are rounded to float32. No points make an empty body.
        voxel: metres; above 0, boxes of this edge around the points, parallel to the body's axes, are the body. The
            edge is rounded up to float32.
        requires_pose: whether the body starts without a pose. It has the status NO_POSE until its pose and, if it is
            empty, its points arrive.
        """
        rest = self._rest(parent, static, pose, uncertainty, padding, max_speed)
        cloud, edge = to_cloud(points, "points"), to_number(voxel, "voxel")
        return self._add(
            self._scene.add_points, name, rest, cloud, edge, to_bool(requires_pose, "requires_pose"), radius=radius
        )

    def add_box(
        self,
        name: str,
        size: Any,
        *,
        radius: float = 0.0,
        parent: Optional[BodyRef] = None,
        static: bool = False,
        pose: Any = None,
        uncertainty: Optional[Mapping[str, float]] = None,
        padding: float = 0.0,
        max_speed: float = 0.0,
    ) -> int:
        """Adds a box of three full edge lengths, centred on the body's origin; `radius` rounds it outward."""
        rest = self._rest(parent, static, pose, uncertainty, padding, max_speed)
        return self._add(self._scene.add_box, name, rest, *three_numbers(size, "size"), radius=radius)

    def add_sphere(
        self,
        name: str,
        radius: float,
        *,
        parent: Optional[BodyRef] = None,
        static: bool = False,
        pose: Any = None,
        uncertainty: Optional[Mapping[str, float]] = None,
        padding: float = 0.0,
        max_speed: float = 0.0,
    ) -> int:
        """Adds a sphere around the body's origin."""
        rest = self._rest(parent, static, pose, uncertainty, padding, max_speed)
        return self._add(self._scene.add_sphere, name, rest, radius=radius)

    def add_capsule(
        self,
        name: str,
        radius: float,
        length: float,
        *,
        parent: Optional[BodyRef] = None,
        static: bool = False,
        pose: Any = None,
        uncertainty: Optional[Mapping[str, float]] = None,
        padding: float = 0.0,
        max_speed: float = 0.0,
    ) -> int:
        """Adds a capsule along z; `length` is the distance between the centres of its caps."""
        rest = self._rest(parent, static, pose, uncertainty, padding, max_speed)
        return self._add(self._scene.add_capsule, name, rest, radius=radius, length=length)

    def add_cylinder(
        self,
        name: str,
        radius: float,
        length: float,
        *,
        parent: Optional[BodyRef] = None,
        static: bool = False,
        pose: Any = None,
        uncertainty: Optional[Mapping[str, float]] = None,
        padding: float = 0.0,
        max_speed: float = 0.0,
    ) -> int:
        """Adds an exact cylinder along z, from -length / 2 to length / 2."""
        rest = self._rest(parent, static, pose, uncertainty, padding, max_speed)
        return self._add(self._scene.add_cylinder, name, rest, radius=radius, length=length, grown=0.0)

    def add_cone(
        self,
        name: str,
        radius: float,
        length: float,
        *,
        parent: Optional[BodyRef] = None,
        static: bool = False,
        pose: Any = None,
        uncertainty: Optional[Mapping[str, float]] = None,
        padding: float = 0.0,
        max_speed: float = 0.0,
    ) -> int:
        """Adds an exact cone along z: a disc of `radius` at -length / 2, the apex at length / 2."""
        rest = self._rest(parent, static, pose, uncertainty, padding, max_speed)
        return self._add(self._scene.add_cone, name, rest, radius=radius, length=length, grown=0.0)

    def add_ellipsoid(
        self,
        name: str,
        radii: Any,
        *,
        radius: float = 0.0,
        parent: Optional[BodyRef] = None,
        static: bool = False,
        pose: Any = None,
        uncertainty: Optional[Mapping[str, float]] = None,
        padding: float = 0.0,
        max_speed: float = 0.0,
    ) -> int:
        """Adds an exact ellipsoid of three half axes around the body's origin; `radius` grows it."""
        rest = self._rest(parent, static, pose, uncertainty, padding, max_speed)
        return self._add(self._scene.add_ellipsoid, name, rest, *three_numbers(radii, "radii"), radius=radius)

    def add_half_space(
        self,
        name: str,
        *,
        radius: float = 0.0,
        parent: Optional[BodyRef] = None,
        static: bool = True,
        pose: Any = None,
        uncertainty: Optional[Mapping[str, float]] = None,
        padding: float = 0.0,
        max_speed: float = 0.0,
    ) -> int:
        """Adds the exact half-space z <= 0 of its own frame, such as a floor or a wall. It is static even with
        static=False; `radius` moves its plane outward. Raises SceneError for a parent or an uncertainty of angle."""
        rest = self._rest(parent, static, pose, uncertainty, padding, max_speed)
        return self._add(self._scene.add_half_space, name, rest, radius=radius)

    def _add(self, add: Callable[..., int], name: str, rest: tuple[Any, ...], *arguments: Any, **numbers: Any) -> int:
        """Calls `add` of the extension module. numbers: further arguments, checked under their names."""
        checked = [to_number(value, what) for what, value in numbers.items()]
        with self._lock:
            return add(to_text(name, "name"), *arguments, *checked, *rest)

    def _rest(
        self,
        parent: Optional[BodyRef],
        static: bool,
        pose: Any,
        uncertainty: Optional[Mapping[str, float]],
        padding: float,
        max_speed: float,
    ) -> tuple[Optional[str], bool, Optional[np.ndarray], tuple[float, ...]]:
        name = None if parent is None else self._body(parent, "parent").name
        uncertainties = to_uncertainties(uncertainty, padding, max_speed)
        return name, to_bool(static, "static"), None if pose is None else as_first_pose(pose, "pose"), uncertainties


def three_numbers(value: Any, what: str, one: bool = False) -> tuple[float, float, float]:
    if one and not getattr(value, "ndim", hasattr(value, "__len__")):
        number = to_number(value, what)
        return number, number, number
    x, y, z = to_numbers(value, what, 3, "one number or three" if one else "three numbers")
    return x, y, z
