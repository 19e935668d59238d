"""The joints of a MuJoCo model as URDFs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Optional

import numpy as np

from .urdf import Tree, matrix, new_tree, turn

FREE, BALL, SLIDE = range(3)  # mjtJoint; the others are hinges


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
        self.trees.append(new_tree(name, parent, base))
        return self.trees[-1]

    def _add_body(self, body: int, name: str) -> None:
        model = self._model
        parent = int(model.body_parentid[body])
        tree, origin = self._tree_of[parent], matrix(model.body_pos[body], model.body_quat[body])
        at = self.links[parent].removeprefix(f"{tree.name}/")
        joints = range(int(model.body_jntadr[body]), int(model.body_jntadr[body] + model.body_jntnum[body]))
        if model.body_mocapid[body] >= 0:
            at = tree.add(f"{name}#mocap", "floating", at, name)
            self.mocap.append((f"{tree.name}/{name}", body))
        for j in joints:
            kind, anchor = int(model.jnt_type[j]), model.jnt_pos[j] * (model.jnt_type[j] not in (FREE, SLIDE))
            last = j == joints[-1] and not anchor.any()
            link = name if last else f"{name}#{j - joints[0]}"
            origin = origin @ matrix(anchor)
            if kind == FREE:  # its pose replaces the body's
                tree.add(self._joints[j], "floating", at, link)
                self.placed.append((f"{tree.name}/{link}", j))
            elif kind == BALL:  # a floating link would not follow its parent
                foot = tree.add(f"{self._joints[j]}#foot", "fixed", at, f"{link}#foot", origin)
                tree = self._add_tree(f"{self.trees[0].name}.{name}", f"{tree.name}/{foot}", link)
                self.placed.append((tree.name, j))
            else:
                self._move(tree, at, link, j, origin)
            at, origin = link, matrix(-anchor)
        if at != name:
            tree.add(f"{name}#fixed", "fixed", at, name, origin)
        self._tree_of.append(tree)
        self.links.append(f"{tree.name}/{name}")

    def _move(self, tree: Tree, parent: str, link: str, joint: int, origin: np.ndarray) -> None:
        """Adds a hinge or a slide whose position is that of qpos."""
        model = self._model
        slides, axis = model.jnt_type[joint] == SLIDE, model.jnt_axis[joint]
        zero = float(model.qpos0[model.jnt_qposadr[joint]])
        if zero:
            origin = origin @ (matrix(-zero * axis) if slides else turn(axis, -zero))
        limits = model.jnt_range[joint] if model.jnt_limited[joint] else None
        self.moving.append((f"{tree.name}/{self._joints[joint]}", joint))
        tree.add_moving(self._joints[joint], slides, parent, link, origin, axis, limits)
