"""Updates of poses, joints, points and attachments, and the daemon's state."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any, Optional

import numpy as np

from .. import wire
from .._errors import ConnectionError, QueryError
from ..wire import ErrorCode, FrameType, UpdateRecord
from .exchange import text_of
from .frames import Frame, malformed, record
from .scenes import SceneRequests

_ATTACH_ALLOW = 1  #: tag of the record of an attachment with the bodies that the child may touch


def _velocity_records(velocities: Optional[np.ndarray]) -> bytes:
    if velocities is None:
        return b""
    return record(UpdateRecord.VELOCITIES, np.ascontiguousarray(velocities, "<f8").tobytes())


class UpdateRequests(SceneRequests):
    """Requests that change or read the daemon's state."""

    def set_poses(
        self, ids: np.ndarray, poses: np.ndarray, stamp_ns: int, sequence: int, velocities: Optional[np.ndarray]
    ) -> tuple:
        head = np.zeros((), wire._wire.PosesHeader)
        head["count"], head["stamp_ns"], head["sequence"] = len(ids), stamp_ns, sequence
        rows = np.zeros(len(ids), wire._wire.PoseRecord)
        rows["body"], rows["pose"] = ids, poses
        records = _velocity_records(velocities)
        self._revision_of_ids()
        try:
            return self._ask_poses([head, rows], self._poses_revision, records)
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
            return self._ask_poses([head, rows], now.revision, records)

    def _ask_poses(self, parts: Sequence[Any], revision: int, records: bytes) -> tuple:
        return self._poses_done(self._receive(self._send(FrameType.SET_POSES, parts, revision, records), "POSES_DONE"))

    def _poses_done(self, frame: Frame) -> tuple:
        done = self._whole(frame, "PosesResult")
        return tuple(int(done[n]) for n in ("revision", "scene_revision", "applied", "bad", "unknown", "fixed"))

    def set_joints(
        self, ids: np.ndarray, positions: np.ndarray, stamp_ns: int, sequence: int, velocities: Optional[np.ndarray]
    ) -> tuple:
        head = np.zeros((), wire._wire.PosesHeader)
        head["count"], head["stamp_ns"], head["sequence"] = len(ids), stamp_ns, sequence
        rows = np.zeros(len(ids), wire._wire.JointRecord)
        rows["joint"], rows["position"] = ids, positions
        records = _velocity_records(velocities)
        request = self._send(FrameType.SET_JOINTS, [head, rows], self._revision_of_ids(), records)
        return self._poses_done(self._receive(request, "POSES_DONE"))

    def set_points(self, body: int, xyz: np.ndarray, radius: Optional[float], stamp_ns: int, sequence: int) -> tuple:
        head = np.zeros((), wire._wire.PointsHeader)
        head["count"], head["stamp_ns"], head["sequence"], head["body"] = len(xyz), stamp_ns, sequence, body
        if radius is not None:
            head["radius"], head["has_radius"] = radius, 1
        return self._poses_done(self._call(FrameType.SET_POINTS, [head, xyz], "POSES_DONE", self._revision_of_ids()))

    def attach(self, child: int, parent: int, pose: Optional[np.ndarray], allow: np.ndarray) -> tuple:
        if pose is not None and len(pose) != 1:
            raise ValueError("pose: expected one pose")
        body = np.zeros((), wire._wire.AttachRecord)
        body["child"], body["parent"], body["has_pose"] = child, parent, pose is not None
        if pose is not None:
            body["pose"] = pose[0]
        records = record(_ATTACH_ALLOW, allow.astype("<u4").tobytes()) if len(allow) else b""
        return self._change_pairs(FrameType.ATTACH, body, records)

    def allow(self, a: int, b: int, allow: bool) -> tuple:
        pairs = np.zeros((), wire._wire.AllowRecord)
        pairs["a"], pairs["b"], pairs["allow"] = a, b, allow
        return self._change_pairs(FrameType.ALLOW, pairs, b"")

    def _change_pairs(self, type: FrameType, body: np.ndarray, records: bytes) -> tuple:
        revision = self._revision_of_ids()
        frame = self._receive(self._send(type, [body], revision, records), "POSES_DONE")
        self._scene_is_old = True
        done = self._poses_done(frame)
        if revision:
            self._known_revision = self._poses_revision = done[1]  # ids are unchanged
        return done

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
            (text_of(r["name"]), float(r["lower"]), float(r["upper"]), float(r["position"]), int(r["status"]))
            + (bool(r["beyond_limits"]), int(r["stamp_ns"]), now - int(r["receipt_ns"]) if r["receipt_ns"] else -1)
            for r in rows
        ]
        first = [int(g["first_member"]) for g in groups]
        lists = [(text_of(g["name"]), members[f : f + int(g["member_count"])]) for f, g in zip(first, groups)]
        return joints, lists

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
        return [(text_of(row["name"]), int(row["value"])) for row in self._records(frame, 0, "CounterRecord")]

    def ping(self, payload: bytes) -> float:
        start = time.monotonic()
        frame = self._call(FrameType.PING, [payload], "PONG")
        took = time.monotonic() - start
        if frame.payload != payload:
            raise ConnectionError(f"{self.connection.url}: the echo differs from the request")
        return took
