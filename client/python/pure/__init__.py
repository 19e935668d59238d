"""The client in pure Python: a replacement of the extension module clearance._client, over shared memory and ZeroMQ.

Both share the front (_front/client.py). The structs and options of the C++ headers come from contract.json, which the
build writes.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Sequence
from typing import Any, Optional

import numpy as np

from .answers import Answer, answer_of
from .connection import Connection
from .matrices import poses_of_matrices
from .query import CONTRACT, OPTIONS, Query
from .requests import Session

__all__ = ["OPTIONS", "Answer", "Client", "Pending", "Query", "RemotePlan", "poses_of_matrices", "wire_structs"]

#: Interval at which a waiting call lets other threads use the connection.
_SLICE_S = 0.01


def wire_structs() -> dict[str, list[tuple[str, str]]]:
    """Returns descriptions for numpy dtypes: {"FrameHeader": [("magic", "<u4"), ...], ...}."""
    return {name: [(member, format) for member, format in members] for name, members in CONTRACT["structs"].items()}


class RemotePlan:
    """A plan in the memory of a daemon's GPU."""

    def __init__(self, client: Client, header: Any, columns: list[tuple[int, int, int]]):
        self._client, self._number = client, int(header["plan"])
        self._scene_revision = int(header["scene_revision"])
        names = ("memory_bytes", "poses_offset", "positions_offset", "configurations", "pairs")
        self.info = (
            header["memory_handle"].tobytes(),
            header["device_uuid"].tobytes(),
            *(int(header[name]) for name in names),
            columns,
            self._scene_revision,
            int(header["snapshot_revision"]),
        )

    def run(self, timeout_s: Optional[float], check_scene: bool) -> tuple[int, int]:
        scene = self._scene_revision if check_scene else 0
        return self._client._with(self._client._session.run_plan, self._number, scene, timeout_s)

    def close(self) -> None:
        number, self._number = self._number, 0
        if number:
            self._client._with(self._client._session.close_plan, number)

    def __del__(self) -> None:
        if self._number:
            self._client._discard(-self._number)


