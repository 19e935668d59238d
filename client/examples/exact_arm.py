"""Distance of the arm of scenes/cell from balls and from a floor, without Clearance: numpy and the URDF alone.

Shapes of the URDF are boxes, cylinders and spheres, for which the distance from a point has a closed form, and a floor
needs only the lowest point. The examples check their results with it.
"""

from __future__ import annotations

import xml.etree.ElementTree as xml
from typing import NamedTuple

import numpy as np


class Shape(NamedTuple):
    link: str
    kind: str  #: "box", "cylinder" or "sphere"
    size: np.ndarray  #: (3,) edges; radius and length; radius
    X_link_shape: np.ndarray  #: (4, 4)


class Joint(NamedTuple):
    name: str
    parent: str
    child: str
    X_parent_joint: np.ndarray  #: (4, 4)
    axis: np.ndarray
    kind: str


class ExactArm:
    """The arm at (K, J) positions of some of its joints, in radians and metres; the others are at 0."""

    def __init__(self, urdf, joints, X_world_base=None):
        robot = xml.parse(urdf).getroot()
        self.moving = list(joints)
        self.base = np.eye(4) if X_world_base is None else X_world_base
        self.joints = [joint_of(element) for element in robot.findall("joint")]
        self.shapes = [
            Shape(link.get("name"), *geometry_of(collision))
            for link in robot.findall("link")
            for collision in link.findall("collision")
        ]

    def links(self, positions) -> dict[str, np.ndarray]:
        """(K, 4, 4) poses of the links in the world."""
        rows = np.atleast_2d(positions)
        children = {joint.child for joint in self.joints}
        (root,) = {joint.parent for joint in self.joints} - children
        poses = {root: np.broadcast_to(self.base, (len(rows), 4, 4))}
        for joint in self.joints:  # the file lists parents before children
            turn = np.broadcast_to(np.eye(4), (len(rows), 4, 4)).copy()
            if joint.name in self.moving:
                q = rows[:, self.moving.index(joint.name)]
                if joint.kind == "prismatic":
                    turn[:, :3, 3] = q[:, None] * joint.axis
                else:
                    turn[:, :3, :3] = rotations(joint.axis, q)
            poses[joint.child] = poses[joint.parent] @ joint.X_parent_joint @ turn
        return poses

    def to_points(self, positions, points) -> np.ndarray:
        """(K, N) metres: distance of the arm from (K, N, 3) points in the world; 0 inside it."""
        poses = self.links(positions)
        least = np.full(np.shape(points)[:2], np.inf)
        for shape in self.shapes:
            X = poses[shape.link] @ shape.X_link_shape
            local = np.einsum("kij,kni->knj", X[:, :3, :3], points - X[:, None, :3, 3])
            least = np.minimum(least, outside(shape, local))
        return least

    def lowest(self, positions, links) -> np.ndarray:
        """(K,) metres: the height of the lowest point of some links."""
        poses = self.links(positions)
        least = np.full(len(np.atleast_2d(positions)), np.inf)
        for shape in self.shapes:
            if shape.link in links:
                X = poses[shape.link] @ shape.X_link_shape
                least = np.minimum(least, X[:, 2, 3] - reach_down(shape, X[:, 2, :3]))
        return least


def outside(shape: Shape, p: np.ndarray) -> np.ndarray:
    """Distance of points in a shape's own frame from the shape."""
    if shape.kind == "sphere":
        return np.maximum(np.linalg.norm(p, axis=-1) - shape.size[0], 0)
    if shape.kind == "box":
        return np.linalg.norm(np.maximum(np.abs(p) - shape.size / 2, 0), axis=-1)
    radius, length = shape.size
    beside = np.maximum(np.hypot(p[..., 0], p[..., 1]) - radius, 0)
    return np.hypot(beside, np.maximum(np.abs(p[..., 2]) - length / 2, 0))


def reach_down(shape: Shape, down: np.ndarray) -> np.ndarray:
    """Distance by which a shape extends below its centre; down: (K, 3), the world's z axis in the shape's frame."""
    if shape.kind == "sphere":
        return np.full(len(down), shape.size[0])
    if shape.kind == "box":
        return np.abs(down) @ shape.size / 2
    radius, length = shape.size
    return radius * np.hypot(down[:, 0], down[:, 1]) + length / 2 * np.abs(down[:, 2])


def numbers(text: str) -> np.ndarray:
    return np.array([float(word) for word in text.split()])


def rotations(axis: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """(K, 3, 3) rotations about a unit axis."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    s, c = np.sin(angles)[:, None, None], np.cos(angles)[:, None, None]
    return np.eye(3) + s * cross + (1 - c) * (cross @ cross)


def origin_of(element) -> np.ndarray:
    origin, X = element.find("origin"), np.eye(4)
    if origin is not None:
        X[:3, 3] = numbers(origin.get("xyz", "0 0 0"))
        for axis, angle in zip(np.eye(3)[::-1], numbers(origin.get("rpy", "0 0 0"))[::-1]):
            X[:3, :3] = X[:3, :3] @ rotations(axis, np.array([angle]))[0]
    return X


def joint_of(element) -> Joint:
    axis = element.find("axis")
    return Joint(
        element.get("name"),
        element.find("parent").get("link"),
        element.find("child").get("link"),
        origin_of(element),
        np.array([1.0, 0, 0]) if axis is None else numbers(axis.get("xyz")),
        element.get("type"),
    )


def geometry_of(collision):
    (shape,) = collision.find("geometry")
    size = numbers(shape.get("size")) if shape.tag == "box" else numbers(shape.get("radius"))
    if shape.tag == "cylinder":
        size = np.append(size, float(shape.get("length")))
    return shape.tag, size, origin_of(collision)
