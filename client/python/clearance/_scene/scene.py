"""A scene: bodies, groups, and the pairs between them."""

from __future__ import annotations

import os
import pathlib
import tempfile
import threading
from collections.abc import Mapping, Sequence
from typing import Any, Callable, Literal, Optional

import numpy as np

import clearance._engine as _engine

from .._arguments import (
    to_bool,
    to_list,
    to_number,
    to_path,
    to_shape,
    to_text,
    to_word,
)
from .._errors import SceneError
from .._names import BodyInfo, BodyRef, NameTable
from .._words import MESH_AS, NONE, MeshAsWord
from .robots import RobotScene
from .shapes import ShapeScene, three_numbers
from .warnings import warn_of_files, warn_of_meshes, warn_of_robots


class Scene(ShapeScene, RobotScene):
    """Bodies by id (in the order of their addition), groups, and ignored pairs.

    Build it with the add_* calls or with Scene.load(); an Engine takes a copy. Metres; vertices in the body's frame.
    Every add_* call returns the new body's id and takes these keyword arguments:

    parent: a body that this one follows (its poses are then X_parent_body); static: whether it never moves; pose: the
        initial pose, 7 numbers or a (4, 4) matrix. A body has the status NO_POSE until it gets a pose.

    Each raises SceneError for an invalid or repeated name or invalid geometry, TypeError or ValueError for a wrong
    argument, and warns (PoseWarning) of a pose whose quaternion looks like x, y, z, w.
    """

    def __init__(self) -> None:
        self._scene = _engine.Scene()
        self._lock = threading.RLock()

    @classmethod
    def load(cls, path: str | os.PathLike[str], allow_outside: bool = False) -> Scene:
        """Reads a scene file (YAML) and its meshes, or a URDF as a scene of that robot under the URDF's name.

        allow_outside: whether meshes may be outside the scene file's folder.
        Raises SceneError naming file, line, key and the expected value. Warns (MeshWarning) of bodies whose convex
        parts reach far outside their meshes, (PoseWarning) of quaternions that look like x, y, z, w, and (RobotWarning)
        of ignored parts of robots' files.
        """
        scene = cls.__new__(cls)
        scene._lock = threading.RLock()
        scene._scene = _engine.Scene.load(to_path(path, "path"), to_bool(allow_outside, "allow_outside"))
        warn_of_meshes(scene._scene, 0)
        warn_of_robots(scene._scene, 0)
        warn_of_files(scene._scene)
        return scene

    def add_mesh(
        self,
        name: str,
        path: str | os.PathLike[str],
        scale: Any = 1.0,
        mesh_as: MeshAsWord = "auto",
        *,
        up: Literal["y", "z"] = "z",
        radius: float = 0.0,
        parent: Optional[BodyRef] = None,
        static: bool = False,
        pose: Any = None,
        uncertainty: Optional[Mapping[str, float]] = None,
        padding: float = 0.0,
        max_speed: float = 0.0,
    ) -> int:
        """Adds a mesh file, with coordinates in metres.

        scale: one number or three, per axis of the file.
        up: axis of the file that becomes the body's z. "y" turns (x, y, z) to (x, -z, y), exactly.

        mesh_as: body made from the mesh: "hull" or "parts" (the convex hull of all vertices, or of each submesh),
            "surface" (its triangles) or "solid" (the volume that they enclose; the mesh must be closed and consistently
            oriented). "auto" is the hull of a convex or an open mesh, otherwise a solid.

        Warns (MeshWarning) if the convex parts stand far out of the mesh (BodyInfo.hull_excess is a bound), and if it
        is at least 50 m wide: files in millimetres need scale=0.001.
        """
        rest = self._rest(parent, static, pose, uncertainty, padding, max_speed)
        file, scales = to_path(path, "path"), three_numbers(scale, "scale", one=True)
        how, grown = to_word(mesh_as, MESH_AS, "mesh_as"), to_number(radius, "radius")
        y_up = to_word(up, {"z": False, "y": True}, "up")
        return self._add_mesh(self._scene.add_mesh, name, rest, file, *scales, how, y_up, grown)

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
    ) -> int:
        """Adds a body with the arguments of Client.add_body(): exactly one shape, grown by `radius`."""
        shape = to_shape(
            mesh_as, voxel, vertices=vertices, mesh=mesh, box=box, sphere=sphere, capsule=capsule, cylinder=cylinder,
            cone=cone, ellipsoid=ellipsoid, half_space=half_space, points=points,
        )  # fmt: skip
        grown = to_number(radius, "radius")
        rest = self._rest(parent, static, pose, uncertainty, padding, max_speed)
        if shape.kind == "mesh":
            return self._add_mesh(
                self._scene.add_mesh_of, name, rest, shape.numbers, shape.triangles, shape.mesh_as, grown
            )
        if shape.kind == "vertices":
            return self._add(self._scene.add_hull, name, rest, shape.numbers, grown)
        x, y, z = shape.numbers[0].tolist()
        arguments: dict[str, tuple[Any, ...]] = {
            "box": (x, y, z, grown),
            "sphere": (x + grown,),
            "capsule": (x + grown, y),
            "cylinder": (x, y, grown),
            "cone": (x, y, grown),
            "ellipsoid": (x, y, z, grown),
            "half_space": (grown,),
            "points": (shape.cloud, x, False, grown),
        }
        return self._add(getattr(self._scene, f"add_{shape.kind}"), name, rest, *arguments[shape.kind])

    def _add_mesh(self, add: Callable[..., int], name: str, rest: tuple[Any, ...], *arguments: Any) -> int:
        with self._lock:
            added = self._add(add, name, rest, *arguments)
            warn_of_meshes(self._scene, added)
            return added

    def add_group(self, name: str, bodies: Sequence[str]) -> None:
        """Names a set of bodies."""
        members = to_list(bodies, "bodies", "a list of names")
        with self._lock:
            names = [self._body(body, f"bodies[{i}]").name for i, body in enumerate(members)]
            self._scene.add_group(to_text(name, "name"), names)

    def ignore(self, a: BodyRef, b: BodyRef) -> None:
        """Excludes every pair between two bodies or groups; for a group and itself, the pairs within it."""
        with self._lock:
            names = [
                value if isinstance(value, str) else self._body(value, what).name
                for value, what in ((a, "a"), (b, "b"))
            ]
            try:
                self._scene.ignore(*names)
            except SceneError:
                for value, what in ((a, "a"), (b, "b")):
                    self._table().selector(value, what)  # raises for the unknown one, with similar names
                raise

    @property
    def bodies(self) -> tuple[BodyInfo, ...]:
        """The bodies; a body's id is its index."""
        return self._table().bodies

    @property
    def groups(self) -> dict[str, np.ndarray]:
        """(n,) uint32 body ids of each group."""
        return self._table().groups

    @property
    def ignored(self) -> np.ndarray:
        """(I, 2) uint32: ignored pairs, a < b, sorted."""
        return np.array(self._scene.ignored(), dtype=np.uint32).reshape(-1, 2)

    @property
    def revision(self) -> int:
        """A digest of geometry, names, groups and initial poses, equal for equal scenes on every machine."""
        return self._scene.revision()

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Writes scene.yaml and its files into a folder that is empty or does not exist.

        Scene.load(folder + "/scene.yaml") then has the same bodies, ids and pairs, and answers have the same bits.
        Robots are written as their URDF and SRDF, shapes in the engine's own form. Raises SceneError for a scene that
        cannot be written.
        """
        with self._lock:
            self._scene.save(to_path(folder, "folder"))

    def __reduce__(self) -> tuple[Any, tuple[dict[str, bytes]]]:
        """Pickles and copies the files of save(). Raises SceneError for a scene that cannot be written."""
        files: dict[str, bytes] = {}
        if len(self):
            with tempfile.TemporaryDirectory() as folder:
                root = pathlib.Path(folder) / "scene"
                self.save(root)
                files = {str(f.relative_to(root)): f.read_bytes() for f in root.rglob("*") if f.is_file()}
        return _restored, (files,)

    def initial_pose(self, body: BodyRef) -> Optional[np.ndarray]:
        """Returns the (7,) pose of a body at load, or None."""
        pose = self._scene.initial_pose(self._body(body, "body").id)
        return None if pose is None else np.array(pose)

    def source(self, body: BodyRef) -> str:
        """Returns the origin of a body's geometry: "meshes/base.stl (hull)", "box", ..."""
        return self._scene.source(self._body(body, "body").id)

    def pieces(self, body: BodyRef) -> list[tuple[np.ndarray, float]]:
        """Returns the convex parts of a body: (V, 3) vertices in the body's frame, and the radius that grows their
        hull."""
        return self._scene.pieces(self._body(body, "body").id)

    def display_mesh(self, body: BodyRef) -> Optional[tuple[np.ndarray, np.ndarray]]:
        """Returns triangles for display: (V, 3) float64 vertices and (T, 3) uint32 indices; None if there are none."""
        return self._scene.display(self._body(body, "body").id)

    def __len__(self) -> int:
        return len(self._scene.bodies())

    def __repr__(self) -> str:
        return f"<clearance.Scene: {len(self)} bodies, {len(self._scene.groups())} groups>"

    def _table(self) -> NameTable:
        return name_table(self._scene, 0)

    def _body(self, body: BodyRef, what: str) -> BodyInfo:
        table = self._table()
        index = table.body(body, what)
        if index >= len(table.bodies):
            raise ValueError(f"{what}: no body has the id {index}; the scene has {len(table.bodies)}")
        return table.bodies[index]


def _restored(files: dict[str, bytes]) -> Scene:
    """Restores a Scene from the files of __reduce__(), without repeating its warnings."""
    scene = Scene()
    if files:
        with tempfile.TemporaryDirectory() as folder:
            for name, content in files.items():
                file = pathlib.Path(folder) / name
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_bytes(content)
            scene._scene = _engine.Scene.load(os.path.join(folder, "scene.yaml"), False)
    return scene


def name_table(scene: Any, revision: int, parents: Optional[Sequence[int]] = None) -> NameTable:
    """Returns the names and ids of an _engine.Scene. parents: of each body, if not those at load."""
    bodies = []
    for i, (name, parent, *rest) in enumerate(scene.bodies()):
        now = parent if parents is None else parents[i]
        bodies.append(BodyInfo(name, i, None if now == NONE else now, *rest))
    groups = {name: np.array(members, dtype=np.uint32) for name, members in scene.groups()}
    return NameTable(revision, bodies, groups)
