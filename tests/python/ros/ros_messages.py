"""Fakes of the messages of ROS and MoveIt, and classes of the interface files of clearance_msgs."""

import re
from pathlib import Path
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


def thing(name, operation=ADD, primitives=(), meshes=(), where=None, planes=(), frame=""):
    """moveit_msgs/CollisionObject, whose operation is a byte."""
    return Message(
        header=Message(stamp=Message(sec=0, nanosec=0), frame_id=frame),
        id=name, operation=bytes([operation]), pose=where or pose(), planes=list(planes),
        primitives=[p for p, _ in primitives], primitive_poses=[where for _, where in primitives],
        meshes=[m for m, _ in meshes], mesh_poses=[where for _, where in meshes],
    )  # fmt: skip


def scene(objects=(), attached=(), is_diff=True, names=(), allowed=(), octomap=()):
    """moveit_msgs/PlanningScene."""
    rows = [Message(enabled=[tuple(sorted((a, b))) in allowed for b in names]) for a in names]
    return Message(
        is_diff=is_diff,
        world=Message(
            collision_objects=list(objects), octomap=Message(header=header(0), octomap=Message(data=list(octomap)))
        ),
        robot_state=Message(attached_collision_objects=list(attached)),
        allowed_collision_matrix=Message(entry_names=list(names), entry_values=rows),
    )


def joints(ns, **positions):
    return Message(header=header(ns), name=list(positions), position=list(positions.values()))


def trajectory(names, *points):
    """trajectory_msgs/JointTrajectory. points: (seconds, positions, velocities)."""
    return Message(
        joint_names=list(names),
        points=[
            Message(
                positions=list(positions), velocities=list(velocities), accelerations=[],
                time_from_start=Message(sec=int(seconds), nanosec=round(seconds % 1 * 1e9)),
            )
            for seconds, positions, *rest in points
            for velocities in (rest[0] if rest else [],)
        ],
    )  # fmt: skip


_FIELD = re.compile(r"^([\w/]+)(\[\])? (\w+)(?:=(\w+))?$")
_PLAIN = {"bool": (False, bool), "string": ("", str), "float64": (0.0, float), "uint8": (0, int), "uint32": (0, int)}


def interfaces(folder: Path):
    """Classes of the .msg files of a package, by name, which have the fields and constants of the files and no others,
    and the fields of the requests and responses of its .srv files."""
    made = {file.stem: _class(file.stem, file.read_text()) for file in folder.glob("msg/*.msg")}
    parts = {file.stem: file.read_text().split("---\n") for file in folder.glob("srv/*.srv")}
    return made, {name: [_fields(part)[0] for part in both] for name, both in parts.items()}


def _fields(text):
    fields, constants = {}, {}
    for line in text.splitlines():
        if line := line.partition("#")[0].strip():
            kind, array, name, value = _FIELD.fullmatch(line).groups()
            if value is None:
                fields[name] = kind, bool(array)
            else:
                constants[name] = int(value)
    return fields, constants


def _class(name, text):
    fields, constants = _fields(text)

    class Made:
        __slots__ = tuple(fields)

        def __init__(self, **given):
            for key, (kind, array) in fields.items():
                plain = _PLAIN.get(kind, (Message(stamp=None), object))[0]
                setattr(self, key, [] if array else plain)
            for key, value in given.items():
                setattr(self, key, value)

        def __setattr__(self, key, value):
            kind, array = fields[key]  # a KeyError for a field that the file has not
            wanted = _PLAIN.get(kind, (None, object))[1]
            values = list(value) if array else [value]
            assert not array or isinstance(value, list), f"{name}.{key}: expected a list, got {value!r}"
            assert all(isinstance(item, wanted) for item in values), f"{name}.{key}: expected {kind}, got {value!r}"
            object.__setattr__(self, key, value)

    Made.__name__ = name
    for key, value in constants.items():
        setattr(Made, key, value)
    return Made
