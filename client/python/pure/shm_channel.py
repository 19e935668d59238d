"""A connection over shared memory. wire/shm_layout.h specifies layout and protocol."""

from __future__ import annotations

import contextlib
import os
import platform
import struct
import time
from collections.abc import Sequence
from typing import Any, Optional

from .._errors import ConnectionError, QueryError, TimeoutError
from ..wire import MAX_FRAME_BYTES, MAX_REQUEST_BYTES, ErrorCode, FrameType
from .frames import HEADER, Frame
from .shm_segment import ARRIVED, DROPPED, IDLE, POSTED, Lease, Segment
from .shm_socket import GROW, HELLO, REFUSED, RETIRE, ShmSocket

#: Interval between reads of the socket while waiting, and so the maximum delay to detect a daemon's death.
_NAP_S = 0.01
#: Timeout of send() for a larger segment, or for a slot with an abandoned reply.
_SEND_TIMEOUT_S = 5.0

_ERROR = struct.Struct("<HxxIQ")


class ShmChannel:
    """One connection. Not thread-safe."""

    signs_queue_up = False

    def __init__(self, target: str, deadline: float):
        self.url = "shm://" + target
        if platform.machine() != "x86_64":
            raise ConnectionError(
                f"{self.url}: shared memory from Python alone relies on x86-64's order of stores, and this is "
                f"{platform.machine()}; use ipc://, or install the wheel clearance-*.whl"
            )
        self._outgrown: list[Segment] = []
        self._wake = -1
        self._socket = ShmSocket(target, deadline)
        try:
            self._greet(deadline)
        except BaseException:
            self.close()
            raise

    @property
    def lost(self) -> bool:
        return bool(self._socket.dead)

    def close(self) -> None:
        self._socket.close()
        if self._wake >= 0:
            os.close(self._wake)
            self._wake = -1

    def sign_of_life(self) -> int:
        self._wake_daemon()
        return self._current.turns()

    def _greet(self, deadline: float) -> None:
        self._socket.say(HELLO)  # on failure, the daemon has rejected the connection, and its reason follows
        answer, fds = self._socket.await_answer(deadline)
        if answer.kind == REFUSED:
            raise ConnectionError(f"{self.url}: rejected: {answer.why()}")
        if len(fds) != 2:
            raise ConnectionError(f"{self.url}: the daemon's greeting lacks the segment")
        self._wake = fds.pop()
        self._current = self._segment_of(fds)

    def _segment_of(self, fds: list[int]) -> Segment:
        try:
            if not fds:
                self._socket.die("the daemon's message lacks the segment")
            return Segment(fds[0], self.url)
        finally:
            for fd in fds:
                os.close(fd)

    # ---- frames ---------------------------------------------------------------------------------------------------

    def send(self, header: bytes, parts: Sequence[Any], reply_bytes: int) -> None:
        self._socket.check()
        self._retire_outgrown()
        views = [memoryview(part).cast("B") for part in (header, *parts) if memoryview(part).nbytes]
        size = sum(len(view) for view in views)
        if size > self._current.request_capacity:
            why = self._grow(size, reply_bytes, time.monotonic() + _SEND_TIMEOUT_S)
            if why is not None:
                text = f"{self.url}: a request of {size} bytes does not fit: {why}"
                raise QueryError(int(ErrorCode.TOO_LARGE), text)
        index = self._take_slot()
        segment = self._current
        area = memoryview(segment.request_area(index))  # type: ignore[arg-type]
        at = 0
        for view in views:
            area[at : at + len(view)] = view
            at += len(view)
        segment.slots[index].request_id = HEADER.unpack(header)[3]
        segment.slots[index].request_bytes = size
        self._post(segment, index)

    def receive(self, request_id: int, deadline: float) -> Optional[Frame]:
        found = self._find(request_id)
        if found is None:
            raise ConnectionError(f"{self.url}: no request {request_id} is under way")
        while True:
            self._collect()
            segment, index = found
            slot = segment.slots[index]
            if slot.state == ARRIVED:
                frame = self._take_reply(segment, index)
                if not self._send_again(segment, index, frame):
                    return frame
                found = self._find(request_id)
                assert found is not None
                continue
            if slot.state == DROPPED:
                slot.state = IDLE
                segment.free.add(index)
                raise ConnectionError(f"{self.url}: the daemon dropped request {request_id}")
            self._socket.check()
            left = deadline - time.monotonic()
            if left <= 0:
                return None
            segment.sleep(min(_NAP_S, left))
            if segment.nothing_new():
                self._socket.look()

    def forget(self, request_id: int) -> None:
        found = self._find(request_id)
        if found is None:
            return
        segment, index = found
        slot = segment.slots[index]
        slot.forgotten = True  # the reply will return its slot
        if slot.state != POSTED:
            slot.state = IDLE
            segment.free.add(index)

    def _post(self, segment: Segment, index: int) -> None:
        segment.post(index)
        self._wake_daemon()

    def _wake_daemon(self) -> None:
        with contextlib.suppress(OSError):
            os.write(self._wake, b"\x01\0\0\0\0\0\0\0")

    def _collect(self) -> None:
        sane = [segment.collect() for segment in (self._current, *self._outgrown)]
        if not all(sane) and not self._socket.dead:
            self._socket.dead = f"{self.url}: the shared segment is corrupted"

    def _take_reply(self, segment: Segment, index: int) -> Frame:
        slot = segment.slots[index]
        slot.state = IDLE
        lease = Lease(segment, index)
        reply = segment.reply(index)
        frame = Frame(reply[: HEADER.size].tobytes(), reply[HEADER.size :], self.url, lease)
        if frame.request_id != slot.request_id:
            raise ConnectionError(f"{self.url}: the reply to request {slot.request_id} is corrupted")
        return frame

    def _send_again(self, segment: Segment, index: int, reply: Frame) -> bool:
        """Sends the request again from a larger segment if the reply reports a lack of space.

        The frame still leases the slot, so that the request is intact. Returns false to accept the reply.
        """
        old = segment.slots[index]
        needed = _room_needed(reply)
        if not segment.reply_capacity < needed <= MAX_FRAME_BYTES or old.retried or self._socket.dead:
            return False
        too_small = needed > self._current.reply_capacity or old.request_bytes > self._current.request_capacity
        if too_small and self._grow(old.request_bytes, needed, time.monotonic() + _SEND_TIMEOUT_S) is not None:
            return False
        again = self._current.take_slot()
        if again < 0:
            return False
        size = old.request_bytes
        self._current.request_area(again)[:size] = segment.request_area(index)[:size]
        fresh = self._current.slots[again]
        fresh.request_id, fresh.request_bytes, fresh.retried = old.request_id, size, True
        self._post(self._current, again)
        return True

    # ---- segments and slots ---------------------------------------------------------------------------------------

    def _find(self, request_id: int) -> Optional[tuple[Segment, int]]:
        """Returns segment and slot of a pending request, or None."""
        for segment in (self._current, *self._outgrown):
            for index, slot in enumerate(segment.slots):
                if slot.request_id == request_id and slot.state != IDLE and not slot.forgotten:
                    return segment, index
        return None

    def _take_slot(self) -> int:
        deadline = time.monotonic() + _SEND_TIMEOUT_S
        while True:
            self._collect()
            index = self._current.take_slot()
            if index >= 0:
                return index
            slots = self._current.slots
            posted = sum(slot.state == POSTED and not slot.forgotten for slot in slots)
            arrived = sum(slot.state in (ARRIVED, DROPPED) for slot in slots)
            if not any(slot.state == POSTED and slot.forgotten for slot in slots):
                raise ConnectionError(
                    f"{self.url}: all {len(slots)} slots are taken: {posted} requests under way, {arrived} replies not "
                    f"yet received, {len(slots) - posted - arrived} replies still held; release some"
                )
            self._socket.check()
            left = deadline - time.monotonic()
            if left <= 0:
                raise TimeoutError(f"{self.url}: the daemon has not given back the slot of an abandoned request")
            self._current.sleep(min(_NAP_S, left))
            if self._current.nothing_new():
                self._socket.look()

    def _grow(self, request_bytes: int, reply_bytes: int, deadline: float) -> Optional[str]:
        """Changes to a segment with slots of this size. Returns None, or the daemon's reason to reject it."""
        # Doubling avoids a new segment for every slightly larger batch; near the limits, sizes are exact.
        larger = _doubled(request_bytes, MAX_REQUEST_BYTES), _doubled(reply_bytes, MAX_FRAME_BYTES)
        why: Optional[str] = ""
        for wanted in dict.fromkeys([larger, (request_bytes, reply_bytes), (request_bytes, 0)]):
            why = self._ask_segment(*wanted, deadline)
            if why is None:
                break
        return why

    def _ask_segment(self, request_bytes: int, reply_bytes: int, deadline: float) -> Optional[str]:
        request_bytes = max(request_bytes, self._current.request_capacity)
        reply_bytes = max(reply_bytes, self._current.reply_capacity)
        if not self._socket.say(GROW, 0, request_bytes, reply_bytes):
            self._socket.look()
            self._socket.dead = self._socket.dead or f"{self.url}: the daemon takes no messages"
            self._socket.check()
        try:
            answer, fds = self._socket.await_answer(deadline)
        except TimeoutError as error:
            self._socket.dead = str(error)  # a late answer would be assigned to another request
            raise
        if answer.kind == REFUSED:
            return answer.why()
        larger = self._segment_of(fds)
        if larger.request_capacity < request_bytes or larger.reply_capacity < reply_bytes:
            self._socket.die("the daemon handed over a smaller segment than requested")
        self._outgrown.append(self._current)
        self._current = larger
        self._retire_outgrown()
        return None

    def _retire_outgrown(self) -> None:
        """Releases outgrown segments without requests, replies or frames."""
        self._outgrown = [s for s in self._outgrown if not (s.all_free() and self._socket.say(RETIRE, s.id))]


def _room_needed(frame: Frame) -> int:
    """Returns the size that a reply needs if it reports a lack of space, otherwise 0."""
    if frame.type != FrameType.ERROR or len(frame.payload) < _ERROR.size:
        return 0
    code, _, needed = _ERROR.unpack_from(frame.payload)
    return needed if code == ErrorCode.TOO_LARGE else 0


def _doubled(size: int, limit: int) -> int:
    return size if size > limit // 2 else 1 << max(size - 1, 0).bit_length()
