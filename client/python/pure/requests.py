"""Requests of a client as frames, and the scene of its ids. The rules are those of the C++ client (client.cpp)."""

from __future__ import annotations

import struct
import time
from collections.abc import Sequence
from typing import Any, NamedTuple, Optional

import numpy as np

from .. import wire
from .._errors import ConnectionError, NewEpoch, QueryError, TimeoutError
from .._words import COLUMNS, GROUP_BIT, MAX_NAME_BYTES, NONE, Field, Reduce
from ..wire import MAX_FRAME_BYTES, MAX_REQUEST_BYTES, ErrorCode, FrameType, QueryRecord
from .answers import column_shape
from .connection import Connection, parse_error, rejection
from .frames import Frame, header_bytes, malformed, name_of_type, record

_SHAPES = ("vertices", "box", "sphere", "capsule", "cylinder", "half_space", "cone", "ellipsoid", "points")
#: struct format of an option in a record, by kind and size in bytes.
_OPTION_FORMATS = {
    ("bool", 1): "<B", ("word", 1): "<B", ("number", 8): "<d", ("integer", 8): "<q", ("count", 8): "<Q",
    ("count", 4): "<I",
}  # fmt: skip


#: Array records of a query, in the order of their tags, which are above those of options.
_ARRAY_TAGS = {record.name.lower(): record for record in QueryRecord if record != QueryRecord.ROWS}
_ATTACH_ALLOW = 1  #: tag of the record of an attachment with the bodies that the child may touch
_BODY_DOUBTS = 20  #: tag of the record of a new body with its uncertainty
_BODY_TRIANGLES = 21  #: tag of a mesh's triangles, whose vertices are the body's
_BODY_MESH_AS = 22  #: tag of the kind of body made from that mesh
_BODY_POINTS = 23  #: tag of a cloud's points
_BODY_REPLACE = 24  #: tag of a shape that replaces that of a body


#: Upper bound on the size of a reply about a plan.
_PLAN_BYTES = 1024


def _plan_record(number: int) -> bytes:
    return struct.pack("<QQ", number, 0)


class Scene(NamedTuple):
    """Description of the daemon's scene."""

    revision: int
    backend: str
    pair_count: int
    bodies: list[tuple]  #: name, parent and the further members of BodyInfo
    groups: list[tuple[str, list[int]]]


