"""A connection over ZeroMQ, from a DEALER to the daemon's ROUTER, with frames as two message parts."""

from __future__ import annotations

import contextlib
import os
import struct
import time
from collections.abc import Sequence
from typing import Any, Optional

import numpy as np
import zmq

from .._errors import ConnectionError
from ..wire import COLUMN_ALIGNMENT, MAX_FRAME_BYTES, FrameType
from .frames import HEADER, SIGN_REQUEST, Frame, header_bytes, malformed

#: Interval between reads of the monitor while waiting, and so the maximum delay to detect a daemon's death.
_NAP_S = 0.01
#: Maximum number of requests without a reply, for whose replies the daemon has queue space.
_MOST_OUTSTANDING = 1000


class ZmqChannel:
    """One connection. Not thread-safe."""

    signs_queue_up = True

    def __init__(self, endpoint: str, keys: Optional[tuple[str, str, str]], deadline: float):
        """keys: the daemon's public key, the client's public and secret key."""
        self.url = endpoint
        self.lost = False
        self._with_keys = keys is not None
        self._connected, self._failure, self._arrived = False, 0, 0
        self._outstanding: set[int] = set()
        self._kept: dict[int, Frame] = {}
        # The process's context, which is never terminated, since that waits for all its sockets, even in a destructor.
        self._socket = zmq.Context.instance().socket(zmq.DEALER)
        self._socket.setsockopt(zmq.LINGER, 0)
        self._socket.setsockopt(zmq.MAXMSGSIZE, MAX_FRAME_BYTES)
        # No reconnection: a lost daemon is an error, since a new one can have another scene.
        self._socket.setsockopt(zmq.RECONNECT_IVL, -1)
        if keys:
            options = (zmq.CURVE_SERVERKEY, zmq.CURVE_PUBLICKEY, zmq.CURVE_SECRETKEY)
            for option, key in zip(options, keys):
                self._socket.setsockopt(option, key.encode())
        self._monitor = self._socket.get_monitor_socket(
            zmq.EVENT_HANDSHAKE_SUCCEEDED | zmq.EVENT_HANDSHAKE_FAILED_NO_DETAIL | zmq.EVENT_HANDSHAKE_FAILED_PROTOCOL
            | zmq.EVENT_HANDSHAKE_FAILED_AUTH | zmq.EVENT_CLOSED | zmq.EVENT_DISCONNECTED | zmq.EVENT_CONNECT_RETRIED
        )  # fmt: skip
        try:
            self._socket.connect(endpoint)
            while not self._connected:
                if self.lost:
                    raise self._error(self._why_rejected())
                left = deadline - time.monotonic()
                if left <= 0 or not self._monitor.poll(max(1, int(1e3 * left))):
                    raise self._error("no daemon answered in time")
                self._read_events()
        except zmq.ZMQError as error:
            self.close()
            raise self._error(str(error)) from None
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        self._socket.disable_monitor()
        self._monitor.close(0)
        self._socket.close(0)

    def send(self, header: bytes, parts: Sequence[Any], reply_bytes: int) -> None:
        payload = parts[0] if len(parts) == 1 else b"".join(memoryview(part).cast("B") for part in parts)
        if len(self._outstanding) >= _MOST_OUTSTANDING:
            self._take_arrived(HEADER.unpack(header)[3], 0.0)
        if self.lost:
            raise self._error("the daemon has gone")
        try:
            if len(self._outstanding) >= _MOST_OUTSTANDING:
                raise zmq.Again
            self._socket.send_multipart([header, payload], zmq.DONTWAIT)
        except zmq.Again:
            self._read_events()
            why = "the daemon has gone" if self.lost else "the daemon takes no more requests: its queue is full"
            raise self._error(why) from None
        except zmq.ZMQError as error:
            raise self._error(str(error)) from None
        self._outstanding.add(HEADER.unpack(header)[3])

    def receive(self, request_id: int, deadline: float) -> Optional[Frame]:
        while True:
            left = deadline - time.monotonic()
            self._take_arrived(request_id, min(max(left, 0.0), _NAP_S))
            frame = self._kept.pop(request_id, None)
            if frame is not None:
                return frame
            if self.lost:
                raise self._error("the daemon has gone")
            if left <= 0:
                return None
            self._read_events()

    def forget(self, request_id: int) -> None:
        self._outstanding.discard(request_id)
        self._kept.pop(request_id, None)

    def sign_of_life(self) -> int:
        """Requests an echo from the daemon's loop, since ZeroMQ's own thread answers ZeroMQ's heartbeats."""
        with contextlib.suppress(zmq.ZMQError):  # without a sign of life
            self._socket.send_multipart([header_bytes(FrameType.PING, SIGN_REQUEST, 0), b""], zmq.DONTWAIT)
        return self._arrived + 1

    def _error(self, cause: str) -> ConnectionError:
        return ConnectionError(f"{self.url}: {cause}")

    def _take_arrived(self, request_id: int, nap_s: float) -> None:
        if request_id in self._kept or not self._socket.poll(-(-nap_s // 0.001)):
            return
        while request_id not in self._kept:
            try:
                parts = self._socket.recv_multipart(zmq.DONTWAIT, copy=False)
            except zmq.Again:
                return
            except zmq.ZMQError as error:
                raise self._error(str(error)) from None
            if len(parts) != 2 or len(parts[0]) != HEADER.size:
                raise malformed(self.url, "a frame is a header of 64 bytes and a payload")
            frame = Frame(parts[0].buffer, _aligned(parts[1].buffer), self.url)
            self._arrived += 1
            if frame.request_id in self._outstanding:
                self._outstanding.discard(frame.request_id)
                self._kept[frame.request_id] = frame

    def _read_events(self) -> None:
        while self._monitor.poll(0):
            event, _ = self._monitor.recv_multipart()
            (what,) = struct.unpack_from("=H", event)
            if what == zmq.EVENT_HANDSHAKE_SUCCEEDED:
                self._connected = True
            elif what != zmq.EVENT_MONITOR_STOPPED:
                self.lost = True
            if not self._connected and not self._failure:
                self._failure = what

    def _why_rejected(self) -> str:
        # The first failure, after which the connection is closed in any case.
        is_ipc = self.url.startswith("ipc://")  # which has no keys
        if self._failure == zmq.EVENT_HANDSHAKE_FAILED_AUTH:
            return "the daemon rejects this client's key: it is not in the list of authorized keys"
        if self._failure in (
            zmq.EVENT_HANDSHAKE_FAILED_PROTOCOL,
            zmq.EVENT_HANDSHAKE_FAILED_NO_DETAIL,
            zmq.EVENT_DISCONNECTED,
        ):
            if is_ipc:
                return (
                    "the daemon closed the connection before the handshake: it is ending, or has no descriptor for "
                    "another client"
                )
            if self._with_keys:
                return "the daemon there has another key than server_key, or uses none"
            return (
                "the daemon there needs keys: give server_key=FILE&key=FILE in the url, or CLEARANCE_SERVER_KEY and "
                "CLEARANCE_KEY in the environment"
            )
        path = self.url[6:]
        if is_ipc and not os.path.exists(path):
            return f"no such socket: is clearanced running, with --zmq {self.url}?"
        if is_ipc and not os.access(path, os.W_OK):
            return "permission denied: the daemon's user alone may connect"
        return "no daemon listens there"


def _aligned(buffer: memoryview) -> Any:
    """Returns the bytes aligned for columns, since ZeroMQ does not align them."""
    array = np.frombuffer(buffer, np.uint8)
    if array.size == 0 or array.ctypes.data % COLUMN_ALIGNMENT == 0:
        return array
    room = aligned_bytes(array.size)
    room[:] = array
    return room


def aligned_bytes(size: int) -> np.ndarray:
    """Allocates (size,) uninitialised uint8, aligned for columns."""
    room = np.empty(size + COLUMN_ALIGNMENT, np.uint8)
    start = -room.ctypes.data % COLUMN_ALIGNMENT
    return room[start : start + size]
