"""A scene: bodies, groups, and which pairs are asked about."""

from __future__ import annotations

import os
import threading
import warnings
from collections.abc import Mapping, Sequence
from typing import Any, Optional, Union

import numpy as np

import clearance._engine as _engine

from ._arguments import (
    to_bool,
    to_cloud,
    to_doubts,
    to_floats,
    to_half_space,
    to_items,
    to_list,
    to_number,
    to_numbers,
    to_path,
    to_shape,
    to_text,
    to_uncertainty,
    to_word,
)
from ._errors import HullWarning, RobotWarning, SceneError
from ._names import BodyInfo, NameTable
from ._poses import as_one_pose
from ._words import CONVEXIFY, GEOMETRIES, NONE, ConvexifyWord, GeometryWord

BodyRef = Union[str, int]
_BY_LINK = "a dict of {'position': metres, 'angle': radians} by link"


class Scene:
    """Bodies by id (their order of arrival), groups, and pairs that are left out.

    Build it with the add_* calls or with Scene.load(); an Engine takes a copy. Metres; vertices in the body's frame.
    Every add_* call returns the new body's id and takes, by keyword,

    parent: a body that this one follows (its poses are then X_parent_body); static: it never moves; pose: where it is
        at
    first, 7 numbers or a (4, 4) matrix. A body without a pose is answered NO_POSE until it gets one.

    Each raises SceneError for a bad or repeated name or bad geometry, TypeError or ValueError for a wrong argument.
    """

    def __init__(self) -> None:
        self._scene = _engine.Scene()
        self._lock = threading.RLock()

    @classmethod
    def load(cls, path: str | os.PathLike[str], allow_outside: bool = False) -> Scene:
        """Reads a scene file (YAML) and the meshes that it names.

        allow_outside: meshes may lie outside the scene file's folder.
        Raises SceneError naming file, line, key and what was expected. Warns (HullWarning) of bodies whose pieces stand
        far out of their meshes.
        """
        scene = cls.__new__(cls)
        scene._lock = threading.RLock()
        scene._scene = _engine.Scene.load(to_path(path, "path"), to_bool(allow_outside, "allow_outside"))
        _warn_of_hulls(scene._scene, 0)
        _warn_of_robots(scene._scene, 0)
        return scene

    @classmethod
    def load_urdf(cls, urdf: str | os.PathLike[str], name: Optional[str] = None, **options: Any) -> Scene:
        """A scene of one robot, at the origin.

        name: of the robot in the scene; None: the file's name without its ending ("panda" of "panda.urdf").
        options: those of add_robot(), by name.
        """
        scene = cls()
        path = to_path(urdf, "urdf")
        scene.add_robot(os.path.splitext(os.path.basename(path))[0] if name is None else name, path, **options)
        return scene

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
        """Adds the convex hull of (V, 3) vertices, grown by `radius`. Flat, collinear and single points are legal."""
        rows = to_floats(vertices, "vertices", "(V, 3) numbers")
        if rows.ndim != 2 or rows.shape[1] != 3:
            raise ValueError(f"vertices: expected shape (V, 3), got {rows.shape}")
        with self._lock:
            return self._scene.add_hull(
                to_text(name, "name"),
                rows,
                to_number(radius, "radius"),
                *self._rest(parent, static, pose, uncertainty, padding, max_speed),
            )

    def add_points(
        self,
        name: str,
        points: Any = (),
        voxel: float = 0.0,
        radius: float = 0.0,
        *,
        live: bool = False,
        parent: Optional[BodyRef] = None,
        static: bool = False,
        pose: Any = None,
        uncertainty: Optional[Mapping[str, float]] = None,
        padding: float = 0.0,
        max_speed: float = 0.0,
    ) -> int:
        """Adds a cloud: (N, 3) points, grown by `radius`, which set_points() of an engine or a client replaces.

        points: float32 is taken as it is, exactly; other numbers are rounded to float32 first. None: nothing is there.
        voxel: metres; above 0 the body is the boxes of this edge about the points, along its axes. The edge counts as
            the float32 above it.
        live: it has no pose and, without points, nothing is known of it (NO_POSE) until both are received.
        """
        with self._lock:
            return self._scene.add_points(
                to_text(name, "name"),
                to_cloud(points, "points"),
                to_number(voxel, "voxel"),
                to_bool(live, "live"),
                to_number(radius, "radius"),
                *self._rest(parent, static, pose, uncertainty, padding, max_speed),
            )

    def add_mesh(
        self,
        name: str,
        path: str | os.PathLike[str],
        scale: Any = 1.0,
        convexify: ConvexifyWord = "auto",
        *,
        radius: float = 0.0,
        parent: Optional[BodyRef] = None,
        static: bool = False,
        pose: Any = None,
        uncertainty: Optional[Mapping[str, float]] = None,
        padding: float = 0.0,
        max_speed: float = 0.0,
    ) -> int:
        """Adds a mesh file. scale: one number or three.

        convexify: what the body is: "hull" or "submeshes" (the convex hull of all vertices, or of each submesh's),
            "surface" (its triangles) or "solid" (what they enclose: they are closed, and turn alike); "decompose" is
            not there yet. "auto": the hull of a convex mesh, and of an open one, and a solid else.

        Warns (HullWarning) if the pieces stand far out of the mesh: BodyInfo.hull_excess says how far at most.
        """
        sx, sy, sz = _three(scale, "scale", one=True)
        with self._lock:
            added = self._scene.add_mesh(
                to_text(name, "name"),
                to_path(path, "path"),
                sx,
                sy,
                sz,
                to_word(convexify, CONVEXIFY, "convexify"),
                to_number(radius, "radius"),
                *self._rest(parent, static, pose, uncertainty, padding, max_speed),
            )
            _warn_of_hulls(self._scene, added)
            return added

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
        x, y, z = _three(size, "size")
        with self._lock:
            return self._scene.add_box(
                to_text(name, "name"),
                x,
                y,
                z,
                to_number(radius, "radius"),
                *self._rest(parent, static, pose, uncertainty, padding, max_speed),
            )

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
        """Adds a sphere about the body's origin."""
        with self._lock:
            return self._scene.add_sphere(
                to_text(name, "name"),
                to_number(radius, "radius"),
                *self._rest(parent, static, pose, uncertainty, padding, max_speed),
            )

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
        """Adds a capsule along z; `length` is between the centres of its caps."""
        with self._lock:
            return self._scene.add_capsule(
                to_text(name, "name"),
                to_number(radius, "radius"),
                to_number(length, "length"),
                *self._rest(parent, static, pose, uncertainty, padding, max_speed),
            )

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
        """Adds a cylinder along z, exactly, from -length / 2 to length / 2."""
        with self._lock:
            return self._scene.add_cylinder(
                to_text(name, "name"),
                to_number(radius, "radius"),
                to_number(length, "length"),
                0.0,
                *self._rest(parent, static, pose, uncertainty, padding, max_speed),
            )

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
        """Adds a cone along z, exactly: a disc of `radius` at -length / 2, the apex at length / 2."""
        with self._lock:
            return self._scene.add_cone(
                to_text(name, "name"),
                to_number(radius, "radius"),
                to_number(length, "length"),
                0.0,
                *self._rest(parent, static, pose, uncertainty, padding, max_speed),
            )

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
        """Adds an ellipsoid of three half axes about the body's origin, exactly; `radius` grows it."""
        x, y, z = _three(radii, "radii")
        with self._lock:
            return self._scene.add_ellipsoid(
                to_text(name, "name"),
                x,
                y,
                z,
                to_number(radius, "radius"),
                *self._rest(parent, static, pose, uncertainty, padding, max_speed),
            )

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
        """Adds the half-space z <= 0 of its own frame: a floor, or a wall. It is exact, static whatever `static` says,
        and follows no parent; `radius` moves its plane outward. SceneError for a parent or an uncertainty of angle."""
        with self._lock:
            return self._scene.add_half_space(
                to_text(name, "name"),
                to_number(radius, "radius"),
                *self._rest(parent, static, pose, uncertainty, padding, max_speed),
            )

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
        convexify: ConvexifyWord = "auto",
    ) -> int:
        """Adds a body with the arguments of Client.add_body(): exactly one of the shapes; `radius` grows it."""
        shapes = {"vertices": vertices, "mesh": mesh, "box": box}
        shapes |= {"sphere": sphere, "capsule": capsule, "cylinder": cylinder}
        shapes |= {"cone": cone, "ellipsoid": ellipsoid, "half_space": to_half_space(half_space), "points": points}
        shape, numbers, triangles, how, cloud = to_shape(shapes, convexify, voxel)
        rest: dict[str, Any] = {"parent": parent, "static": static, "pose": pose, "uncertainty": uncertainty}
        rest.update(padding=padding, max_speed=max_speed)
        if shape == "vertices":
            return self.add_hull(name, numbers, radius, **rest)
        if shape == "points":
            return self.add_points(name, cloud, numbers[0, 0], radius, **rest)
        if shape == "mesh":
            return self._add_mesh_of(name, numbers, triangles, how, to_number(radius, "radius"), self._rest(**rest))
        if shape == "box":
            return self.add_box(name, numbers[0], radius=radius, **rest)
        if shape == "half_space":
            return self.add_half_space(name, radius=radius, **rest)
        if shape == "ellipsoid":
            return self.add_ellipsoid(name, numbers[0], radius=radius, **rest)
        grown = to_number(radius, "radius")
        r, length, _ = numbers[0].tolist()
        if shape == "sphere":
            return self.add_sphere(name, r + grown, **rest)
        if shape == "capsule":
            return self.add_capsule(name, r + grown, length, **rest)
        with self._lock:
            add = self._scene.add_cone if shape == "cone" else self._scene.add_cylinder
            return add(to_text(name, "name"), r, length, grown, *self._rest(**rest))

    def _add_mesh_of(
        self,
        name: str,
        vertices: np.ndarray,
        triangles: np.ndarray,
        convexify: int,
        radius: float,
        rest: tuple[Any, ...],
    ) -> int:
        with self._lock:
            added = self._scene.add_mesh_of(to_text(name, "name"), vertices, triangles, convexify, radius, *rest)
            _warn_of_hulls(self._scene, added)
            return added

    def add_robot(
        self,
        name: str,
        urdf: str | os.PathLike[str],
        *,
        srdf: Union[str, os.PathLike[str], None] = None,
        packages: Optional[Mapping[str, str | os.PathLike[str]]] = None,
        base: Any = None,
        parent: Optional[BodyRef] = None,
        static: bool = False,
        geometry: GeometryWord = "collision",
        home: Union[Mapping[str, float], str, None] = None,
        padding: Union[float, Mapping[str, float]] = 0.0,
        uncertainty: Optional[Mapping[str, Mapping[str, float]]] = None,
        convexify: Union[ConvexifyWord, Mapping[str, ConvexifyWord]] = "auto",
    ) -> None:
        """Adds a robot: a frame `name` that places it, and a body "name/LINK" for each of its links.

        srdf: its groups become groups "name/GROUP", the pairs that it disables are left out. Without one, links that a
            joint joins are. Pairs with no moving joint between them always are.
        packages: {package: folder} for meshes named package://NAME/...; other meshes lie beside the URDF.
        base: pose of the base, 7 numbers or (4, 4): in the world or, with a parent, in it; None: the identity.
        static: the base never moves.
        geometry: "collision" or "visual" shapes.
        home: {joint: position} at load, radians and metres, or the name of a group state of the SRDF; joints that it
            does not name are at 0. None: links have no pose until their joints have positions.
        padding: metres that grow the links, one number or {link: metres}.
        uncertainty: {link: {"position": metres, "angle": radians}} that a link may be off by, itself alone: not those
            that hang on it.
        convexify: what the links' meshes are, as in add_mesh(): one word or {link: word}, "auto" for the others.

        Raises SceneError naming file, line and element. Warns (RobotWarning) of what was left out of the SRDF, and
        (HullWarning) of links that stand far out of their meshes.
        """
        folders = {} if packages is None else dict(to_items(packages, "packages", "a dict of folders by package"))
        by_link = isinstance(padding, Mapping)
        named = isinstance(convexify, Mapping)
        by_joint = home is not None and not isinstance(home, str)
        with self._lock:
            bodies = len(self._scene.bodies())
            index = self._scene.add_robot(
                to_text(name, "name"),
                to_path(urdf, "urdf"),
                "" if srdf is None else to_path(srdf, "srdf"),
                {to_text(key, "packages"): to_path(folder, f"packages[{key!r}]") for key, folder in folders.items()},
                None if base is None else as_one_pose(base, "base"),
                "" if parent is None else self._body(parent, "parent").name,
                to_bool(static, "static"),
                bool(to_word(geometry, GEOMETRIES, "geometry")),
                _numbers_by_name(home, "home", "positions by joint, or the name of a group state")
                if by_joint
                else None,
                home if isinstance(home, str) else "",
                0.0 if by_link else to_number(padding, "padding"),
                _numbers_by_name(padding, "padding", "metres by link") if by_link else {},
                {
                    to_text(link, "uncertainty"): to_uncertainty(doubt, f"uncertainty[{link!r}]")
                    for link, doubt in to_items({} if uncertainty is None else uncertainty, "uncertainty", _BY_LINK)
                },
                CONVEXIFY["auto"] if named else to_word(convexify, CONVEXIFY, "convexify"),
                _convexify_by_link(convexify) if isinstance(convexify, Mapping) else {},
            )
            _warn_of_hulls(self._scene, bodies)
            _warn_of_robots(self._scene, index)

    def add_group(self, name: str, bodies: Sequence[str]) -> None:
        """Names a set of bodies."""
        members = to_list(bodies, "bodies", "a list of names")
        with self._lock:
            names = [self._body(body, f"bodies[{i}]").name for i, body in enumerate(members)]
            self._scene.add_group(to_text(name, "name"), names)

    def ignore(self, a: BodyRef, b: BodyRef) -> None:
        """Leaves out every pair between two bodies or groups (a group with itself: its inner pairs)."""
        with self._lock:
            names = [
                value if isinstance(value, str) else self._body(value, what).name
                for value, what in ((a, "a"), (b, "b"))
            ]
            try:
                self._scene.ignore(*names)
            except SceneError:
                for value, what in ((a, "a"), (b, "b")):
                    self._table().selector(value, what)  # says which of them is not there, and what comes near
                raise

    @property
    def bodies(self) -> tuple[BodyInfo, ...]:
        """The bodies; a body's id is its place here."""
        return self._table().bodies

    @property
    def groups(self) -> dict[str, np.ndarray]:
        """(n,) uint32 body ids of each group."""
        return self._table().groups

    @property
    def ignored(self) -> np.ndarray:
        """(I, 2) uint32: pairs left out, a < b, sorted."""
        return np.array(self._scene.ignored(), dtype=np.uint32).reshape(-1, 2)

    @property
    def revision(self) -> int:
        """A digest of geometry, names, groups and initial poses: the same scene gives the same number anywhere."""
        return self._scene.revision()

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Writes scene.yaml and all that it needs into a folder that is empty or not there yet.

        Scene.load(folder + "/scene.yaml") then has the same bodies, ids and pairs, and answers have the same bits.
        Robots are kept as their URDF and SRDF, shapes as the engine has them. Raises SceneError where that cannot be.
        """
        with self._lock:
            self._scene.save(to_path(folder, "folder"))

    def initial_pose(self, body: BodyRef) -> Optional[np.ndarray]:
        """(7,) pose of a body at load, or None."""
        pose = self._scene.initial_pose(self._body(body, "body").id)
        return None if pose is None else np.array(pose)

    def source(self, body: BodyRef) -> str:
        """Where a body's geometry came from: "meshes/base.stl (hull)", "box", ..."""
        return self._scene.source(self._body(body, "body").id)

    def pieces(self, body: BodyRef) -> list[tuple[np.ndarray, float]]:
        """Each convex piece of a body: (V, 3) vertices in the body's frame, and the radius that grows their hull."""
        return self._scene.pieces(self._body(body, "body").id)

    def display_mesh(self, body: BodyRef) -> Optional[tuple[np.ndarray, np.ndarray]]:
        """Triangles for a picture: (V, 3) float64 vertices and (T, 3) uint32 indices; None if there are none."""
        return self._scene.display(self._body(body, "body").id)

    def __len__(self) -> int:
        return len(self._scene.bodies())

    def __repr__(self) -> str:
        return f"<clearance.Scene: {len(self)} bodies, {len(self._scene.groups())} groups>"

    def _table(self) -> NameTable:
        return name_table(self._scene, 0)

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
        doubts = to_doubts(uncertainty, padding, max_speed)
        return name, to_bool(static, "static"), None if pose is None else as_one_pose(pose, "pose"), doubts

    def _body(self, body: BodyRef, what: str) -> BodyInfo:
        table = self._table()
        index = table.body(body, what)
        if index >= len(table.bodies):
            raise ValueError(f"{what}: no body has the id {index}; the scene has {len(table.bodies)}")
        return table.bodies[index]