class Session:
    """Requests of one client. Not thread-safe."""

    def __init__(self, connection: Connection, options: dict[str, Any], as_planning: bool):
        self.connection = connection
        self._flags = int(as_planning)  # FrameFlag bits of requests
        self._options = options
        self._scene: Optional[Scene] = None  # the scene that the caller has read
        self._scene_is_old = False  # reported by the daemon; the caller's next read fetches the scene again
        self._changed_by_us = False  # whether this client has since made a change that can alter ids
        self._known_revision = 0  # revision of the scene of the caller's ids, or 0
        self._poses_revision = 0  # last known revision in which these ids have the same bodies and parents
        self._sent_in_records: dict[int, str] = {}  # names of options sent in records, by pending request

    # ---- frames ---------------------------------------------------------------------------------------------------

    def _send(
        self,
        type: int,
        parts: Sequence[Any],
        scene_revision: int = 0,
        records: bytes = b"",
        reply_bytes: int = 0,
    ) -> int:
        """Sends a frame and returns its request id."""
        epoch = self.connection.prepare()
        records += epoch
        parts = [np.ascontiguousarray(part) if isinstance(part, np.ndarray) else part for part in parts]
        size = sum(memoryview(part).nbytes for part in parts) + len(records)
        if size + 64 > MAX_REQUEST_BYTES:
            raise QueryError(
                int(ErrorCode.TOO_LARGE),
                f"a request of {size + 64} bytes is more than the {MAX_REQUEST_BYTES} allowed: split it",
            )
        request_id = self.connection.next_request_id()
        header = header_bytes(type, request_id, size, scene_revision, len(records), self._flags)
        bodies = [part.tobytes() if isinstance(part, np.ndarray) else part for part in parts]
        self.connection.send(header, [*bodies, records], reply_bytes)
        return request_id

    def forget(self, request_id: int) -> None:
        self._sent_in_records.pop(request_id, None)
        self.connection.forget(request_id)

    def interpret(self, frame: Frame, type: str) -> Frame:
        """Returns the frame if it has that type; raises the error of an error frame."""
        sent = self._sent_in_records.pop(frame.request_id, "")
        url = self.connection.url
        if frame.type == FrameType.ERROR:
            code, text = parse_error(frame, url)
            if code == ErrorCode.WRONG_SCENE:
                self._scene_is_old = True
            if code == ErrorCode.NEW_EPOCH:
                raise NewEpoch(code, f"{url}: {text}")
            if sent and code == ErrorCode.NOT_SUPPORTED:
                text += f"; the daemon is too old for one of: {sent}"
            raise rejection(code, text)
        if frame.type != FrameType[type]:
            raise ConnectionError(
                f"{url}: the daemon answered with {name_of_type(frame.type)}, expected {name_of_type(FrameType[type])}"
            )
        return frame

    def _receive(self, request_id: int, type: str, limit_s: Optional[float] = None) -> Frame:
        limit_s = self.connection.timeout_s if limit_s is None else limit_s
        frame = self.connection.wait_for(request_id, time.monotonic() + limit_s)
        if frame is None:
            self.forget(request_id)
            kind = name_of_type(FrameType[type])
            raise TimeoutError(f"{self.connection.url}: no {kind} within {limit_s:g} s")
        return self.interpret(frame, type)

    def _call(self, request: FrameType, parts: Sequence[Any], reply: str, scene_revision: int = 0) -> Frame:
        return self._receive(self._send(request, parts, scene_revision), reply)

    def _records(self, frame: Frame, at: int, struct_name: str, count: Optional[int] = None) -> np.ndarray:
        """Returns `count` structs at an offset of the payload, by default all of them."""
        dtype = wire._wire.RECORDS[struct_name]
        left = len(frame.payload) - at
        count = left // dtype.itemsize if count is None else count
        if count * dtype.itemsize > left:
            raise malformed(self.connection.url, f"{count} of {struct_name} do not fit into {left} bytes")
        return np.frombuffer(frame.payload, dtype, count, at) if count else np.zeros(0, dtype)

    def _whole(self, frame: Frame, struct_name: str) -> Any:
        records = self._records(frame, 0, struct_name, 1)
        if records.nbytes != len(frame.payload):
            raise malformed(self.connection.url, f"{len(frame.payload)} bytes are no {struct_name}")
        return records[0]

    # ---- queries --------------------------------------------------------------------------------------------------

    def send_query(
        self,
        query: Any,
        type: FrameType = FrameType.QUERY,
        rows: Optional[np.ndarray] = None,
        plan: Optional[int] = None,
    ) -> int:
        """Sends a query. plan: number of configurations of OPEN_PLAN."""
        requested = query.__dict__
        is_query, has_configurations = type == FrameType.QUERY, type not in (FrameType.PAIRS, FrameType.OPEN_PLAN)
        revision = self._revision_of_ids()
        pairs, bodies, poses = query.pairs, query.bodies, query.configurations
        configurations = poses if poses is not None else query.positions
        header = wire.query_header(
            pair_count=0 if pairs is None else len(pairs),
            body_count=0 if bodies is None else len(bodies),
            configuration_count=plan if plan is not None else 0 if configurations is None else len(configurations),
            all_pairs=pairs is None,
            **{name: requested[name] for name, row in self._options.items() if not row[0]},
        )
        if not requested["min_pose_stamp_ns"]:  # a query without a stamp can still have a maximum wait
            header["pose_wait_ns"] = 0
        parts = [header]
        if pairs is not None:
            parts.append(pairs)
        if bodies is not None:
            parts.append(np.concatenate([bodies, np.zeros(len(bodies) % 2, np.uint32)]))
        if has_configurations and poses is not None:
            parts.append(poses)
        later = {n: r for n, r in self._options.items() if r[0] and requested[n] != r[2]}
        tagged = {r[0]: struct.pack(_OPTION_FORMATS[r[1], r[6]], requested[name]) for name, r in later.items()}
        arrays = {name: requested[name] for name in _ARRAY_TAGS if requested[name] is not None and len(requested[name])}
        if not has_configurations:
            arrays.pop("positions", None)
        tagged.update((_ARRAY_TAGS[name], np.ascontiguousarray(array).tobytes()) for name, array in arrays.items())
        if rows is not None:
            tagged[QueryRecord.ROWS] = np.ascontiguousarray(rows, np.uint64).tobytes()
        records = b"".join(record(tag, tagged[tag]) for tag in sorted(tagged))
        joints = 0 if query.joints is None else len(query.joints)
        expected = self._expected_reply_bytes(header, pairs, joints) if is_query else 0
        if plan is not None:
            expected = _PLAN_BYTES
        request_id = self._send(type, parts, revision, records, expected)
        if later or arrays:
            self._sent_in_records[request_id] = ", ".join([*later, *(name for name in arrays if name != "positions")])
        return request_id

    def pairs(self, query: Any) -> np.ndarray:
        frame = self._receive(self.send_query(query, FrameType.PAIRS), "PAIR_TABLE")
        count = int(self._records(frame, 0, "PairsHeader", 1)[0]["count"])
        if len(frame.payload) != 16 + 8 * count:
            raise malformed(self.connection.url, f"{count} pairs in {len(frame.payload)} bytes")
        return np.frombuffer(frame.payload, np.uint32, 2 * count, 16).reshape(-1, 2).copy() if count else _NO_PAIRS

    def open_plan(self, query: Any, configurations: int) -> tuple[Any, list[tuple[int, int, int]]]:
        """Opens a plan. Returns its PlanHeader, and its columns as [(field, bytes per row, offset)]."""
        frame = self._receive(self.send_query(query, FrameType.OPEN_PLAN, None, configurations), "PLAN")
        header = self._records(frame, 0, "PlanHeader", 1)[0]
        columns = self._records(frame, header.nbytes, "PlanColumnRecord")
        inside = all(
            int(c["offset"]) + int(header["rows"]) * int(c["row_bytes"]) <= int(header["memory_bytes"]) for c in columns
        )
        if len(columns) != header["column_count"] or not inside:
            raise malformed(self.connection.url, "a plan whose columns do not lie in its memory")
        return header, [(int(c["field"]), int(c["row_bytes"]), int(c["offset"])) for c in columns]

    def run_plan(self, number: int, scene_revision: int, timeout_s: Optional[float]) -> tuple[int, int]:
        request = self._send(FrameType.RUN_PLAN, [_plan_record(number)], scene_revision, b"", _PLAN_BYTES)
        done = self._whole(self._receive(request, "PLAN_DONE", timeout_s), "PlanResult")
        return int(done["snapshot_revision"]), int(done["took_ns"])

    def send_close_plan(self, number: int) -> int:
        return self._send(FrameType.CLOSE_PLAN, [_plan_record(number)], 0, b"", _PLAN_BYTES)

    def close_plan(self, number: int) -> None:
        self._receive(self.send_close_plan(number), "PLAN_DONE")

    def certificate(self, query: Any, rows: Optional[np.ndarray]) -> str:
        """Returns the document of a certificate. rows: (R,) row numbers, by default all."""
        frame = self._receive(self.send_query(query, FrameType.CERTIFY, rows), "CERTIFICATE")
        try:
            return bytes(frame.payload).decode()
        except UnicodeDecodeError as error:
            raise malformed(self.connection.url, f"the certificate is not UTF-8: {error}") from None

    def _expected_reply_bytes(self, q: np.ndarray, pairs: Optional[np.ndarray], joints: int) -> int:
        """Estimates the size of the reply in bytes; 0 leaves the size to the daemon."""
        rows = max(int(q["configuration_count"]), 1)
        reduce, scene = int(q["reduce"]), self._scene
        if reduce not in (Reduce.MIN, Reduce.ANY):
            selects = pairs is not None and bool((pairs & GROUP_BIT).any())
            if scene is None and (pairs is None or selects or reduce == Reduce.NEAREST):
                return 0
            if reduce == Reduce.NEAREST:
                rows *= len(scene.bodies) if scene else 0
            elif pairs is not None and not selects:
                rows *= len(pairs)
            else:
                rows *= (scene.pair_count if scene else 0) * (len(pairs) if pairs is not None else 1)
            if reduce == Reduce.WITHIN:
                rows = min(rows, int(q["max_results"]))
        fields = int(q["fields"])
        if reduce != Reduce.NONE:
            fields |= Field.PAIR | Field.CONFIGURATION
        size = 64 + wire._wire.ReplyHeader.itemsize + 2 * 16  # records with the epoch and the number of joints
        for name, column in COLUMNS.items():
            if fields >> column.bit & 1:
                each = int(np.prod(column_shape(name, joints), dtype=int))
                size += -(-rows * column.dtype.itemsize * each // 64) * 64
        return size if size <= MAX_FRAME_BYTES else 0

    # ---- scene ----------------------------------------------------------------------------------------------------

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
            (_text(b["name"]), int(b["parent"]), bool(b["is_static"]), int(b["piece_count"]), int(b["vertex_count"]))
            + tuple(float(b[name]) for name in ("model_error", "extent", "hull_excess", "empty_share"))
            + (int(b["triangle_count"]), bool(b["is_solid"]), bool(b["is_cloud"]))
            for b in bodies
        ]
        lists = []
        for group in groups:
            first, count = int(group["first_member"]), int(group["member_count"])
            if first + count > len(members):
                raise malformed(self.connection.url, "a group's members go past the end of the list")
            lists.append((_text(group["name"]), members[first : first + count]))
        return Scene(int(head["scene_revision"]), _text(head["backend"]), int(head["pair_count"]), infos, lists)

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
        request_id = self._send(type, parts, scene_revision, records)
        if records:
            self._sent_in_records[request_id] = "add_body: uncertainty, padding, max_speed, mesh, replace"
        frame = self._receive(request_id, "SCENE_CHANGED", limit_s)
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
        doubts: tuple[float, float, float, float],
        triangles: np.ndarray,
        mesh_as: int,
        cloud: np.ndarray,
        replaces: bool,
    ) -> tuple:
        """Adds a body, or replaces the shape and radius of one. shape: "mesh", or one of _SHAPES.

        numbers: vertices (V, 3), or sizes (1, 3). doubts: uncertainty of position and angle, padding, max_speed.
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
        records = record(_BODY_DOUBTS, struct.pack("<4d", *doubts)) if any(doubts) else b""
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

    # ---- poses ----------------------------------------------------------------------------------------------------

    def set_poses(self, ids: np.ndarray, poses: np.ndarray, stamp_ns: int, sequence: int) -> tuple:
        head = np.zeros((), wire._wire.PosesHeader)
        head["count"], head["stamp_ns"], head["sequence"] = len(ids), stamp_ns, sequence
        rows = np.zeros(len(ids), wire._wire.PoseRecord)
        rows["body"], rows["pose"] = ids, poses
        self._revision_of_ids()
        try:
            return self._ask_poses([head, rows], self._poses_revision)
        except QueryError as error:
            if error.code != ErrorCode.WRONG_SCENE or self._scene is None:
                raise
            # The scene changed, for example by an attachment. If the ids still have the same bodies and parents, the
            # poses keep their meaning, and the update is sent again. Queries still refer to the old scene, since the
            # caller has not read the new one.
            now = self._fetch_scene()
            known = self._scene.bodies
            for body in ids.tolist():
                if body < len(known) and (body >= len(now.bodies) or now.bodies[body][:2] != known[body][:2]):
                    raise
            if self._ids_mean_the_same(now, parents=True):
                self._poses_revision = now.revision  # the next update's, too
            return self._ask_poses([head, rows], now.revision)

    def _ask_poses(self, parts: Sequence[Any], revision: int) -> tuple:
        return self._poses_done(self._call(FrameType.SET_POSES, parts, "POSES_DONE", revision))

    def _poses_done(self, frame: Frame) -> tuple:
        done = self._whole(frame, "PosesResult")
        return tuple(int(done[n]) for n in ("revision", "scene_revision", "applied", "bad", "unknown", "fixed"))

    def set_joints(self, ids: np.ndarray, positions: np.ndarray, stamp_ns: int, sequence: int) -> tuple:
        head = np.zeros((), wire._wire.PosesHeader)
        head["count"], head["stamp_ns"], head["sequence"] = len(ids), stamp_ns, sequence
        rows = np.zeros(len(ids), wire._wire.JointRecord)
        rows["joint"], rows["position"] = ids, positions
        return self._poses_done(self._call(FrameType.SET_JOINTS, [head, rows], "POSES_DONE", self._revision_of_ids()))

    def set_points(self, body: int, xyz: np.ndarray, radius: Optional[float], stamp_ns: int, sequence: int) -> tuple:
        head = np.zeros((), wire._wire.PointsHeader)
        head["count"], head["stamp_ns"], head["sequence"], head["body"] = len(xyz), stamp_ns, sequence, body
        if radius is not None:
            head["radius"], head["has_radius"] = radius, 1
        return self._poses_done(self._call(FrameType.SET_POINTS, [head, xyz], "POSES_DONE", self._revision_of_ids()))

    def joints(self) -> tuple:
        """Returns joints as in _joints.py, and groups."""
        revision = self.look_at_scene(False).revision
        frame = self._call(FrameType.GET_JOINTS, [], "JOINTS")
        head = self._records(frame, 0, "JointsHeader", 1)[0]
        self._scene_is_old |= int(head["scene_revision"]) != revision
        at = head.nbytes
        rows = self._records(frame, at, "JointStateRecord", int(head["joint_count"]))
        groups = self._records(frame, at + rows.nbytes, "GroupRecord", int(head["group_count"]))
        start, count = at + rows.nbytes + groups.nbytes, int(head["member_count"])
        if len(frame.payload) != start + 4 * count:
            raise malformed(self.connection.url, "joints whose size does not match their counts")
        members = np.frombuffer(frame.payload, np.uint32, count, start).tolist() if count else []
        now = int(head["now_ns"])
        joints = [
            (_text(r["name"]), float(r["lower"]), float(r["upper"]), float(r["position"]), int(r["status"]))
            + (bool(r["beyond_limits"]), int(r["stamp_ns"]), now - int(r["receipt_ns"]) if r["receipt_ns"] else -1)
            for r in rows
        ]
        first = [int(g["first_member"]) for g in groups]
        lists = [(_text(g["name"]), members[f : f + int(g["member_count"])]) for f, g in zip(first, groups)]
        return joints, lists

    def attach(self, child: int, parent: int, pose: Optional[np.ndarray], allow: np.ndarray) -> tuple:
        if pose is not None and len(pose) != 1:
            raise ValueError("pose: expected one pose")
        body = np.zeros((), wire._wire.AttachRecord)
        body["child"], body["parent"], body["has_pose"] = child, parent, pose is not None
        if pose is not None:
            body["pose"] = pose[0]
        records = record(_ATTACH_ALLOW, allow.astype("<u4").tobytes()) if len(allow) else b""
        return self._change_pairs(FrameType.ATTACH, body, records, "attach: allow")

    def allow(self, a: int, b: int, allow: bool) -> tuple:
        pairs = np.zeros((), wire._wire.AllowRecord)
        pairs["a"], pairs["b"], pairs["allow"] = a, b, allow
        return self._change_pairs(FrameType.ALLOW, pairs, b"", "")

    def _change_pairs(self, type: FrameType, body: np.ndarray, records: bytes, later: str) -> tuple:
        revision = self._revision_of_ids()
        request_id = self._send(type, [body], revision, records)
        if records:
            self._sent_in_records[request_id] = later
        frame = self._receive(request_id, "POSES_DONE")
        self._scene_is_old = True
        done = self._poses_done(frame)
        if revision:
            self._known_revision = self._poses_revision = done[1]  # ids are unchanged
        return done

    # ---- state of the daemon --------------------------------------------------------------------------------------

    def body_states(self) -> list[tuple]:
        frame = self._call(FrameType.GET_STATES, [], "BODY_STATES")
        head = self._records(frame, 0, "StatesHeader", 1)[0]
        now = int(head["now_ns"])
        states = self._records(frame, head.nbytes, "BodyStateRecord", int(head["count"]))
        return [
            (
                tuple(s["pose"].tolist()),
                int(s["status"]),
                int(s["parent"]),
                int(s["stamp_ns"]),
                now - int(s["receipt_ns"]) if s["receipt_ns"] else -1,
            )
            for s in states
        ]

    def stats(self) -> list[tuple[str, int]]:
        frame = self._call(FrameType.GET_STATS, [], "STATS")
        return [(_text(row["name"]), int(row["value"])) for row in self._records(frame, 0, "CounterRecord")]

    def ping(self, payload: bytes) -> float:
        start = time.monotonic()
        frame = self._call(FrameType.PING, [payload], "PONG")
        took = time.monotonic() - start
        if frame.payload != payload:
            raise ConnectionError(f"{self.connection.url}: the echo differs from the request")
        return took


_NO_PAIRS = np.zeros((0, 2), np.uint32)


def _text(name: Any) -> str:
    return bytes(name).split(b"\0")[0].decode(errors="replace")


def _name_bytes(name: str) -> bytes:
    encoded = name.encode()
    if len(encoded) > MAX_NAME_BYTES:
        raise ValueError(f"name: expected at most {MAX_NAME_BYTES} bytes, got {len(encoded)}")
    return encoded
