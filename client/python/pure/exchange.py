"""Requests and replies of one connection as frames."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any, Optional

import numpy as np

from .. import wire
from .._errors import ConnectionError, NewEpoch, QueryError, TimeoutError
from ..wire import MAX_REQUEST_BYTES, ErrorCode, FrameType
from .connection import Connection, parse_error, rejection
from .frames import Frame, header_bytes, malformed, name_of_type


class Exchange:
    """Sends requests and receives their replies. Not thread-safe."""

    def __init__(self, connection: Connection, options: dict[str, Any], as_planning: bool):
        self.connection = connection
        self._flags = int(as_planning)  # FrameFlag bits of requests
        self._options = options
        self._scene_is_old = False  # reported by the daemon; the caller's next read fetches the scene again

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

    def interpret(self, frame: Frame, type: str) -> Frame:
        """Returns the frame if it has that type; raises the error of an error frame."""
        url = self.connection.url
        if frame.type == FrameType.ERROR:
            code, text = parse_error(frame, url)
            if code == ErrorCode.WRONG_SCENE:
                self._scene_is_old = True
            if code == ErrorCode.NEW_EPOCH:
                raise NewEpoch(code, f"{url}: {text}")
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
            self.connection.forget(request_id)
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


def text_of(name: Any) -> str:
    """Returns a name of a record as text."""
    return bytes(name).split(b"\0")[0].decode(errors="replace")
