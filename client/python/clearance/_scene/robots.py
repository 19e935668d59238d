"""Robots of a scene."""

from __future__ import annotations

import os
import threading
from collections.abc import Mapping
from typing import Any, Optional, TypeVar, Union

from .._arguments import to_bool, to_items, to_number, to_path, to_text, to_uncertainty, to_word
from .._names import BodyInfo, BodyRef
from .._poses import as_first_pose
from .._words import GEOMETRIES, MESH_AS, GeometryWord, MeshAsWord
from .warnings import warn_of_meshes, warn_of_robots

_BY_LINK = "a dict of {'position': metres, 'angle': radians} by link"
_SceneT = TypeVar("_SceneT", bound="RobotScene")


class RobotScene:
    """The methods of Scene for robots."""

    _scene: Any
    _lock: threading.RLock

    def _body(self, body: BodyRef, what: str) -> BodyInfo:
        raise NotImplementedError

    @classmethod
    def load_urdf(
        cls: type[_SceneT], urdf: str | os.PathLike[str], name: Optional[str] = None, **options: Any
    ) -> _SceneT:
        """Creates a scene of one robot, at the origin.

        name: name of the robot in the scene. Default: the file's name without its ending ("panda" of "panda.urdf").
        options: those of add_robot(), by name.
        """
        scene = cls()
        path = to_path(urdf, "urdf")
        scene.add_robot(os.path.splitext(os.path.basename(path))[0] if name is None else name, path, **options)
        return scene

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
        mesh_as: Union[MeshAsWord, Mapping[str, MeshAsWord]] = "auto",
    ) -> None:
        """Adds a robot: a frame `name` that places it, and a body "name/LINK" for each of its links.

        srdf: defines groups "name/GROUP" and disabled pairs. Without one, pairs of links joined by a joint are
            disabled. Pairs with no moving joint between them are always disabled, unless the SRDF enables them by name.
        packages: {package: folder} for meshes named package://NAME/...; other packages are searched in
            AMENT_PREFIX_PATH and ROS_PACKAGE_PATH. Relative paths of meshes start at the URDF's folder.
        base: pose of the base, 7 numbers or (4, 4), in the world or in the parent. Default: the identity.
        static: whether the base never moves.
        geometry: "collision" or "visual" shapes.
        home: {joint: position} at load, radians and metres, or the name of a group state of the SRDF; other joints are
            at 0. By default, links have no pose until their joints have positions.
        padding: growth of the links in metres, one number or {link: metres}.
        uncertainty: {link: {"position": metres, "angle": radians}}, bounds on the pose error of the link alone, not of
            its children.
        mesh_as: body made from the links' meshes, as in add_mesh(): one word or {link: word}, "auto" for the others.

        Raises SceneError naming file, line and element. Warns (RobotWarning) of ignored parts of the SRDF and
        suspicious parts of the URDF, (MeshWarning) once for all links that reach far outside their meshes, and
        (PoseWarning) of a base whose quaternion looks like x, y, z, w.
        """
        folders = {} if packages is None else dict(to_items(packages, "packages", "a dict of folders by package"))
        by_link = isinstance(padding, Mapping)
        named = isinstance(mesh_as, Mapping)
        by_joint = home is not None and not isinstance(home, str)
        with self._lock:
            bodies = len(self._scene.bodies())
            index = self._scene.add_robot(
                to_text(name, "name"),
                to_path(urdf, "urdf"),
                "" if srdf is None else to_path(srdf, "srdf"),
                {to_text(key, "packages"): to_path(folder, f"packages[{key!r}]") for key, folder in folders.items()},
                None if base is None else as_first_pose(base, "base"),
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
                MESH_AS["auto"] if named else to_word(mesh_as, MESH_AS, "mesh_as"),
                _mesh_as_by_link(mesh_as) if isinstance(mesh_as, Mapping) else {},
            )
            warn_of_meshes(self._scene, bodies)
            warn_of_robots(self._scene, index)


def _numbers_by_name(value: Any, what: str, expected: str) -> dict[str, float]:
    items = to_items(value, what, f"a dict of {expected}")
    return {to_text(key, what): to_number(number, f"{what}[{key!r}]") for key, number in items}


def _mesh_as_by_link(value: Mapping[str, str]) -> dict[str, int]:
    return {to_text(link, "mesh_as"): to_word(how, MESH_AS, f"mesh_as[{link!r}]") for link, how in value.items()}
