"""Fakes of the messages of ROS and MoveIt."""

from types import SimpleNamespace as Message

ADD, REMOVE, APPEND, MOVE = 0, 1, 2, 3


def header(ns):
    return Message(stamp=Message(sec=ns // 10**9, nanosec=ns % 10**9), frame_id="")


def pose(x=0.0, y=0.0, z=0.0, q=(0.0, 0.0, 0.0, 1.0)):
    """geometry_msgs/Pose; the quaternion as in ROS, w last."""
    return Message(position=Message(x=x, y=y, z=z), orientation=Message(**dict(zip("xyzw", map(float, q)))))


def transform(name, ns, x, y, z):
    t = Message(translation=Message(x=x, y=y, z=z), rotation=Message(x=0.0, y=0.0, z=0.0, w=1.0))
    return Message(header=header(ns), child_frame_id=name, transform=t)


def primitive(kind, *dimensions):
    return Message(type=kind, dimensions=list(dimensions))


def thing(name, operation=ADD, primitives=(), meshes=(), where=None, planes=()):
    """moveit_msgs/CollisionObject, whose operation is a byte."""
    return Message(
        id=name, operation=bytes([operation]), pose=where or pose(), planes=list(planes),
        primitives=[p for p, _ in primitives], primitive_poses=[where for _, where in primitives],
        meshes=[m for m, _ in meshes], mesh_poses=[where for _, where in meshes],
    )  # fmt: skip


def scene(objects=(), attached=(), is_diff=True, names=(), allowed=()):
    """moveit_msgs/PlanningScene."""
    rows = [Message(enabled=[tuple(sorted((a, b))) in allowed for b in names]) for a in names]
    return Message(
        is_diff=is_diff,
        world=Message(collision_objects=list(objects)),
        robot_state=Message(attached_collision_objects=list(attached)),
        allowed_collision_matrix=Message(entry_names=list(names), entry_values=rows),
    )


def joints(ns, **positions):
    return Message(header=header(ns), name=list(positions), position=list(positions.values()))
