"""Applies moveit_msgs/PlanningScene to a daemon: objects become bodies, attached ones follow links, allowed pairs may
touch.
"""

from typing import Any, Optional

import numpy as np

from . import clearance
from .shapes import matrix_of, pose_of, shapes_of

# Values of moveit_msgs/CollisionObject.
ADD, REMOVE, APPEND, MOVE = 0, 1, 2, 3
MATRIX, OCTOMAP = "allowed_collision_matrix", "octomap"  #: their names in `left_out_fields`
#: Fields that grow links in MoveIt: their value for a link, that of a true link, and the unit. Names in
#: `left_out_fields`.
GROWTHS = {"link_padding": ("padding", 0.0, " m"), "link_scale": ("scale", 1.0, "")}
#: Part of the daemon's error for a solid with an edge that belongs to one triangle.
OPEN_MESH = "the mesh is open there"


class SceneFollower:
    """Updates a daemon's added bodies according to planning scenes.

    An object of one shape is a body of its name; one of several, bodies NAME.0, NAME.1, ... Bodies of the daemon's own
    scene are left alone.

    frame: the name in ROS of the daemon's world frame. Default: "world", and the robot's root link if that is at the
        world's origin.
    """

    def __init__(self, client: clearance.Client, robot: str = "", frame: str = ""):
        self._client = client
        self._prefix = f"{robot}/" if robot else ""
        self._frame = frame
        self._parts: dict[str, list[tuple[str, np.ndarray]]] = {}  # for each object: its bodies, and their places
        self._held: dict[str, str] = {}  # the link of each attached object, also of one that was left out
        self._allowed: set[tuple[str, str]] = set()  # pairs that matrices allowed, and the daemon's scene does not
        self._growths: dict[str, dict[str, float]] = {field: {} for field in GROWTHS}  # by link
        self.is_lost = False  #: the daemon was restarted or lacks a message, and no whole scene has arrived since
        self.left_out: dict[str, str] = {}  #: ids of objects that were not applied, and the reasons
        self.left_out_fields: dict[str, str] = {}  #: fields of scenes that were not applied, and the reasons

    def missing(self) -> list[str]:
        """Objects and fields that were not applied, with a sentence for each."""
        return [f"{name}: {why}" for out in (self.left_out, self.left_out_fields) for name, why in out.items()]

    def on_scene(self, message: Any) -> None:
        """Applies a scene or a difference; rejected changes are left out, and listed by missing().

        Raises ClearanceError if the daemon does not answer.
        """
        try:
            self._apply(message)
        except clearance.ClearanceError:
            self.is_lost = True
            raise

    def _apply(self, message: Any) -> None:
        if not message.is_diff:
            self.is_lost = False
            named = {item.id for item in message.world.collision_objects}
            named |= {item.object.id for item in message.robot_state.attached_collision_objects}
            for name in [name for name in {**self._parts, **self._held} if name not in named]:
                self._remove(name)
            self.left_out = {name: why for name, why in self.left_out.items() if name in named}
            self.left_out_fields.pop(OCTOMAP, None)
        for attached in message.robot_state.attached_collision_objects:  # first, as in MoveIt
            self._try(attached.object.id, self._attached, attached)
        for item in message.world.collision_objects:
            self._try(item.id, self._object, item)
        octomap = getattr(getattr(message.world, "octomap", None), "octomap", None)
        if len(getattr(octomap, "data", ())):
            why = "octomaps are not taken: send the points to a cloud of the daemon's scene by set_points()"
            self.left_out_fields[OCTOMAP] = why
        self._follow_growths(message)
        if len(message.allowed_collision_matrix.entry_names) or not message.is_diff:
            self._allow(message.allowed_collision_matrix)

    def _follow_growths(self, message: Any) -> None:
        """Leaves out links that MoveIt grows, since the daemon's links stay as they are.

        A whole scene, too, changes only the links that it lists, as in MoveIt.
        """
        for field, (value, true, unit) in GROWTHS.items():
            known = self._growths[field]
            known.update((item.link_name, float(getattr(item, value))) for item in getattr(message, field, ()))
            grown = [f"{link} {number:g}{unit}" for link, number in sorted(known.items()) if not number <= true]
            self.left_out_fields.pop(field, None)
            if grown:
                self.left_out_fields[field] = (
                    f"{', '.join(grown)}: give the links of the daemon's scene a padding, and set MoveIt's to {true:g}"
                )

    def forget(self) -> None:
        """The daemon was restarted, and has none of the objects."""
        self.is_lost = self.is_lost or bool(self._parts)
        self._parts.clear()
        self._held.clear()
        self._allowed.clear()

    def bodies(self) -> set[str]:
        """Names of the objects' bodies, which keep the pose of the last scene, however old."""
        return {name for parts in self._parts.values() for name, _ in parts}

    def _try(self, name: str, apply: Any, item: Any) -> None:
        try:
            apply(item)
        except (clearance.QueryError, clearance.RequestError, ValueError) as error:
            self.left_out[name] = str(error)

    def _object(self, item: Any, parent: Optional[str] = None) -> None:
        operation = _operation(item)
        if operation == REMOVE:
            for name in [item.id] if item.id else [*self._parts, *self.left_out]:  # all objects, if there is no name
                if name not in self._held:  # attached objects are not in the world
                    self._remove(name)
                    self.left_out.pop(name, None)
            return
        if operation not in (ADD, APPEND, MOVE):
            raise ValueError(f"there is no operation {operation}")
        if parent is None:
            self._check_frame(item)
        place = matrix_of(pose_of(item.pose))
        if operation == MOVE:
            return self._move(item, place)
        if item.planes:
            raise ValueError("planes are not supported: put a half_space into the daemon's scene")
        shapes = list(shapes_of(item))
        if not shapes:
            raise ValueError("it has no shape")
        first = len(self._parts.get(item.id, [])) if operation == APPEND else 0
        several = len(shapes) > 1 or operation == APPEND
        names = [f"{item.id}.{first + i}" if several else item.id for i in range(len(shapes))]
        if operation == ADD and item.id in self._parts:
            # The old one stays if the daemon rejects its replacement.
            trial = [f"{name}~" for name in names]
            self._add(trial, shapes, place, parent)
            self._remove_bodies(trial)
        if operation == ADD:
            self._remove(item.id)
        self._add(names, shapes, place, parent)
        self._parts.setdefault(item.id, []).extend((name, within) for name, (_, within) in zip(names, shapes))
        if operation == ADD:
            self.left_out.pop(item.id, None)  # nothing of it is missing, unlike after APPEND and MOVE

    def _check_frame(self, item: Any, link: str = "") -> None:
        """Raises ValueError unless an object's poses are in the world, or (if given) of an attached object."""
        frame = item.header.frame_id
        if self._is_world(frame) if frame else not link:
            return
        expected = f"{link} or " if link else ""
        world = self._frame or "world, or the robot's root link at the world's origin"
        raise ValueError(f"header.frame_id: expected {expected}{world}, got {frame!r}")

    def _is_world(self, frame: str) -> bool:
        """Whether a frame is the world's. MoveIt's planning frame is a parent of the robot, or its root link."""
        if self._frame:
            return frame == self._frame
        bodies = [body.name for body in self._client.bodies]
        for name, state in zip(bodies, self._client.body_states()):
            if self._prefix and name == self._prefix + frame:
                is_root = state.parent is not None and f"{bodies[state.parent]}/" == self._prefix
                is_known = is_root and state.status == clearance.Status.OK
                return is_known and np.array_equal(matrix_of(list(state.pose)), np.eye(4))
        return frame == "world"

    def _add(self, names: list[str], shapes: list[Any], place: np.ndarray, parent: Optional[str]) -> None:
        """Adds a body for each shape, or none if the daemon rejects one."""
        for i, (name, (shape, within)) in enumerate(zip(names, shapes)):
            try:
                self._add_one(name, parent=parent, pose=place @ within, **shape)
            except Exception:
                self._remove_bodies(names[:i])
                raise

    def _add_one(self, name: str, **arguments: Any) -> None:
        """Adds a body. A closed mesh is the solid that it encloses, an open one its triangles.

        Raises for other meshes: the inside of a closed one with a flipped triangle is unknown, and its triangles alone
        leave it free.
        """
        if "mesh" not in arguments:
            self._client.add_body(name, **arguments)
            return
        try:
            self._client.add_body(name, mesh_as="solid", **arguments)
        except (clearance.QueryError, clearance.RequestError) as error:
            if OPEN_MESH not in str(error):
                raise
            self._client.add_body(name, mesh_as="surface", **arguments)

    def _move(self, item: Any, place: np.ndarray) -> None:
        parts = self._parts.get(item.id)
        if not parts:
            raise ValueError("there is no such object to be moved")
        given = [pose_of(pose) for pose in (*item.primitive_poses, *item.mesh_poses)]
        if given and len(given) != len(parts):
            raise ValueError(f"it has {len(parts)} shapes, and comes with poses for {len(given)}")
        moved = [(name, matrix_of(pose)) for (name, _), pose in zip(parts, given)] if given else parts
        self._client.set_poses({name: place @ within for name, within in moved})
        parts[:] = moved

    def _remove(self, name: str) -> None:
        self._held.pop(name, None)
        self._remove_bodies([body for body, _ in self._parts.pop(name, [])])

    def _remove_bodies(self, names: list[str]) -> None:
        for name in reversed(names):
            self._client.remove_body(name)
        self._allowed = {pair for pair in self._allowed if not set(pair) & set(names)}

    def _attached(self, attached: Any) -> None:
        item, link = attached.object, self._prefix + attached.link_name
        operation = _operation(item)
        if operation == REMOVE:
            # An unknown object is not missing; one that was left out still is, in the world.
            given = [item.id] if item.id else list(self._held)
            held = [name for name in given if link in (self._held.get(name), self._prefix)]  # as in MoveIt
            for name in held:  # without a name: all attached to the link, or to any link
                for body, _ in self._parts.get(name, []):
                    self._client.attach(body, None)  # keeps its place in the world
                self._held.pop(name, None)
            return
        if operation not in (ADD, APPEND):
            raise ValueError(f"there is no operation {operation} of attached objects")
        is_given = bool(item.primitives or item.meshes or item.planes)
        if not is_given and item.id not in self._parts:
            if item.id in self.left_out:
                self._held[item.id] = link
            raise ValueError(self.left_out.get(item.id, "it has no shapes, and there is no such object to be attached"))
        if is_given:
            if operation == APPEND and item.id not in self._held:
                self._remove(item.id)
            self._attach_new(item, attached.link_name)
        touched = [self._prefix + name for name in attached.touch_links]
        known = {body.name for body in self._client.bodies}
        for body, _ in self._parts.get(item.id, []):
            self._client.attach(body, link, allow=[name for name in touched if name in known])
        self._held[item.id] = link

    def _attach_new(self, item: Any, link: str) -> None:
        """Adds the shapes of an attached object, whose poses are those in its link or in the world."""
        try:
            if item.header.frame_id == link:
                self._object(item, self._prefix + link)
            else:
                self._check_frame(item, link)
                self._object(item)  # which the link takes with it from here
        finally:
            self._held[item.id] = self._prefix + link

    def _allow(self, matrix: Any) -> None:
        """Pairs that may touch, from now on; those that the daemon's scene lets touch stay allowed."""
        count = len(matrix.entry_names)
        if len(matrix.entry_values) != count or any(len(entry.enabled) != count for entry in matrix.entry_values):
            self.left_out_fields[MATRIX] = f"its {count} names need {count} rows of {count} values"
            return
        self.left_out_fields.pop(MATRIX, None)
        names = {name: self._of(name) for name in matrix.entry_names}
        wanted = set()
        for i, (name, entry) in enumerate(zip(matrix.entry_names, matrix.entry_values)):
            for other, allowed in zip(matrix.entry_names[i + 1 :], entry.enabled[i + 1 :]):
                if allowed:
                    wanted |= {(min(a, b), max(a, b)) for a in names[name] for b in names[other]}
        for a, b in sorted(self._allowed - wanted):
            self._client.forbid(a, b)
            self._allowed.remove((a, b))
        for a, b in sorted(wanted - self._allowed):
            if self._client.allow(a, b).applied:  # else the daemon's scene allows it
                self._allowed.add((a, b))

    def _of(self, name: str) -> list[str]:
        """Bodies for a name of MoveIt: those of an object, or a link."""
        if name in self._parts:
            return [body for body, _ in self._parts[name]]
        known = {body.name for body in self._client.bodies}
        return [each for each in (name, self._prefix + name) if each in known][:1]


def _operation(item: Any) -> int:
    """The value of a byte, which ROS 2 represents as bytes in Python."""
    value = item.operation
    return value[0] if isinstance(value, (bytes, bytearray)) else int(value)
