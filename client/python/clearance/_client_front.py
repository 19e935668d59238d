"""A client of the daemon."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from typing import Any, Optional, Union

import numpy as np

from . import _client
from ._arguments import (
    ShapeArgument,
    to_count,
    to_number,
    to_number_from_0,
    to_path,
    to_text,
    to_word,
)
from ._errors import ConnectionError, QueryError, TimeoutError
from ._front import BodyState, Front
from ._future import Future, Task, Worker
from ._names import BodyInfo, BodyRef, NameTable
from ._query import Query, Run
from ._remote_plan import RemotePlan
from ._scene_changes import NewBody, SceneChanged
from ._updates import UpdateResult
from ._words import (
    DEFAULT_FIELDS,
    DEFAULT_POINTS_ROWS,
    EVERY_BODY,
    FIELD_MASKS,
    NONE,
    SERVICE_CLASSES,
    Reduce,
    ServiceWord,
    Status,
)
from .wire import ErrorCode


def connect(
    url: Union[str, Sequence[str]],
    timeout_s: float = 5.0,
    *,
    server_key: Union[str, os.PathLike[str], None] = None,
    key: Union[str, os.PathLike[str], None] = None,
    hang_s: Optional[float] = None,
    service_class: ServiceWord = "control",
) -> Client:
    """Connects to a daemon.

    url: "shm:///run/user/1000/clearance.sock" (shared memory, the fastest), "ipc:///path" or "tcp://host:port"
        (ZeroMQ), "udpm://239.255.76.67:7667?ttl=0" (LCM; "&prefix=NAME_" sets the channels' prefix). With several, the
        client uses the first that responds and moves to the next when a daemon is gone or hung, cyclically. The next
        daemon has none of the client's state (NewEpoch).
    timeout_s: default timeout of this client's calls in seconds, this one included.
    server_key, key: for a daemon that listens on TCP with keys: the files of its public key and of your own key pair,
        as written by `clearance keygen`. Default: those of the url ("?server_key=FILE&key=FILE"), then of the
        environment (CLEARANCE_SERVER_KEY, CLEARANCE_KEY), otherwise no keys.
    hang_s: seconds that the daemon's loop may stand still during a request, 0.01 or more; then calls raise DaemonHung,
        at most a quarter later. 0 disables this test. Default: 1 s, or a fifth of timeout_s if that is more.
    service_class: "control", or "planning": the daemon answers clients of the class "control" first. A client's class
        is also limited by the daemon's rights (docs/security.md).

    Raises ConnectionError naming url and cause, over LCM also if several daemons respond; ValueError for a url of an
    unknown kind.
    """
    return Client(url, timeout_s, server_key=server_key, key=key, hang_s=hang_s, service_class=service_class)


class Client(Front):
    """A connection to the daemon, with the methods of clearance.Engine.

    Thread-safe, but runs one call at a time; a client for each thread is faster. A forked child cannot use it
    (ConnectionError) and must connect again. Also a context manager that closes the connection.
    """

    _module = _client
    _instead = "send its url, and connect in each process"
    _prepared_only = frozenset(("copy",))
    _is_remote = True

    def __init__(
        self,
        url: Union[str, Sequence[str]],
        timeout_s: float = 5.0,
        *,
        server_key: Union[str, os.PathLike[str], None] = None,
        key: Union[str, os.PathLike[str], None] = None,
        hang_s: Optional[float] = None,
        service_class: ServiceWord = "control",
    ):
        super().__init__()
        is_planning = to_word(service_class, SERVICE_CLASSES, "service_class") == SERVICE_CLASSES["planning"]
        self._worker = Worker(slice_s=0.0, pause_s=0.001)
        self._connection: Any = None
        self._pair_count = 0
        self._backend = ""
        urls = [url] if isinstance(url, (str, bytes)) or not isinstance(url, Sequence) else url
        if not len(urls):
            raise ValueError("url: expected at least one, got none")
        self._connection = _client.Client(
            [to_text(one, "url") for one in urls],
            to_number_from_0(timeout_s, "timeout_s"),
            "" if server_key is None else to_path(server_key, "server_key"),
            "" if key is None else to_path(key, "key"),
            None if hang_s is None else to_number_from_0(hang_s, "hang_s"),
            is_planning,
        )
        self._url = self._connection.url

    @property
    def url(self) -> str:
        """The url of the current connection."""
        if self._connection is not None:
            self._url = self._connection.url
        return self._url

    @property
    def epoch(self) -> int:
        """Identifies the run of the daemon that this client's requests are for; 0 for a daemon without epochs."""
        return self._use().epoch

    def acknowledge_epoch(self) -> int:
        """Accepts the current daemon after NewEpoch, and returns its epoch.

        Poses, attachments and bodies that clients had sent are lost and must be sent again.
        """
        return self._use().acknowledge_epoch()

    @property
    def timeout_s(self) -> float:
        """Default timeout of a call, in seconds."""
        return self._use().timeout_s

    @timeout_s.setter
    def timeout_s(self, seconds: float) -> None:
        self._use().timeout_s = to_number_from_0(seconds, "timeout_s")

    @property
    def backend(self) -> str:
        """The daemon's backend."""
        self._names
        return self._backend

    def refresh(self) -> None:
        """Fetches the scene again, to see bodies that another client added.

        Calls adopt a changed scene by themselves, as long as their ids mean the same; otherwise they raise StaleQuery.
        """
        self._names_cache = self._fetch_names(True)

    def reload(self, timeout_s: float = 600.0) -> SceneChanged:
        """Makes the daemon reload its scene file, and waits for the new scene. Queries of other clients continue.

        Bodies keep their poses and attachments by name. If loading fails, the old scene stays, and this raises
        RequestError with the code RELOAD_FAILED and the loader's message. timeout_s applies to this call only.
        """
        return self._changed(*self._use().reload(to_number_from_0(timeout_s, "timeout_s")))

    def wait_for_poses(self, stamp_ns: int, of: BodyRef = "*", timeout_s: float = 10.0) -> None:
        """Waits until the daemon has poses with this stamp or a newer one, so that the next query sees them.

        stamp_ns: publisher's clock, as in set_poses(); above 0.
        of: body or group whose poses to wait for. Bodies without any stamp are ignored, but at least one must have a
            stamp. Default: every body.
        timeout_s: seconds, at most 10; then RequestError with the code POSES_LATE.

        Costs one round trip if the poses are there. Raises as distances() does.
        """
        stamp = to_count(stamp_ns, "stamp_ns")
        if not stamp:
            raise ValueError("stamp_ns: expected a stamp above 0, got 0")
        seconds = to_number(timeout_s, "timeout_s")
        if not 0 <= seconds <= 10:
            raise ValueError(f"timeout_s: expected 0 to 10 seconds, got {timeout_s}")
        names = self._names
        every = isinstance(of, str) and of == "*"
        raw = _client.Query(np.empty((0, 2), np.uint32), None, None, 0 if every else names.revision)
        raw.min_pose_stamp_ns, raw.pose_wait_ns = stamp, round(1e9 * seconds)
        raw.wait_for = EVERY_BODY if every else names.selector(of, "of")
        connection = self._use()
        if self._guarded(connection.ask, raw, None, None, True, seconds + connection.timeout_s) is None:
            raise TimeoutError(f"{self._url}: no answer within {seconds + connection.timeout_s:g} s")

    def body_states(self) -> list[BodyState]:
        """Returns the current state of each body, in the order of ids."""
        return [
            BodyState(
                np.array(pose), Status(status), None if parent == NONE else parent, stamp, None if age < 0 else age
            )
            for pose, status, parent, stamp, age in self._use().body_states()
        ]

    def stats(self) -> dict[str, int]:
        """Returns the daemon's counters."""
        return dict(self._use().stats())

    def wait_covers(self, timeout_s: float = 60.0) -> bool:
        """Waits until the daemon has made all covers, which make decisions faster, and returns whether it has.

        timeout_s: seconds.
        """
        until = time.monotonic() + to_number_from_0(timeout_s, "timeout_s")
        while self.stats().get("engine.covers_pending", 0) > 0:
            if time.monotonic() >= until:
                return False
            time.sleep(0.05)
        return True

    def ping(self, payload: bytes = b"") -> float:
        """Sends `payload` to the daemon and back; returns the round-trip time in seconds."""
        if not isinstance(payload, bytes):
            raise TypeError(f"payload: expected bytes, got {payload!r}")
        return self._use().ping(payload)

    def close(self) -> None:
        """Closes the connection. Existing results stay valid, also those with copy=False."""
        self._connection = None

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *exception: Any) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<clearance.Client {self._url}{'' if self._connection is not None else ' (closed)'}>"

    # ---- required by Front ----------------------------------------------------------------------------------------

    def _use(self) -> Any:
        if self._connection is None:
            raise ConnectionError(f"{self._url}: this client is closed")
        return self._connection

    def _fetch_names(self, refresh: bool) -> NameTable:
        revision, self._backend, self._pair_count, bodies, groups = self._use().scene(refresh)
        infos = [
            BodyInfo(name, i, None if parent == NONE else parent, *rest)
            for i, (name, parent, *rest) in enumerate(bodies)
        ]
        return NameTable(revision, infos, {name: np.array(ids, dtype=np.uint32) for name, ids in groups})

    def _load_names(self) -> NameTable:
        return self._fetch_names(False)

    def _scene_revision(self) -> int:
        return self._names.revision

    def _fetch_pairs(self, raw: Any) -> np.ndarray:
        return self._guarded(self._use().pairs, raw)

    def _refresh_names(self) -> None:
        self.refresh()

    def _certify(
        self, rows: Optional[np.ndarray], run: Run, poses: Optional[np.ndarray], positions: Optional[np.ndarray]
    ) -> str:
        return self._guarded(self._use().certificate, run.raw, poses, positions, rows)

    def _default_fields(self, query: Query, moves: bool, count: int) -> int:
        rows = count
        if query.reduce not in (Reduce.MIN, Reduce.ANY):
            each = query.rows_each.get(moves)
            if each is None:
                each = query.rows_each[moves] = self._rows_each(query, moves)
            rows *= each
        if query.reduce == Reduce.WITHIN:
            rows = min(rows, query.max_results)
        few = rows <= DEFAULT_POINTS_ROWS
        return DEFAULT_FIELDS | (FIELD_MASKS["points"] | FIELD_MASKS["normal"] if few else 0)

    def _rows_each(self, query: Query, moves: bool) -> int:
        if query.reduce == Reduce.NEAREST:
            return len(self._names.bodies)
        if query.pairs is None and not moves:
            return self._pair_count
        if query.pairs is not None and not query.selects:
            return len(query.pairs)
        return len(self._table(query.pairs, *query.moved(moves)))

    def _answer(self, run: Run, poses: Optional[np.ndarray], positions: Optional[np.ndarray]) -> Any:
        connection = self._use()
        timeout = connection.timeout_s if run.timeout_s is None else run.timeout_s
        answer = self._guarded(connection.ask, run.raw, poses, positions, run.copy, timeout)
        if answer is None:
            raise TimeoutError(f"{self._url}: no answer within {timeout:g} s")
        return answer

    def _open_plan(self, configurations: int, run: Run, *no_input: None) -> RemotePlan:
        table = self._table(run.pairs, run.bodies, run.joints)
        plan = self._guarded(self._use().plan_on_device, run.raw, configurations)
        return RemotePlan(plan, run.bodies, table, run.joints, reduced=run.reduce != 0)

    def _start(self, task: Task, timeout_s: Optional[float]) -> Future:
        seconds = self._use().timeout_s if timeout_s is None else timeout_s
        return self._worker.add(Future(self._worker, task, seconds, is_driven_by_caller=True))

    def _begin(self, run: Run, poses: Optional[np.ndarray], positions: Optional[np.ndarray]) -> Any:
        return self._guarded(self._use().submit, run.raw, poses, positions, run.copy)

    def _poll(self, job: Any, seconds: float) -> bool:
        return job.wait(seconds)

    def _take(self, job: Any) -> Any:
        return self._guarded(job.answer)

    def _abandon(self, job: Any) -> None:
        job.cancel()

    # The connection sends the scene revision of its own copy of the scene, and needs none of these.

    def _send_poses(
        self, ids: np.ndarray, poses: np.ndarray, stamp_ns: int, sequence: int, revision: int
    ) -> UpdateResult:
        return UpdateResult(*self._guarded(self._use().set_poses, ids, poses, stamp_ns, sequence))

    def _load_joints(self) -> tuple[list[Any], list[Any]]:
        return self._use().joints()

    def _send_joints(self, ids: np.ndarray, positions: np.ndarray, stamp_ns: int, sequence: int) -> UpdateResult:
        return UpdateResult(*self._guarded(self._use().set_joints, ids, positions, stamp_ns, sequence))

    def _send_points(
        self, body: int, xyz: np.ndarray, radius: Optional[float], stamp_ns: int, sequence: int, revision: int
    ) -> UpdateResult:
        return UpdateResult(*self._guarded(self._use().set_points, body, xyz, radius, stamp_ns, sequence))

    def _send_attach(
        self, child: int, parent: int, pose: Optional[np.ndarray], allow: np.ndarray, revision: int
    ) -> UpdateResult:
        return UpdateResult(
            *self._guarded(self._use().attach, child, parent, None if pose is None else pose.reshape(1, 7), allow)
        )

    def _send_allow(self, a: int, b: int, allow: bool, revision: int) -> UpdateResult:
        return UpdateResult(*self._guarded(self._use().allow, a, b, allow))

    def _send_body(self, body: NewBody, revision: int) -> tuple[int, int, int, float]:
        return self._guarded(self._use().add_body, *body, False)

    def _send_shape(self, name: str, shape: ShapeArgument, radius: float) -> tuple[int, int, int, float]:
        kind, numbers, triangles, mesh_as, cloud = shape
        rest = NONE, False, None, (0.0, 0.0, 0.0, 0.0)
        return self._guarded(self._use().add_body, name, kind, numbers, radius, *rest, triangles, mesh_as, cloud, True)

    def _send_removal(self, name: str) -> tuple[int, int, int, float]:
        return self._guarded(self._use().remove_body, name)

    def _guarded(self, call: Any, *args: Any) -> Any:
        """Calls, and discards the cached names if the daemon rejects the request for its scene."""
        try:
            return call(*args)
        except QueryError as error:
            if error.code == ErrorCode.WRONG_SCENE:
                self._names_cache = None
            raise
