"""A client of the daemon."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from typing import Any, Optional, Union

import numpy as np

from .. import _client
from .._arguments import to_count, to_number, to_number_from_0, to_path, to_text, to_word
from .._errors import TimeoutError
from .._names import BodyRef
from .._query.future import Worker
from .._words import EVERY_BODY, NONE, SERVICE_CLASSES, ServiceWord, Status
from .front import BodyState
from .remote import RemoteFront
from .scene_changes import SceneChanged


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
        is also limited by the daemon's rights (docs/service/security.md).

    Raises ConnectionError naming url and cause, over LCM also if several daemons respond; ValueError for a url of an
    unknown kind.
    """
    return Client(url, timeout_s, server_key=server_key, key=key, hang_s=hang_s, service_class=service_class)


class Client(RemoteFront):
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
        self._refresh_names()

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
        timeout_s: seconds, above 0 and at most 10; then RequestError with the code POSES_LATE. Default: 10.

        Costs one round trip if the poses are there. Raises as distances() does.
        """
        stamp = to_count(stamp_ns, "stamp_ns")
        if not stamp:
            raise ValueError("stamp_ns: expected a stamp above 0, got 0")
        seconds = to_number(timeout_s, "timeout_s")
        if not 0 < seconds <= 10:
            raise ValueError(f"timeout_s: expected above 0 and at most 10 seconds, got {timeout_s}")
        names = self._names
        every = isinstance(of, str) and of == "*"
        raw = _client.Query(np.empty((0, 2), np.uint32), None, None, 0 if every else names.revision)
        raw.min_pose_stamp_ns, raw.deadline_ns = stamp, max(1, round(1e9 * seconds))
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
        """Waits until the daemon has made all covers and joint tables. Returns whether it has.

        timeout_s: seconds.
        """
        until = time.monotonic() + to_number_from_0(timeout_s, "timeout_s")
        pending = ("engine.covers_pending", "engine.joint_tables_pending")
        while sum(count for name, count in self.stats().items() if name in pending) > 0:
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
