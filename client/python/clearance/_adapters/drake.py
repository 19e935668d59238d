"""A scene from a plant of Drake. Importing this package does not require drake."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from .._poses import pose7_from_matrix
from .._scene.scene import Scene
from .urdf import UNLIMITED, Tree, add_trees, new_tree, unique
from .world import World

_X, _Y, _Z = np.eye(3)
#: The moves of joints of several positions: suffix, whether it slides, axis, position.
_STEPS: dict[str, tuple[tuple[str, bool, Any, int], ...]] = {
    "planar": (("/x", True, _X, 0), ("/y", True, _Y, 1), ("/theta", False, _Z, 2)),
    "universal": (("/1", False, _X, 0), ("/2", False, _Y, 1)),
    "ball_rpy": (("/yaw", False, _Z, 2), ("/pitch", False, _Y, 1), ("/roll", False, _X, 0)),
    "rpy_floating": (
        ("/x", True, _X, 3), ("/y", True, _Y, 4), ("/z", True, _Z, 5),
        ("/yaw", False, _Z, 2), ("/pitch", False, _Y, 1), ("/roll", False, _X, 0),
    ),
}  # fmt: skip


class DrakeWorld(World):
    """A finalized MultibodyPlant as a scene, with a body for each collision geometry, "BODY/GEOMETRY".

    Raises ValueError, naming it, for a joint, shape or geometry without a counterpart, and for a proximity geometry of
    the SceneGraph that is none of the plant's.
    """

    def __init__(self, plant: Any, scene_graph: Any, name: str = "drake"):
        self.geometries: dict[str, tuple[Any, int]] = {}  #: geometry id and body index of each body of the scene
        self.columns: list[int] = []  #: the position of the plant that each joint has
        self.column_bodies: list[int] = []  #: the index of the body that it moves
        self.placed: list[int] = []  #: the first position of the plant of each body that a quaternion joint places
        self.placed_bodies: list[int] = []  #: the index of that body
        self._joints: list[str] = []
        self._bodies: list[str] = []
        self._trees = [new_tree(name, None, "world")]
        self._links: dict[int, tuple[Tree, str]] = {int(plant.world_body().index()): (self._trees[0], "world")}
        self._add_joints([plant.get_joint(index) for index in plant.GetJointIndices()])
        context = plant.CreateDefaultContext()
        super().__init__(Scene(), self._joints, self._bodies, np.array(plant.GetPositions(context)))
        add_trees(self.scene, self._trees)
        self._add_geometries(plant, scene_graph.model_inspector(), context)

    def _add_joints(self, joints: list[Any]) -> None:
        """Adds the joints from the world on, in any order of theirs."""
        while joints:
            ready = [joint for joint in joints if int(joint.parent_body().index()) in self._links]
            if not ready:
                raise ValueError(f"joint {joints[0].name()!r}: its parent does not hang on the world through joints")
            for joint in ready:
                if int(joint.child_body().index()) in self._links:
                    raise ValueError(f"joint {joint.name()!r}: its child hangs on another joint already")
                self._add_joint(joint)
            joints = [joint for joint in joints if joint not in ready]

    def _add_joint(self, joint: Any) -> None:
        kind, child = joint.type_name(), joint.child_body()
        tree, at = self._links[int(joint.parent_body().index())]
        origin = joint.frame_on_parent().GetFixedPoseInBodyFrame().GetAsMatrix4()
        rest = joint.frame_on_child().GetFixedPoseInBodyFrame().inverse().GetAsMatrix4()
        if kind == "weld":
            origin = origin @ joint.X_FM().GetAsMatrix4()
        name = _scoped(child)
        if kind == "quaternion_floating":
            foot = tree.add(f"{name}#foot", "fixed", at, f"{name}#foot", origin)
            tree, at = (
                new_tree(f"{self._trees[0].name}.{name}", f"{tree.name}/{foot}", f"{name}#moved"),
                f"{name}#moved",
            )
            self._trees.append(tree)
            self._bodies.append(tree.name)
            self.placed.append(int(joint.position_start()))
            self.placed_bodies.append(int(child.index()))
        else:
            for suffix, slides, axis, k in _steps(joint, kind):
                low, high = float(joint.position_lower_limits()[k]), float(joint.position_upper_limits()[k])
                limits = None if max(abs(low), abs(high)) > UNLIMITED else (low, high)
                link = f"{name}#moved{suffix}"
                tree.add_moving(f"{joint.name()}{suffix}", slides, at, link, origin, axis, limits)
                self.columns.append(int(joint.position_start()) + k)
                self.column_bodies.append(int(child.index()))
                self._joints.append(f"{tree.name}/{joint.name()}{suffix}")
                at, origin = link, np.eye(4)
            rest = origin @ rest
        self._links[int(child.index())] = (tree, tree.add(f"{name}#fixed", "fixed", at, name, rest))

    def _add_geometries(self, plant: Any, inspector: Any, context: Any) -> None:
        if inspector.GetAllDeformableGeometryIds():
            raise ValueError("scene_graph: deformable geometries have no counterpart")
        static = {int(body.index()) for body in plant.GetBodiesWeldedTo(plant.world_body())}
        ids, taken = [], set(self._bodies)
        for index in range(plant.num_bodies()):
            body = plant.get_body(type(plant.world_body().index())(index))
            tree, link = self._links[index]
            for geometry in plant.GetCollisionGeometriesForBody(body):
                name = unique(f"{_scoped(body)}/{inspector.GetName(geometry).split('::')[-1]}", taken)
                try:
                    shape = _shape(inspector, geometry)
                except ValueError as error:
                    raise ValueError(f"{name}: {error}") from None
                pose = inspector.GetPoseInFrame(geometry)
                if index in static:
                    pose = plant.EvalBodyPoseInWorld(context, body) @ pose
                    self.scene.add_body(name, **shape, static=True, pose=pose7_from_matrix(pose.GetAsMatrix4()))
                elif "half_space" in shape:
                    raise ValueError(f"{name}: a half-space on a body that moves has no counterpart")
                else:
                    where = pose7_from_matrix(pose.GetAsMatrix4())
                    self.scene.add_body(name, **shape, parent=f"{tree.name}/{link}", pose=where)
                self.geometries[name] = (geometry, index)
                ids.append((name, geometry, index))
        _check_all_added(inspector, [geometry for _, geometry, _ in ids])
        for i, (name, geometry, body_index) in enumerate(ids):
            for other, second, second_index in ids[:i]:
                both = body_index in static and second_index in static
                if not both and (body_index == second_index or inspector.CollisionFiltered(geometry, second)):
                    self.scene.ignore(name, other)

    def _positions(self, rows: np.ndarray) -> np.ndarray:
        return rows[:, self.columns]

    def _poses(self, rows: np.ndarray) -> np.ndarray:
        poses = np.zeros((len(rows), len(self.placed), 7))
        for m, first in enumerate(self.placed):  # Drake's order is w, x, y, z, then the position
            poses[:, m, 3:], poses[:, m, :3] = rows[:, first : first + 4], rows[:, first + 4 : first + 7]
        return poses


def _check_all_added(inspector: Any, added: list[Any]) -> None:
    from pydrake.geometry import Role

    others = set(inspector.GetAllGeometryIds(Role.kProximity)) - set(added)
    if others:
        name = min(inspector.GetName(geometry) for geometry in others)
        raise ValueError(
            f"scene_graph: the plant has no collision geometry {name!r}: register it with "
            "plant.RegisterCollisionGeometry(), or remove its proximity role"
        )


def _steps(joint: Any, kind: str) -> Iterator[tuple[str, bool, Any, int]]:
    if kind == "weld":
        return
    if kind in ("revolute", "prismatic"):
        slides = kind == "prismatic"
        yield "", slides, joint.translation_axis() if slides else joint.revolute_axis(), 0
    elif kind in _STEPS:
        yield from _STEPS[kind]
    else:
        raise ValueError(f"joint {joint.name()!r}: the type {kind!r} has no counterpart")


def _shape(inspector: Any, geometry: Any) -> dict[str, Any]:
    shape = inspector.GetShape(geometry)
    kind = type(shape).__name__
    if kind == "Box":
        return {"box": tuple(shape.size())}
    if kind == "Sphere":
        return {"sphere": shape.radius()}
    if kind in ("Capsule", "Cylinder"):
        return {kind.lower(): (shape.radius(), shape.length())}
    if kind == "Ellipsoid":
        return {"ellipsoid": (shape.a(), shape.b(), shape.c())}
    if kind == "HalfSpace":
        return {"half_space": True}
    if kind in ("Convex", "Mesh"):
        hull = inspector.GetConvexHull(geometry)
        return {"vertices": np.array([hull.vertex(i) for i in range(hull.num_vertices())])}
    raise ValueError(f"the shape {kind} has no counterpart")


def _scoped(body: Any) -> str:
    return str(body.scoped_name()).replace("::", "/")
