"""The scene of a client's ids, and its changes. The rules are those of the C++ client (client.cpp)."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any, NamedTuple, Optional

import numpy as np

from .. import wire
from .._words import MAX_NAME_BYTES, NONE
from ..wire import ErrorCode, FrameType
from .connection import Connection, rejection
from .exchange import Exchange, text_of
from .frames import malformed, record

_SHAPES = ("vertices", "box", "sphere", "capsule", "cylinder", "half_space", "cone", "ellipsoid", "points")
_BODY_DOUBTS = 20  #: tag of the record of a new body with its uncertainty
_BODY_TRIANGLES = 21  #: tag of a mesh's triangles, whose vertices are the body's
_BODY_MESH_AS = 22  #: tag of the kind of body made from that mesh
_BODY_POINTS = 23  #: tag of a cloud's points
_BODY_REPLACE = 24  #: tag of a shape that replaces that of a body


class Scene(NamedTuple):
    """Description of the daemon's scene."""

    revision: int
    backend: str
    pair_count: int
    bodies: list[tuple]  #: name, parent and the further members of BodyInfo
    groups: list[tuple[str, list[int]]]


class SceneRequests(Exchange):
    """Requests for the scene and its changes."""

    def __init__(self, connection: Connection, options: dict[str, Any], as_planning: bool):
        super().__init__(connection, options, as_planning)
        self._scene: Optional[Scene] = None  # the scene that the caller has read
        self._changed_by_us = False  # whether this client has since made a change that can alter ids
        self._known_revision = 0  # revision of the scene of the caller's ids, or 0
        self._poses_revision = 0  # last known revision in which these ids have the same bodies and parents

    def check_scene(self, revision: int) -> None:
        """Raises QueryError unless the client's scene has that revision; 0 accepts any."""
        now = self.look_at_scene(False).revision if revision else 0
        if now != revision:
            text = f"the scene is revision {now}, the query is for {revision}"
            raise rejection(ErrorCode.WRONG_SCENE, text)

    def look_at_scene(self, refresh: bool) -> Scene:
        """Returns the scene to which the caller's ids refer from now on."""
        if refresh or self._scene is None or self._scene_is_old:
            self._scene = self._fetch_scene()
            self._scene_is_old = self._changed_by_us = False
            self._known_revision = self._poses_revision = self._scene.revision
        return self._scene

    def _fetch_scene(self) -> Scene:
        frame = self._call(FrameType.DESCRIBE, [], "SCENE")
        head = self._records(frame, 0, "SceneHeader", 1)[0]
        counts = [int(head[name]) for name in ("body_count", "group_count", "member_count")]
        at = head.nbytes
        bodies = self._records(frame, at, "BodyRecord", counts[0])
        groups = self._records(frame, at + bodies.nbytes, "GroupRecord", counts[1])
        start = at + bodies.nbytes + groups.nbytes
        if len(frame.payload) != start + 4 * counts[2]:
            raise malformed(self.connection.url, "a scene whose size does not match its counts")
        members = np.frombuffer(frame.payload, np.uint32, counts[2], start).tolist() if counts[2] else []
        infos = [
            (text_of(b["name"]), int(b["parent"]), bool(b["is_static"]), int(b["piece_count"]), int(b["vertex_count"]))
            + tuple(float(b[name]) for name in ("model_error", "extent", "hull_excess", "empty_share"))
            + (int(b["triangle_count"]), bool(b["is_solid"]), bool(b["is_cloud"]))
            for b in bodies
        ]
        lists = []
        for group in groups:
            first, count = int(group["first_member"]), int(group["member_count"])
            if first + count > len(members):
                raise malformed(self.connection.url, "a group's members go past the end of the list")
            lists.append((text_of(group["name"]), members[first : first + count]))
        return Scene(int(head["scene_revision"]), text_of(head["backend"]), int(head["pair_count"]), infos, lists)

    def _revision_of_ids(self) -> int:
        """Returns the revision of the scene of the caller's ids, or 0.

        After a change by another client, requests are rejected (WRONG_SCENE) until the caller reads the scene again,
        since ids can refer to other bodies. After a change by this client, they are accepted if ids are unchanged.
        """
        if self._known_revision and self._changed_by_us:
            self._changed_by_us = False
            now = self._fetch_scene()
            if self._ids_mean_the_same(now, parents=False):
                self._known_revision = self._poses_revision = now.revision
        return self._known_revision

    def _ids_mean_the_same(self, now: Scene, parents: bool) -> bool:
        """Whether the ids common to both scenes have the same names and, with `parents`, the same parents."""
        assert self._scene is not None
        bodies = zip(self._scene.bodies, now.bodies)
        groups = zip(self._scene.groups, now.groups)
        members = 2 if parents else 1
        return all(a[:members] == b[:members] for a, b in bodies) and all(a[0] == b[0] for a, b in groups)

    def _change_scene(
        self, type: FrameType, parts: Sequence[Any], limit_s: float, scene_revision: int = 0, records: bytes = b""
    ) -> tuple:
        frame = self._receive(self._send(type, parts, scene_revision, records), "SCENE_CHANGED", limit_s)
        self._scene_is_old = self._changed_by_us = True
        change = self._whole(frame, "SceneChange")
        return (
            int(change["scene_revision"]),
            int(change["body_count"]),
            int(change["body"]),
            float(change["seconds"]),
        )

    def reload(self, timeout_s: float) -> tuple:
        return self._change_scene(FrameType.RELOAD, [], timeout_s)

    def add_body(
        self,
        name: str,
        shape: str,
        numbers: np.ndarray,
        radius: float,
        parent: int,
        is_static: bool,
        pose: Optional[np.ndarray],
        uncertainties: tuple[float, float, float, float],
        triangles: np.ndarray,
        mesh_as: int,
        cloud: np.ndarray,
        replaces: bool,
    ) -> tuple:
        """Adds a body, or replaces the shape and radius of one. shape: "mesh", or one of _SHAPES.

        numbers: vertices (V, 3), or sizes (1, 3). uncertainties: of position and angle, padding, max_speed.
        triangles: (T, 3) uint32 of a mesh, otherwise empty. cloud: (N, 3) float32 points, otherwise empty.
        """
        is_hull = shape in ("vertices", "mesh")
        body = np.zeros((), wire._wire.NewBodyRecord)
        kind = 0 if is_hull else _SHAPES.index(shape)
        body["name"], body["parent"], body["shape"] = _name_bytes(name), parent, kind
        body["is_static"], body["has_pose"], body["radius"] = is_static, pose is not None, radius
        if pose is not None:
            body["pose"] = pose[0]
        if is_hull:
            body["vertex_count"] = len(numbers)
        else:
            body["size"] = numbers[0]
        revision = 0 if parent == NONE else self._revision_of_ids()
        parts = [body, numbers] if is_hull else [body]
        records = record(_BODY_DOUBTS, struct.pack("<4d", *uncertainties)) if any(uncertainties) else b""
        if len(triangles):
            records += record(_BODY_TRIANGLES, triangles.astype("<u4").tobytes())
            records += record(_BODY_MESH_AS, struct.pack("<B", mesh_as))
        if shape == "points":
            records += record(_BODY_POINTS, cloud.astype("<f4").tobytes())
        if replaces:
            records += record(_BODY_REPLACE, b"")
        return self._change_scene(FrameType.ADD_BODY, parts, self.connection.timeout_s, revision, records)

    def remove_body(self, name: str) -> tuple:
        body = np.zeros((), wire._wire.RemoveBodyRecord)
        body["name"] = _name_bytes(name)
        return self._change_scene(FrameType.REMOVE_BODY, [body], self.connection.timeout_s)


def _name_bytes(name: str) -> bytes:
    encoded = name.encode()
    if len(encoded) > MAX_NAME_BYTES:
        raise ValueError(f"name: expected at most {MAX_NAME_BYTES} bytes, got {len(encoded)}")
    return encoded