def name_table(scene: Any, revision: int) -> NameTable:
    """Names and ids of an _engine.Scene."""
    bodies = [
        BodyInfo(name, i, None if parent == NONE else parent, *rest)
        for i, (name, parent, *rest) in enumerate(scene.bodies())
    ]
    groups = {name: np.array(members, dtype=np.uint32) for name, members in scene.groups()}
    return NameTable(revision, bodies, groups)


def _numbers_by_name(value: Any, what: str, expected: str) -> dict[str, float]:
    items = to_items(value, what, f"a dict of {expected}")
    return {to_text(key, what): to_number(number, f"{what}[{key!r}]") for key, number in items}


def _convexify_by_link(value: Mapping[str, str]) -> dict[str, int]:
    return {to_text(link, "convexify"): to_word(how, CONVEXIFY, f"convexify[{link!r}]") for link, how in value.items()}


def _warn_of_robots(scene: Any, first: int) -> None:
    for text in scene.robot_warnings(first):
        warnings.warn(text, RobotWarning, stacklevel=3)


_NAMED_IN_WARNING = 5


def _warn_of_hulls(scene: Any, first: int) -> None:
    """One warning for all bodies from `first` on that are far from the meshes they stand for."""
    found = scene.hull_warnings(first)
    if not found:
        return
    text = "; ".join(f"{name}: {what}" for name, what in found[:_NAMED_IN_WARNING])
    if len(found) > _NAMED_IN_WARNING:
        text += f"; and {len(found) - _NAMED_IN_WARNING} more"
    warnings.warn(text, HullWarning, stacklevel=3)


def _three(value: Any, what: str, one: bool = False) -> tuple[float, float, float]:
    if one and not getattr(value, "ndim", hasattr(value, "__len__")):
        number = to_number(value, what)
        return number, number, number
    x, y, z = to_numbers(value, what, 3, "one number or three" if one else "three numbers")
    return x, y, z
