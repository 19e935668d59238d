"""Scenes from models of Pinocchio. Importing this package does not require pinocchio."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Optional, Union, overload

import numpy as np

from .._arguments import to_text
from .._coal import from_coal
from .._poses import pose7_from_matrix
from .._scene.scene import Scene
from .urdf import UNLIMITED, Tree, add_trees, new_tree
from .world import World

_AXES: Mapping[str, tuple[int, int, int]] = {"X": (1, 0, 0), "Y": (0, 1, 0), "Z": (0, 0, 1)}
_PLACED = {"JointModelFreeFlyer": 0, "JointModelSpherical": 3}  # first number of a pose that the configuration gives


@overload
def from_pinocchio(geometry_model: Any) -> Scene: ...
@overload
def from_pinocchio(geometry_model: Any, model: Any, name: str = "pinocchio") -> PinocchioWorld: ...


def from_pinocchio(
    geometry_model: Any, model: Optional[Any] = None, name: str = "pinocchio"
) -> Union[Scene, PinocchioWorld]:
    """Creates a scene from a pinocchio.GeometryModel, with a body for each geometry object, by its name.

        world = clearance.from_pinocchio(robot.collision_model, robot.model)
        world.set_state(q)
        world.engine.distances(reduce="min")
        world.engine.check_path(world.configurations(path), **world.moving, margin=0.01)

    model: the pinocchio.Model whose joints move the objects. The result is then a PinocchioWorld, otherwise a Scene
        whose bodies start without poses; Pinocchio's placements (GeometryData.oMg) are X_wb.
    name: name of the robot to which the joints belong: joint "elbow" is "pinocchio/elbow", radians and metres. Joints
        beyond a spherical joint or a free-flyer J, other than one at the root, belong to the robot "pinocchio.J".

    Motions and paths are not those of pinocchio.interpolate(): free-flyers and planar joints move straight while they
    turn, there along a screw. Where the latter is executed, pass a path with configurations of pinocchio.interpolate()
    in between, and a margin for the rest. Unbounded joints move the shorter way, as there, only between consecutive
    rows of one call of configurations(): convert both ends of a motion in one call.

    Only pairs in collisionPairs are enabled, unless it is empty. A mesh becomes its hull (from_coal()).

    Raises TypeError, ValueError or SceneError, naming the object or joint, for an unsupported shape or joint
    (composite, helical, mimic, universal, ellipsoid), a pair of two static objects, and a repeated name.
    """
    if model is not None:
        return PinocchioWorld(geometry_model, model, to_text(name, "name"))
    scene = Scene()
    for item in geometry_model.geometryObjects:
        scene.add_body(item.name, **_shape(item))
    _ignore_pairs(scene, geometry_model, set())
    return scene


class PinocchioWorld(World):
    """A model of Pinocchio as a scene, and its configurations. from_pinocchio() makes it, and describes motions."""

    def __init__(self, geometry_model: Any, model: Any, name: str):
        self._columns: list[tuple[int, bool]] = []  #: of q by position: number, or cosine and sine of an angle
        self._placed: list[tuple[int, int]] = []  #: of q by placed body, and the first number of a pose
        self._joints: list[str] = []
        self._bodies: list[str] = []
        self._trees = [new_tree(name, None, "universe")]
        self._links = [(self._trees[0], "universe")]
        for i in range(1, model.njoints):
            self._add_joint(model, i)
        import pinocchio

        super().__init__(Scene(), self._joints, self._bodies, np.array(pinocchio.neutral(model)))
        add_trees(self.scene, self._trees)
        static = set()
        for i, item in enumerate(geometry_model.geometryObjects):
            tree, link = self._links[item.parentJoint]
            pose = pose7_from_matrix(item.placement.homogeneous)
            if item.parentJoint == 0:
                static.add(i)
                self.scene.add_body(item.name, **_shape(item), static=True, pose=pose)
            else:
                self.scene.add_body(item.name, **_shape(item), parent=f"{tree.name}/{link}", pose=pose)
        _ignore_pairs(self.scene, geometry_model, static)

    def _add_joint(self, model: Any, i: int) -> None:
        joint, name = model.joints[i], model.names[i]
        tree, at = self._links[model.parents[i]]
        origin, kind, q = model.jointPlacements[i].homogeneous, joint.shortname(), int(joint.idx_q)
        if kind in _PLACED:
            self._links.append((self._place(tree, at, name, origin, kind), name))
            self._placed.append((q, _PLACED[kind]))
            return
        steps = list(_steps(joint, kind))
        if not steps:
            raise ValueError(f"joint {name!r}: {kind} has no counterpart")
        for k, (suffix, slides, axis, is_angle) in enumerate(steps):
            link = name if k == len(steps) - 1 else f"{name}{suffix}#link"
            low, high = model.lowerPositionLimit[q], model.upperPositionLimit[q]
            limits = None if is_angle or max(abs(low), abs(high)) > UNLIMITED else (low, high)
            tree.add_moving(f"{name}{suffix}", slides, at, link, origin, axis, limits)
            self._columns.append((q, is_angle))
            self._joints.append(f"{tree.name}/{name}{suffix}")
            q, at, origin = q + 1, link, np.eye(4)
        self._links.append((tree, name))

    def _place(self, tree: Tree, at: str, name: str, origin: np.ndarray, kind: str) -> Tree:
        """Adds a link that poses place, and returns its tree."""
        if kind == "JointModelFreeFlyer" and at == "universe" and np.array_equal(origin, np.eye(4)):
            tree.add(name, "floating", at, name)
            self._bodies.append(f"{tree.name}/{name}")
            return tree
        foot = tree.add(f"{name}#foot", "fixed", at, f"{name}#foot", origin)
        self._trees.append(new_tree(f"{self._trees[0].name}.{name}", f"{tree.name}/{foot}", name))
        self._bodies.append(self._trees[-1].name)
        return self._trees[-1]

    def _positions(self, rows: np.ndarray) -> np.ndarray:
        """(K, J) positions. Unbounded angles are unwrapped from row to row, the shorter way."""
        out = np.empty((len(rows), len(self._columns)))
        for j, (q, is_angle) in enumerate(self._columns):
            out[:, j] = np.unwrap(np.arctan2(rows[:, q + 1], rows[:, q])) if is_angle else rows[:, q]
        return out

    def _poses(self, rows: np.ndarray) -> np.ndarray:
        poses = np.zeros((len(rows), len(self._placed), 7))
        for m, (q, first) in enumerate(self._placed):
            numbers = rows[:, q : q + 7 - first]
            poses[:, m, first:3] = numbers[:, : 3 - first]
            poses[:, m, 3] = numbers[:, -1]  # Pinocchio's quaternions are x, y, z, w
            poses[:, m, 4:] = numbers[:, -4:-1]
        return poses


def _steps(joint: Any, kind: str) -> Iterator[tuple[str, bool, Any, bool]]:
    """Yields the moves that a joint consists of: suffix, whether it slides, axis, whether q has cosine and sine."""
    if kind == "JointModelTranslation":
        for letter in "XYZ":
            yield f"/{letter.lower()}", True, _AXES[letter], False
    elif kind == "JointModelPlanar":
        yield from (
            ("/x", True, _AXES["X"], False),
            ("/y", True, _AXES["Y"], False),
            ("/theta", False, _AXES["Z"], True),
        )
    elif kind == "JointModelSphericalZYX":
        for letter in "ZYX":
            yield f"/{letter.lower()}", False, _AXES[letter], False
    elif kind in (
        "JointModelRevoluteUnaligned",
        "JointModelRevoluteUnboundedUnaligned",
        "JointModelPrismaticUnaligned",
    ):
        yield "", "Prismatic" in kind, joint.extract().axis, "Unbounded" in kind
    elif kind[:-1] in ("JointModelR", "JointModelRUB", "JointModelP"):
        yield "", kind[:-1].endswith("P"), _AXES[kind[-1]], "RUB" in kind


def _shape(item: Any) -> dict[str, Any]:
    try:
        return from_coal(item.geometry)
    except (TypeError, ValueError) as error:
        raise type(error)(f"{item.name}: {error}") from None


def _ignore_pairs(scene: Scene, geometry_model: Any, static: set[int]) -> None:
    """Disables the pairs that are not in collisionPairs. static: objects that never move."""
    names = [item.name for item in geometry_model.geometryObjects]
    enabled = {frozenset((pair.first, pair.second)) for pair in geometry_model.collisionPairs}
    for pair in enabled:
        if pair <= static:
            raise ValueError(
                f"collisionPairs: {' and '.join(repr(names[i]) for i in sorted(pair))} are both static: their distance "
                "never changes, and static pairs have no counterpart"
            )
    for i in range(len(names)) if enabled else ():
        for j in range(i):
            if frozenset((i, j)) not in enabled and not {i, j} <= static:
                scene.ignore(names[i], names[j])
