"""The joints of a MuJoCo model as a URDF without shapes, whose links carry the geoms."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Callable, NamedTuple, Optional

import numpy as np

FREE, BALL, SLIDE = range(3)  # mjtJoint; the others are hinges
UNLIMITED = 1e6  # metres: a position beyond it is BAD_POSE


class Tree(NamedTuple):
    """A robot: the bodies from the world, or from a ball joint, on."""

    name: str
    parent: Optional[str]  #: body that the base follows; None: the world
    xml: list[str]

    def urdf(self) -> str:
        return '<robot name="mujoco">\n' + "\n".join(self.xml) + "\n</robot>\n"


class Skeleton:
    """Links and joints. A link of a body has the body's name; several joints of a body have links between them."""

    def __init__(self, model: Any, robot: str, bodies: Sequence[str], joints: Sequence[str]):
        self.links = [f"{robot}/{bodies[0]}"]  #: the body of the scene that places each body of the model
        self.trees: list[Tree] = []
        self.moving: list[tuple[str, int]] = []  #: hinges and slides, in the order of qpos: name and id
        self.placed: list[tuple[str, int]] = []  #: bodies of the scene that free and ball joints place, and the joint
        self.mocap: list[tuple[str, int]] = []  #: bodies of the scene that are mocap bodies
        self._model, self._joints = model, joints
        self._tree_of = [self._add_tree(robot, None, bodies[0])]
        for body in range(1, model.nbody):
            self._add_body(body, bodies[body])

    def _add_tree(self, name: str, parent: Optional[str], base: str) -> Tree:
        self.trees.append(Tree(name, parent, [f'<link name="{_quoted(base)}"/>']))
        return self.trees[-1]

    def _add_body(self, body: int, name: str) -> None:
        model = self._model
        parent = int(model.body_parentid[body])
        tree, origin = self._tree_of[parent], matrix(model.body_pos[body], model.body_quat[body])
        at = self.links[parent].removeprefix(f"{tree.name}/")
        joints = range(int(model.body_jntadr[body]), int(model.body_jntadr[body] + model.body_jntnum[body]))
        if model.body_mocapid[body] >= 0:
            at = self._link(tree, f"{name}#mocap", "floating", at, name)
            self.mocap.append((f"{tree.name}/{name}", body))
        for j in joints:
            kind, anchor = int(model.jnt_type[j]), model.jnt_pos[j] * (model.jnt_type[j] not in (FREE, SLIDE))
            last = j == joints[-1] and not anchor.any()
            link = name if last else f"{name}#{j - joints[0]}"
            origin = origin @ matrix(anchor)
            if kind == FREE:  # its pose replaces the body's
                self._link(tree, self._joints[j], "floating", at, link)
                self.placed.append((f"{tree.name}/{link}", j))
            elif kind == BALL:  # a floating link would not follow its parent
                foot = self._link(tree, f"{self._joints[j]}#foot", "fixed", at, f"{link}#foot", origin)
                tree = self._add_tree(f"{self.trees[0].name}.{name}", f"{tree.name}/{foot}", link)
                self.placed.append((tree.name, j))
            else:
                self._move(tree, at, link, j, origin)
            at, origin = link, matrix(-anchor)
        if at != name:
            self._link(tree, f"{name}#fixed", "fixed", at, name, origin)
        self._tree_of.append(tree)
        self.links.append(f"{tree.name}/{name}")

    def _move(self, tree: Tree, parent: str, link: str, joint: int, origin: np.ndarray) -> None:
        """Adds a hinge or a slide whose position is that of qpos."""
        model = self._model
        slides, axis = model.jnt_type[joint] == SLIDE, model.jnt_axis[joint]
        zero = float(model.qpos0[model.jnt_qposadr[joint]])
        if zero:
            origin = origin @ (matrix(-zero * axis) if slides else turn(axis, -zero))
        limited = bool(model.jnt_limited[joint])
        low, high = map(float, model.jnt_range[joint]) if limited else (-UNLIMITED, UNLIMITED)
        kind = "prismatic" if slides else "revolute" if limited else "continuous"
        limit = f'<limit lower="{low!r}" upper="{high!r}" effort="1" velocity="1"/>' if limited or slides else ""
        self.moving.append((f"{tree.name}/{self._joints[joint]}", joint))
        self._link(tree, self._joints[joint], kind, parent, link, origin, f'<axis xyz="{_numbers(axis)}"/>{limit}')

    @staticmethod
    def _link(
        tree: Tree, joint: str, kind: str, parent: str, link: str, origin: Optional[np.ndarray] = None, rest: str = ""
    ) -> str:
        """Adds a joint and its child link, and returns the link."""
        X = np.eye(4) if origin is None else origin
        tree.xml.append(
            f'<link name="{_quoted(link)}"/><joint name="{_quoted(joint)}" type="{kind}">'
            f'<parent link="{_quoted(parent)}"/><child link="{_quoted(link)}"/>'
            f'<origin xyz="{_numbers(X[:3, 3])}" rpy="{_numbers(roll_pitch_yaw(X[:3, :3]))}"/>{rest}</joint>'
        )
        return link


def matrix(position: Any, quaternion: Any = (1.0, 0.0, 0.0, 0.0)) -> np.ndarray:
    """(4, 4) of a position and a unit quaternion w, x, y, z."""
    w, x, y, z = np.asarray(quaternion, dtype=float) / np.linalg.norm(quaternion)
    out = np.eye(4)
    out[:3, :3] = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    out[:3, 3] = position
    return out


def turn(axis: np.ndarray, angle: float) -> np.ndarray:
    """(4, 4) of a rotation about an axis through the origin, radians."""
    return matrix(np.zeros(3), [np.cos(angle / 2), *(np.sin(angle / 2) * axis)])


def roll_pitch_yaw(r: np.ndarray) -> tuple[float, float, float]:
    """Returns URDF's angles of a rotation, radians; accurate also near a pitch of a right angle."""
    yaw = float(np.arctan2(r[1, 0], r[0, 0]))
    s, c = np.sin(yaw), np.cos(yaw)
    roll = float(np.arctan2(s * r[0, 2] - c * r[1, 2], c * r[1, 1] - s * r[0, 1]))
    return roll, float(np.arctan2(-r[2, 0], np.hypot(r[0, 0], r[1, 0]))), yaw


def names_of(count: int, view: Callable[[int], Any], otherwise: Callable[[int], str]) -> list[str]:
    """Returns a unique name of each id: that of its view, or for an empty one `otherwise`, made unique."""
    given = [view(i).name for i in range(count)]
    taken = set(given)
    for i, text in enumerate(given):
        if not text:
            given[i] = next(found for found in _numbered(otherwise(i)) if found not in taken)
            taken.add(given[i])
    return given


def _numbered(name: str) -> Iterator[str]:
    yield name
    k = 2
    while True:
        yield f"{name}.{k}"
        k += 1


def _numbers(values: Any) -> str:
    return " ".join(repr(float(value)) for value in values)


def _quoted(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")
