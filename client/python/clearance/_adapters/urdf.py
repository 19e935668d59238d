"""Joints of another project's model as URDFs without shapes, whose links carry the bodies."""

from __future__ import annotations

import pathlib
import tempfile
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple, Optional

import numpy as np

from .._scene.scene import Scene

UNLIMITED = 1e6  # metres: a position beyond it is BAD_POSE


class Tree(NamedTuple):
    """A robot: the bodies from the world, or from a ball joint, on."""

    name: str
    parent: Optional[str]  #: body that the base follows, or None for the world
    xml: list[str]

    def add(
        self, joint: str, kind: str, parent: str, link: str, origin: Optional[np.ndarray] = None, rest: str = ""
    ) -> str:
        """Adds a joint and its child link, and returns the link. rest: further elements of the joint."""
        X = np.eye(4) if origin is None else origin
        self.xml.append(
            f'<link name="{_quoted(link)}"/><joint name="{_quoted(joint)}" type="{kind}">'
            f'<parent link="{_quoted(parent)}"/><child link="{_quoted(link)}"/>'
            f'<origin xyz="{_numbers(X[:3, 3])}" rpy="{_numbers(roll_pitch_yaw(X[:3, :3]))}"/>{rest}</joint>'
        )
        return link

    def add_moving(
        self, joint: str, slides: bool, parent: str, link: str, origin: np.ndarray, axis: Any, limits: Any = None
    ) -> None:
        """Adds a joint of one position, and its child link. limits: radians or metres, or None."""
        kind = "prismatic" if slides else "continuous" if limits is None else "revolute"
        low, high = (-UNLIMITED, UNLIMITED) if limits is None else map(float, limits)
        limit = "" if kind == "continuous" else f'<limit lower="{low!r}" upper="{high!r}" effort="1" velocity="1"/>'
        self.add(joint, kind, parent, link, origin, f'<axis xyz="{_numbers(axis)}"/>{limit}')

    def urdf(self) -> str:
        return '<robot name="adapted">\n' + "\n".join(self.xml) + "\n</robot>\n"


def new_tree(name: str, parent: Optional[str], base: str) -> Tree:
    return Tree(name, parent, [f'<link name="{_quoted(base)}"/>'])


def add_trees(scene: Scene, trees: Sequence[Tree]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        for tree in trees:
            file = pathlib.Path(folder) / "adapted.urdf"
            file.write_text(tree.urdf(), encoding="utf-8")
            scene.add_robot(tree.name, file, static=tree.parent is None, parent=tree.parent)


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
    return [text or unique(otherwise(i), taken) for i, text in enumerate(given)]


def unique(name: str, taken: set[str]) -> str:
    """Returns the name, or one with a number after it, that is not taken, and adds it."""
    found = next(text for text in _numbered(name) if text not in taken)
    taken.add(found)
    return found


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
