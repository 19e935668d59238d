"""One connection to a daemon at any of the urls, with its epoch and a watchdog of its loop."""

from __future__ import annotations

import os
import struct
import time
from collections.abc import Sequence
from typing import Any, Optional, Union

from .._errors import ConnectionError, DaemonHung, QueryError, RequestError, TimeoutError
from ..wire import CommonRecord, FrameType
from .frames import OWN_REQUESTS, Frame, header_bytes, malformed, record
from .shm_channel import ShmChannel
from .urls import Keys, check_url, keys_of
from .zmq_channel import ZmqChannel

_SHORTEST_HANG_S = 0.01
_ERROR = struct.Struct("<HxxI8x")


class HangWatch:
    """Samples a channel's signs of life a few times within the patience, while a call waits.

    Counts samples instead of time, so that a process that was itself suspended does not report a hung daemon.
    """

    _LOOKS, _SLACK_S, _LARGE, _S_PER_BYTE = 8, 0.1, 1 << 20, 100e-9  # 10 MB/s, the speed of a 100 Mbit/s network

    def __init__(self, patience_s: float):
        self._step = patience_s / self._LOOKS
        self._due = self._quiet_until = 0.0
        self._last = self._still = 0

    def due(self) -> float:
        """Returns the time of the next sample."""
        return self._due if self._step > 0 else float("inf")

    def look(self, channel: Any, now: float) -> bool:
        """Takes a sample, not before due(). Returns whether the daemon has shown no sign of life in all samples."""
        is_late = now - self._due > max(self._step, self._SLACK_S)  # no call was waiting, or this process did not run
        self._due = now + self._step
        if is_late or now < self._quiet_until:
            return False
        sign = channel.sign_of_life()
        self._still = 0 if sign == 0 or sign != self._last else self._still + 1
        self._last = sign
        return self._still >= self._LOOKS

    def expect(self, size: int) -> None:
        """Postpones samples while a frame of so many bytes delays the signs of life behind it."""
        if size >= self._LARGE:
            self._quiet_until = max(self._quiet_until, time.monotonic()) + size * self._S_PER_BYTE


