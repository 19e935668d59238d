"""Poses and shapes of ROS messages, as a client of a daemon takes them."""

from collections.abc import Iterator
from typing import Any

import numpy as np

# Values of shape_msgs/SolidPrimitive.
BOX, SPHERE, CYLINDER, CONE = 1, 2, 3, 4


def pose_of(message: Any) -> list[float]:
    """[x, y, z, qw, qx, qy, qz] of a geometry_msgs/Pose or Transform.

    A quaternion of zeros in a Pose is the identity, as in MoveIt. In a Transform it stays, and is no rotation.
    """
    if hasattr(message, "translation"):
        p, q, is_empty = message.translation, message.rotation, False
    else:
        p, q = message.position, message.orientation
        is_empty = not any((q.w, q.x, q.y, q.z))
    turn = [1.0, 0.0, 0.0, 0.0] if is_empty else [q.w, q.x, q.y, q.z]
    return [float(number) for number in (p.x, p.y, p.z, *turn)]


def matrix_of(pose: list[float]) -> np.ndarray:
    """(4, 4) of a pose."""
    w, x, y, z = np.array(pose[3:]) / np.linalg.norm(pose[3:])
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, 3] = pose[:3]
    return matrix


def shapes_of(item: Any) -> Iterator[tuple[dict[str, Any], np.ndarray]]:
    """Arguments of add_body() for each shape of an object, and its pose in the object."""
    if len(item.primitives) != len(item.primitive_poses) or len(item.meshes) != len(item.mesh_poses):
        raise ValueError("it has another number of shapes than of poses")
    for primitive, pose in zip(item.primitives, item.primitive_poses):
        yield primitive_of(primitive), matrix_of(pose_of(pose))
    for mesh, pose in zip(item.meshes, item.mesh_poses):
        vertices = np.array([[p.x, p.y, p.z] for p in mesh.vertices], dtype=np.float64).reshape(-1, 3)
        triangles = np.array([list(t.vertex_indices) for t in mesh.triangles], dtype=np.uint32).reshape(-1, 3)
        yield {"mesh": (vertices, triangles)}, matrix_of(pose_of(pose))


def primitive_of(primitive: Any) -> dict[str, Any]:
    """Arguments of add_body() for a shape_msgs/SolidPrimitive, whose dimensions have a specific order."""
    size = [float(number) for number in primitive.dimensions]
    kinds = {BOX: ("box", 3), SPHERE: ("sphere", 1), CYLINDER: ("cylinder", 2), CONE: ("cone", 2)}
    if primitive.type not in kinds:
        raise ValueError(f"primitives of type {primitive.type} are not supported")
    word, count = kinds[primitive.type]
    if len(size) != count:
        raise ValueError(f"a {word} has {count} dimensions, not {len(size)}")
    if count == 2:  # height, radius
        return {word: (size[1], size[0])}
    return {word: size[0] if count == 1 else size}