class Client:
    """One connection, shared by the client object, its futures and the answers that view its memory."""

    def __init__(
        self,
        urls: Sequence[str],
        timeout_s: float,
        server_key: str,
        key: str,
        hang_s: Optional[float],
        as_planning: bool,
    ):
        self._lock = threading.Lock()
        self._trash: deque[int] = deque()  # abandoned requests
        self._session = Session(Connection(urls, timeout_s, (server_key, key), hang_s), OPTIONS, as_planning)

    def _with(self, call: Any, *args: Any) -> Any:
        # Before the lock, which another thread can have held at the fork; that thread does not exist in the child.
        self._session.connection.check_process()
        with self._lock:
            self._empty_trash()
            return call(*args)

    def _discard(self, request_id: int) -> None:
        """Abandons a request or, for a negative number, closes that plan, now or before the next call.

        Never blocks, since destructors call it.
        """
        self._trash.append(request_id)
        if not self._session.connection.forked() and self._lock.acquire(blocking=False):
            try:
                self._empty_trash()
            finally:
                self._lock.release()

    def _empty_trash(self) -> None:
        while self._trash:
            discarded = self._trash.popleft()
            self._session.connection.forget(discarded if discarded > 0 else self._session.send_close_plan(-discarded))

    @property
    def url(self) -> str:
        return self._session.connection.url

    @property
    def epoch(self) -> int:
        self._session.connection.check_process()
        return self._session.connection.epoch

    def acknowledge_epoch(self) -> int:
        return self._with(self._session.connection.acknowledge_epoch)

    @property
    def timeout_s(self) -> float:
        return self._session.connection.timeout_s

    @timeout_s.setter
    def timeout_s(self, seconds: float) -> None:
        self._session.connection.check_process()
        self._session.connection.timeout_s = seconds

    def submit(self, query: Query, poses: Optional[np.ndarray], positions: Optional[np.ndarray], copy: bool) -> Pending:
        query.check(poses, positions)
        request = self._with(self._session.send_query, query, poses, positions)
        return Pending(self, request, copy, query.beyond_limits(positions))

    def ask(
        self,
        query: Query,
        poses: Optional[np.ndarray],
        positions: Optional[np.ndarray],
        copy: bool,
        timeout_s: float,
    ) -> Optional[Answer]:
        """Returns the answer, or None after the timeout."""
        pending = self.submit(query, poses, positions, copy)
        return pending.answer() if pending.wait(timeout_s) else None

    def ask_rows(self, query: Query, copy: bool, timeout_s: float, *rows: np.ndarray) -> None:
        """Returns None, since this client has no shorter way for arrays that need no conversion."""

    def check_options(self, query: Query) -> None:
        query.check_options()

    def pairs(self, query: Query) -> np.ndarray:
        return self._with(self._session.pairs, query)

    def certificate(
        self,
        query: Query,
        poses: Optional[np.ndarray],
        positions: Optional[np.ndarray],
        rows: Optional[np.ndarray],
    ) -> str:
        query.check(poses, positions)
        return self._with(self._session.certificate, query, poses, positions, rows)

    def plan_on_device(self, query: Query, configurations: int) -> RemotePlan:
        return RemotePlan(self, *self._with(self._session.open_plan, query, configurations))

    def find_path(self, query: Query, *search: Any) -> tuple:
        raise NotImplementedError(
            "plan(): this pure-Python client has no planner; install the wheel clearance-*.whl for it"
        )

    def set_poses(
        self, ids: np.ndarray, poses: np.ndarray, stamp_ns: int, sequence: int, velocities: Optional[np.ndarray]
    ) -> tuple:
        if len(ids) != len(poses):
            raise ValueError("poses: expected one pose for each body")
        return self._with(self._session.set_poses, ids, poses, stamp_ns, sequence, velocities)

    def set_joints(
        self, ids: np.ndarray, positions: np.ndarray, stamp_ns: int, sequence: int, velocities: Optional[np.ndarray]
    ) -> tuple:
        if len(ids) != len(positions):
            raise ValueError("positions: expected one for each joint")
        return self._with(self._session.set_joints, ids, positions, stamp_ns, sequence, velocities)

    def set_points(self, body: int, xyz: np.ndarray, radius: Optional[float], stamp_ns: int, sequence: int) -> tuple:
        return self._with(self._session.set_points, body, xyz, radius, stamp_ns, sequence)

    def joints(self) -> tuple:
        return self._with(self._session.joints)

    def attach(self, child: int, parent: int, pose: Optional[np.ndarray], allow: np.ndarray) -> tuple:
        return self._with(self._session.attach, child, parent, pose, allow)

    def allow(self, a: int, b: int, allow: bool) -> tuple:
        return self._with(self._session.allow, a, b, allow)

    def reload(self, timeout_s: float) -> tuple:
        return self._with(self._session.reload, timeout_s)

    def add_body(
        self,
        name: str,
        shape: str,
        numbers: np.ndarray,
        radius: float,
        parent: int,
        static: bool,
        pose: Optional[np.ndarray],
        uncertainties: tuple[float, float, float, float],
        triangles: np.ndarray,
        mesh_as: int,
        cloud: np.ndarray,
        replaces: bool,
    ) -> tuple:
        mesh = (triangles, mesh_as)
        return self._with(
            self._session.add_body,
            name,
            shape,
            numbers,
            radius,
            parent,
            static,
            pose,
            uncertainties,
            *mesh,
            cloud,
            replaces,
        )

    def remove_body(self, name: str) -> tuple:
        return self._with(self._session.remove_body, name)

    def scene(self, refresh: bool) -> tuple:
        return self._with(self._session.look_at_scene, refresh)

    def body_states(self) -> list[tuple]:
        return self._with(self._session.body_states)

    def stats(self) -> list[tuple[str, int]]:
        return self._with(self._session.stats)

    def ping(self, payload: bytes) -> float:
        return self._with(self._session.ping, payload)


class Pending:
    """A pending request, abandoned by the destructor."""

    def __init__(self, client: Client, request_id: int, copy: bool, beyond_limits: bool):
        self._client, self._request, self._copy, self._beyond_limits = client, request_id, copy, beyond_limits
        self._frame: Any = None
        self._is_over = False

    def wait(self, timeout_s: float) -> bool:
        """Waits for at most `timeout_s`, and returns whether the answer has arrived."""
        deadline = time.monotonic() + timeout_s
        while self._frame is None:
            if self._is_over:
                raise RuntimeError("this request is over")
            now = time.monotonic()
            wait_for = self._client._session.connection.wait_for
            self._frame = self._client._with(wait_for, self._request, min(deadline, now + _SLICE_S))
            if self._frame is None and time.monotonic() >= deadline:
                return False
        return True

    def answer(self) -> Answer:
        """Returns the answer. Call once, after wait() has returned true."""
        self._is_over = True
        session, frame = self._client._session, self._frame
        self._client._with(session.interpret, frame, "REPLY")
        answer = answer_of(frame, self._copy, session.connection.url)
        answer.beyond_limits = self._beyond_limits
        return answer

    def cancel(self) -> None:
        if not self._is_over:
            self._is_over = True
            self._client._discard(self._request)

    def __del__(self) -> None:
        if self._frame is None:
            self.cancel()