class Connection:
    """Sends and receives frames, matched by request id. Not thread-safe."""

    def __init__(self, urls: Sequence[str], timeout_s: float, keys: Keys, hang_s: Optional[float]):
        self._hang_s = max(1.0, timeout_s / 5) if hang_s is None else hang_s
        if 0 < self._hang_s < _SHORTEST_HANG_S or self._hang_s < 0:
            raise ValueError(f"hang: expected 0, or 10 ms and more, got {round(1e9 * self._hang_s)} ns")
        self._urls = list(urls)
        self._keys = keys
        for url in self._urls:  # reports an invalid url at once, not on its first use
            check_url(url)
        self.url = self._urls[0]
        self.timeout_s = timeout_s
        self.epoch = 0
        self._process = os.getpid()
        self._channel: Any = None
        self._at = 0
        self._has_met = self._has_hung = False
        self._epoch_record = b""
        self._next_request, self._next_own, self._oldest_request = 1, OWN_REQUESTS, 0
        self._watch = HangWatch(self._hang_s)
        self._connect_to(0, timeout_s)

    def __del__(self) -> None:
        channel = self.__dict__.get("_channel")
        if channel is not None and not self.forked():
            channel.close()

    def forked(self) -> bool:
        return os.getpid() != self._process

    def check_process(self) -> None:
        if self.forked():
            raise ConnectionError(
                f"{self.url}: this connection was opened before a fork; the child process must open a new one"
            )

    def next_request_id(self) -> int:
        self._next_request += 1
        return self._next_request - 1

    def prepare(self) -> bytes:
        """Returns the record at the end of a request. Reconnects after the loss of the daemon."""
        self.check_process()
        if self._channel is None or self._channel.lost or self._has_hung:
            self._oldest_request = self._next_request
            patience = min(self.timeout_s, self._hang_s) if self._has_hung else self.timeout_s
            self._connect_to((self._at + 1) % len(self._urls), patience)
        if not self._has_met:
            self._meet(time.monotonic() + self.timeout_s)
        return self._epoch_record

    def send(self, header: bytes, parts: Sequence[Any], reply_bytes: int) -> None:
        if self._channel.signs_queue_up:
            self._watch.expect(sum(memoryview(part).nbytes for part in parts) + reply_bytes)
        self._channel.send(header, parts, reply_bytes)

    def wait_for(self, request_id: int, deadline: float) -> Optional[Frame]:
        """Returns the reply, or None after the deadline. Raises ConnectionError, DaemonHung."""
        self.check_process()
        if request_id < self._oldest_request:
            raise ConnectionError(
                f"{self.url}: the daemon disconnected before request {request_id} was answered; the connection "
                "has been replaced"
            )
        while True:
            frame = self._channel.receive(request_id, min(deadline, self._watch.due()))
            if frame is not None:
                return frame
            now = time.monotonic()
            if now >= self._watch.due() and self._watch.look(self._channel, now):
                self._has_hung = True
                raise DaemonHung(
                    f"{self.url}: the daemon hangs: its loop has been blocked for {self._hang_s:g} s with a request "
                    "under way"
                )
            if now >= deadline:
                return None

    def forget(self, request_id: int) -> None:
        if not self.forked() and request_id >= self._oldest_request:
            self._channel.forget(request_id)

    def acknowledge_epoch(self) -> int:
        self.prepare()
        self._meet(time.monotonic() + self.timeout_s)
        return self.epoch

    def _connect_to(self, first: int, patience_s: float) -> None:
        """Connects to the url of that index, or to the next one that responds. patience_s: timeout of the last one."""
        why: list[str] = []
        for i in range(len(self._urls)):
            is_last = i + 1 == len(self._urls)
            patience = patience_s if is_last or not self._hang_s else min(patience_s, self._hang_s)
            deadline = time.monotonic() + patience
            try:
                self._at = (first + i) % len(self._urls)
                old, self._channel = self._channel, None
                if old is not None:
                    old.close()
                self._channel = self._open(self._urls[self._at], deadline)
                self.url = self._channel.url
                self._watch = HangWatch(self._hang_s)
                self._has_hung = False
                if not self._has_met:
                    self._meet(deadline)
                return
            except RequestError:
                return  # the daemon is too busy to send its epoch, which the first request fetches again
            except ConnectionError as error:
                if len(self._urls) == 1:
                    raise
                why.append(str(error))
        raise ConnectionError("; ".join(why))

    def _open(self, url: str, deadline: float) -> Any:
        kind, _, rest = url.partition("://")
        if kind == "shm":
            return ShmChannel(rest, deadline)
        if kind == "udpm":
            raise ConnectionError(
                f"{url}: this pure-Python client does not support LCM; install the wheel clearance-*.whl for it"
            )
        return ZmqChannel(url.partition("?")[0], keys_of(url, self._keys), deadline)

    def _meet(self, deadline: float) -> None:
        """Fetches the daemon's epoch. Raises RequestError if the daemon rejects the request."""
        self._next_own += 1
        self._channel.send(header_bytes(FrameType.PING, self._next_own, 0), [b""], 0)
        frame = self.wait_for(self._next_own, deadline)
        if frame is None:
            self._channel.forget(self._next_own)
            raise TimeoutError(f"{self.url}: the daemon does not answer")
        if frame.type == FrameType.ERROR:
            raise RequestError(*parse_error(frame, self.url))
        self.epoch = frame.epoch(self.url)
        self._has_met = True
        self._epoch_record = record(CommonRecord.EPOCH, struct.pack("<Q", self.epoch)) if self.epoch else b""


def parse_error(frame: Frame, url: str) -> tuple[int, str]:
    """Returns code and text of an error frame."""
    if len(frame.payload) < _ERROR.size:
        raise malformed(url, "an error without its header")
    code, size = _ERROR.unpack_from(frame.payload)
    text = bytes(frame.payload[16:])
    if size != len(text):
        raise malformed(url, "an error whose text has another length")
    return code, text.decode(errors="replace")


def rejection(code: int, text: str) -> Union[QueryError, RequestError]:
    """Returns the exception for an error frame's code."""
    return (QueryError if code < 16 else RequestError)(code, text)
