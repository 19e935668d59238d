"""A client of the daemon."""

from __future__ import annotations

import concurrent.futures
import os
from collections.abc import Sequence
from typing import Any, Optional, Union

import numpy as np

from . import _client
from ._arguments import ShapeArgument, to_number_from_0, to_path, to_text
from ._errors import ConnectionError, QueryError, TimeoutError
from ._front import BodyState, Front, Pairs
from ._future import Future
from ._joints import JointsRef
from ._names import BodyInfo, BodyRef, NameTable
from ._plan_arguments import plan_query
from ._query import Query
from ._remote_plan import RemotePlan
from ._result import Result
from ._scene_changes import NewBody, SceneChanged
from ._updates import UpdateResult
from ._words import DEFAULT_FIELDS, DEFAULT_POINTS_ROWS, FIELD_MASKS, NONE, Reduce, ReduceWord, Status
from .wire import ErrorCode


def connect(
    url: Union[str, Sequence[str]],
    timeout_s: float = 5.0,
    *,
    server_key: Union[str, os.PathLike[str], None] = None,
    key: Union[str, os.PathLike[str], None] = None,
    hang_s: Optional[float] = None,
    service_class: Literal["control", "planning"] = "control",
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
    service_class: "planning" lowers the requests of a client that has the class "control" (docs/security.md).

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
    _waits = True

    def __init__(
        self,
        url: Union[str, Sequence[str]],
        timeout_s: float = 5.0,
        *,
        server_key: Union[str, os.PathLike[str], None] = None,
        key: Union[str, os.PathLike[str], None] = None,
        hang_s: Optional[float] = None,
        service_class: Literal["control", "planning"] = "control",
    ):
        super().__init__()
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
            to_word(service_class, {"control": 0, "planning": 1}, "service_class") == 1,
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
        """Fetches the scene again, after another client changed it or the daemon started with another one.

        A query with an outdated scene raises QueryError with the code WRONG_SCENE.
        """
        self._names_cache = self._fetch_names(True)

    def reload(self, timeout_s: float = 600.0) -> SceneChanged:
        """Makes the daemon reload its scene file, and waits for the new scene. Queries of other clients continue.

        Bodies keep their poses and attachments by name. If loading fails, the old scene stays, and this raises
        RequestError with the code RELOAD_FAILED and the loader's message. timeout_s applies to this call only.
        """
        return self._changed(*self._use().reload(to_number_from_0(timeout_s, "timeout_s")))

    def plan_on_device(
        self,
        configurations: int = 0,
        bodies: Optional[Sequence[BodyRef]] = None,
        pairs: Pairs = None,
        fields: Union[str, Sequence[str], None] = None,
        *,
        joints: Optional[JointsRef] = None,
        reduce: ReduceWord = "none",
        **more: Any,
    ) -> RemotePlan:
        """Returns a query that runs in the memory of the daemon's GPU, mapped into this process without host copies.

        The arguments are those of Engine.plan_on_device(). Works over shm:// and ipc:// on the daemon's machine, and
        requires only the CUDA driver in this process. The plan keeps its scene: after a change by an attachment, a body
        or a reload, calls raise QueryError (WRONG_SCENE), and you need a new plan.

        Raises as Engine.plan_on_device(); RequestError (BUSY) beyond the daemon's limits on plans and memory
        (clearanced --help); and ConnectionError if this process has no driver or does not see that GPU.
        """
        self._names  # so that the scene's revision goes with the query
        query, count = plan_query(self, configurations, bodies, pairs, fields, joints, reduce, more)
        table = self._table(query.pairs, query.bodies, query.joints)
        plan = self._guarded(self._use().plan_on_device, query.raw, count)
        return RemotePlan(plan, query.bodies, table, query.joints, reduced=query.reduce != 0)

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

    def ping(self, payload: bytes = b"") -> float:
        """Sends `payload` to the daemon and back; returns the round-trip time in seconds."""
        if not isinstance(payload, bytes):
            raise TypeError(f"payload: expected bytes, got {payload!r}")
        return self._use().ping(payload)

    def close(self) -> None:
        """Closes the connection. Existing answers with copy=False stay valid."""
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

    def _certify(self, query: Query, rows: Optional[np.ndarray]) -> str:
        self._names  # so that the scene's revision goes with the query
        return self._guarded(self._use().certificate, query.raw, rows)

    def _default_fields(self, query: Query, configurations: int) -> int:
        names = self._names
        if query.reduce == Reduce.MIN:
            rows = configurations
        elif query.reduce == Reduce.NEAREST:
            rows = configurations * len(names.bodies)
        elif query.pairs is None and query.bodies is None and query.joints is None:
            rows = configurations * self._pair_count
        elif query.pairs is not None and not query.selects:
            rows = configurations * len(query.pairs)
        else:
            rows = configurations * len(self._table(query.pairs, query.bodies, query.joints))
        if query.reduce == Reduce.WITHIN:
            rows = min(rows, query.max_results)
        few = rows <= DEFAULT_POINTS_ROWS
        return DEFAULT_FIELDS | (FIELD_MASKS["points"] | FIELD_MASKS["normal"] if few else 0)

    def _answer(self, query: Query) -> Any:
        self._names  # so that the scene's revision goes with the query
        connection = self._use()
        timeout = connection.timeout_s if query.timeout_s is None else query.timeout_s
        answer = self._guarded(connection.ask, query.raw, query.out_list(), query.copy, timeout)
        if answer is None:
            raise TimeoutError(f"{self._url}: no answer within {timeout:g} s")
        return answer

    def _start(self, query: Query) -> Future:
        return ClientFuture(self, self._submit(query), query)

    def _submit(self, query: Query) -> Any:
        self._names  # so that the scene's revision goes with the query
        return self._guarded(self._use().submit, query.raw, query.out_list(), query.copy)

    def _wait(self, pending: Any, query: Query, timeout: Optional[float]) -> Any:
        if timeout is None:
            timeout = query.timeout_s
        if timeout is None:
            timeout = self._use().timeout_s
        if not pending.wait(timeout):
            raise TimeoutError(f"{self._url}: no answer within {timeout:g} s")
        return self._guarded(pending.answer)

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


class ClientFuture(Future):
    """A query that the daemon is answering."""

    def __init__(self, client: Client, pending: Any, query: Query):
        self._client = client
        self._pending = pending
        self._query = query
        self._result: Optional[Result] = None
        self._error: Optional[BaseException] = None

    def result(self, timeout: Optional[float] = None) -> Result:
        if self._error is not None:
            raise self._error
        if self._result is None:
            if timeout is not None:
                timeout = to_number_from_0(timeout, "timeout")
            try:
                answer = self._client._wait(self._pending, self._query, timeout)
            except TimeoutError:
                raise
            except Exception as error:
                self._error = error
                raise
            self._result = self._client._result(self._query, answer)
        return self._result

    def done(self) -> bool:
        if self._result is not None or self._error is not None:
            return True
        try:
            return self._pending.wait(0.0)
        except ConnectionError as error:
            self._error = error
            return True

    def cancel(self) -> bool:
        if self.done():
            return False
        self._pending.cancel()
        self._error = concurrent.futures.CancelledError()
        return True
